"""The page on which a log is dropped, in a real browser: from a file to the workbench of a fitted model."""

from __future__ import annotations

import contextlib
import http.client
import json
import shlex
import threading
from types import SimpleNamespace

import numpy as np
import pytest

import idloop
from idloop.cli import _start_page, main
from idloop.errors import InputError


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """A log whose header says neither a unit nor a time."""
    signal = idloop.excitation("multilevel", sample_time=0.01, duration=10.0, amplitude=0.5, seed=3)
    record = idloop.simulate(idloop.load_model("axis"), signal, seed=3)
    path = tmp_path_factory.mktemp("log") / "drive log.csv"
    columns = np.column_stack([record.input, np.degrees(record.output[:, 0])])
    np.savetxt(path, columns, delimiter=";", header="torque;angle", comments="", fmt="%.7g")
    return path


def test_the_document_says_what_is_missing_and_what_was_found(log, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    empty = _start_page.document_of([log], {})
    # In the words of the page: neither options nor the folder of its copy.
    assert empty["missing"] == ("drive log.csv: no column is a time: say it in the table, or give the rows per second")
    assert empty["columns"] == ["torque", "angle"]
    found = _start_page.document_of([log], {"rate": "100", "position": "angle=deg"})
    assert found["missing"] == ""
    columns = {one["role"]: (one["column"], one["unit"]) for one in found["signals"] if one["column"]}
    assert columns == {"command": ("torque", "N·m"), "position": ("angle", "deg")}
    (picture,) = found["pictures"]
    assert (picture["name"], picture["choice"]) == ("drive log.csv", False)
    assert picture["picture"].startswith("data:image/png;base64,")
    assert found["folder"] == str(tmp_path / "drive_log")
    assert found["turned"] == "-torque"
    assert found["doubts"] == ["the unit of the command is not written down and taken as N·m"]
    assert "'many' rows per second" in _start_page.document_of([log], {"rate": "many"})["missing"]


def test_what_is_not_fitted_says_where_it_was_written_and_why(log, tmp_path):
    given = {"rate": "100", "position": "angle=deg", "command": "-torque=N·m"}
    begun, unseen = _start_page.start_of([log], given, lambda name: tmp_path / name)
    assert unseen == ()
    text = _start_page.refused(begun)
    assert text.startswith(f"written to {tmp_path / 'drive_log'}, but not fitted: ")
    assert text.endswith("; choose torque as the command")
    assert "--" not in text


def test_records_that_do_not_belong_together_are_followed_by_their_commands(tmp_path):
    begun = SimpleNamespace(
        fit=None,
        folder=tmp_path,
        not_fitted="the records do not belong together; the commands below fit them apart",
        done=SimpleNamespace(reversed=False, apart=(("a",), ("b",))),
        commands=["idloop fit model.yaml a", "idloop fit model.yaml b"],
    )
    text = _start_page.refused(begun)
    assert text.endswith(
        "the commands here fit them apart: idloop fit model.yaml a; idloop fit model.yaml b; or keep all but one unseen"
    )


def test_what_is_no_log_is_one_line(tmp_path):
    (tmp_path / "a.xlsx").write_bytes(b"PK\x03\x04 xl/workbook")
    with pytest.raises(InputError, match="save its sheet as CSV"):
        _start_page.document_of([tmp_path / "a.xlsx"], {})


@pytest.fixture
def served(browser, tmp_path, monkeypatch):
    """The page in a browser, which must not complain, and the address of the page."""
    monkeypatch.chdir(tmp_path)
    ended, ready, address = threading.Event(), threading.Event(), []

    class Ended:
        def __enter__(self):
            return ended

        def __exit__(self, *_):
            return None

    monkeypatch.setattr("idloop.ending_signals.event_on_ending_signal", Ended)

    def tell(place):
        address.append(place)
        ready.set()

    server = threading.Thread(target=_start_page.serve, args=(0, tell))
    server.start()
    page = browser.new_page()
    errors = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    try:
        assert ready.wait(30.0)
        page.goto(address[0])
        yield page, address[0]
        assert errors == []
    finally:
        page.close()
        ended.set()
        server.join(timeout=60.0)


@pytest.mark.slow
def test_a_dropped_log_becomes_the_workbench_of_a_fitted_model(served, log, tmp_path):
    page, address = served
    page.set_input_files("#files", log)
    page.get_by_text("no column is a time").wait_for()
    page.fill("#rate", "100")
    page.select_option("select[aria-label='column of the position']", "angle")
    page.fill("input[aria-label='unit of the position']", "deg")
    page.click("#again")
    page.get_by_role("button", name="Fit and open the workbench").wait_for()
    assert page.locator("#pictures img").is_visible()
    assert "taken as N·m" in page.inner_text("#doubts")
    assert page.inner_text("#folder") == str(tmp_path / "drive_log")
    # A change is shown before it is fitted; a refused one leaves the table to be corrected.
    page.fill("input[aria-label='unit of the position']", "miles")
    assert page.locator("#begin-panel").is_hidden()
    page.click("#again")
    page.get_by_text("unknown unit 'miles'").wait_for()
    page.fill("input[aria-label='unit of the position']", "deg")
    page.click("#again")
    page.get_by_role("button", name="Fit and open the workbench").wait_for()
    page.click("#begin")
    page.wait_for_url(lambda url: url != address, timeout=120_000)
    page.get_by_text("Where the model fails").first.wait_for(timeout=60_000)
    fitted = idloop.load_model(tmp_path / "drive_log" / "fitted.yaml")
    assert fitted.values["axis.inertia"] == pytest.approx(0.01, rel=0.05)


@pytest.mark.slow
def test_on_a_phone_the_table_of_signals_is_read_without_moving_it(served, log):
    """Its last column lay beyond the edge and made each row as high as a letter's width took."""
    page, _ = served
    page.set_viewport_size({"width": 390, "height": 844})
    page.set_input_files("#files", log)
    page.locator("#signals tbody tr").first.wait_for()
    assert page.eval_on_selector(".scroll", "one => one.scrollWidth - one.clientWidth") <= 0
    assert max(one.bounding_box()["height"] for one in page.locator("#signals tbody tr").all()) < 120


@pytest.fixture(scope="module")
def faulty(tmp_path_factory):
    """A log with a velocity that is 1.15 times too large, and one of the same motion under twice the command."""
    signal = idloop.excitation("multilevel", sample_time=0.01, duration=10.0, amplitude=0.5, seed=3)
    record = idloop.simulate(idloop.load_model("axis"), signal, seed=3)
    q, w = record.output.T
    folder = tmp_path_factory.mktemp("faulty")
    for name, gain, scale in (("scaled", 1.0, 1.15), ("plain", 1.0, 1.0), ("twice", 2.0, 1.0)):
        columns = np.column_stack([record.time, gain * record.input, q, scale * w])
        np.savetxt(folder / f"{name}.csv", columns, delimiter=",", header="t,torque,angle,speed", comments="")
    return folder


def _begun(page, *files):
    page.set_input_files("#files", files)
    page.get_by_role("button", name="Fit and open the workbench").wait_for()
    page.click("#begin")


def _items(page):
    page.locator("#inspected li").first.wait_for(timeout=120_000)
    # Numbers and their units are kept together on the page.
    return [" ".join(text.split()) for text in page.locator("#inspected li").all_inner_texts()]


@pytest.mark.slow
def test_the_workbench_says_what_the_inspection_found_and_names_the_file_that_is_there(
    served, faulty, tmp_path, capsys
):
    page, address = served
    _begun(page, faulty / "scaled.csv")
    page.wait_for_url(lambda url: url != address, timeout=120_000)
    items = _items(page)
    shell = list(idloop.start(faulty / "scaled.csv", tmp_path / "shell").said())
    assert items == [" ".join(text.split()) for text in shell]
    assert items[0] == "scaled: usable with care, without axis.velocity"
    page.locator("#commands code").first.wait_for()
    commands = page.locator("#commands code").all_inner_texts()
    model, bag = tmp_path / "scaled" / "fitted.yaml", tmp_path / "scaled" / "bags" / "scaled"
    assert all(f" {model} {bag}" in text for text in commands)
    assert main.run(shlex.split(commands[0])[1:]) == 0
    capsys.readouterr()


def test_each_file_is_shown_with_its_name_and_one_may_be_kept_unseen(faulty, tmp_path):
    files = [faulty / "plain.csv", faulty / "twice.csv"]
    found = _start_page.document_of(files, {"unseen": "twice.csv"})
    shown = [(one["name"], one["choice"], one["unseen"]) for one in found["pictures"]]
    assert shown == [("plain.csv", True, False), ("twice.csv", True, True)]
    assert found["pictures"][0]["picture"] != found["pictures"][1]["picture"]
    with pytest.raises(InputError, match="one at least must be fitted"):
        _start_page.start_of(files, {"unseen": "plain.csv\ntwice.csv"}, lambda name: tmp_path / name)
    begun, unseen = _start_page.start_of(files, {"unseen": "twice.csv"}, lambda name: tmp_path / name)
    # The other record asks for another machine: only what is fitted has to suit the fit.
    assert begun.fit is not None
    assert [bag.name for bag in begun.bags] == ["plain"]
    assert [bag.name for bag in unseen] == ["twice"]
    assert all(bag.exists() for bag in unseen)


@pytest.mark.slow
def test_a_page_that_is_loaded_again_goes_on_from_there(served, faulty):
    page, address = served
    page.set_input_files("#files", [faulty / "plain.csv", faulty / "twice.csv"])
    page.get_by_role("button", name="Fit and open the workbench").wait_for()
    page.get_by_text("Every file is fitted").wait_for()
    page.reload()
    page.get_by_role("button", name="Fit and open the workbench").wait_for()
    assert page.inner_text("#names") == "plain.csv, twice.csv"
    assert page.locator("#pictures figcaption b").all_inner_texts() == ["plain.csv", "twice.csv"]
    page.select_option("select[aria-label='use of twice.csv']", "unseen")
    assert page.inner_text("#unseen-words") == ""
    page.click("#begin")
    page.wait_for_url(lambda url: url != address, timeout=120_000)
    page.locator("#recording option").first.wait_for(state="attached")
    assert page.locator("#recording option").all_inner_texts() == ["twice (unseen)", "plain (fitted)"]


@pytest.mark.slow
def test_what_is_not_fitted_shows_what_the_inspection_found(served, faulty):
    page, _ = served
    _begun(page, faulty / "plain.csv", faulty / "twice.csv")
    assert any("the same command accelerates" in text for text in _items(page))
    page.get_by_text("but not fitted: the records do not belong together").wait_for()


def test_a_refusal_stands_on_the_page_alone(tmp_path, capfd):
    from idloop.reporting.start_page.start_site import KEY_HEADER, StartSite, Steps

    def recognise(files, given):
        raise InputError(f"{files[0]}: no column\n is a time")

    site = StartSite(Steps(recognise, lambda files, given: {}))
    try:
        with contextlib.closing(http.client.HTTPConnection(site.host, timeout=10)) as connection:
            for path, body in (("/file?name=a.csv&first=yes", b"t,u"), ("/recognise", b"{}")):
                connection.request("POST", path, body=body, headers={KEY_HEADER: site.key})
                answer = connection.getresponse()
                text = json.loads(answer.read())
        assert (answer.status, text) == (409, {"error": "a.csv: no column is a time"})
    finally:
        site.close()
    assert capfd.readouterr() == ("", "")


def test_other_sites_and_unkeyed_requests_are_refused(tmp_path):
    from idloop.reporting.start_page.start_site import StartSite, Steps

    def ask(method, path, body=None, **headers):
        with contextlib.closing(http.client.HTTPConnection(site.host, timeout=10)) as connection:
            connection.request(method, path, body=body, headers=headers)
            answer = connection.getresponse()
            answer.read()
            return answer.status

    site = StartSite(Steps(lambda files, given: {}, lambda files, given: {}))
    upload = "/file?name=../../a.csv&first=yes"
    try:
        assert ask("GET", "/") == 200
        assert ask("GET", "/", Host="evil.example") == 403
        assert ask("POST", upload, b"t,u") == 403
        assert ask("POST", upload, b"t,u", **{"X-Idloop-Key": site.key}) == 200
        assert site.files[0].name == "a.csv"
        assert site.folder in site.files[0].parents
    finally:
        site.close()
    assert not site.folder.exists()
