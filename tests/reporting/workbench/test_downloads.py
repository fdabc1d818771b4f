"""What the page offers to take along opens, and the commands that it names repeat what it says."""

from __future__ import annotations

import json
import shlex
import zipfile
from xml.etree import ElementTree as ET

import pytest

pytest.importorskip("bokeh", reason="no Bokeh: launch_scripts/test installs it")

from test_numbers import MACHINES, ask, recorded, settled

from idloop.physics import load_model
from idloop.records import read_record
from idloop.reporting.workbench.offline import OfflineSource
from idloop.reporting.workbench.server import Place, Site
from idloop.reporting.workbench.steps import Study


@pytest.mark.slow
def test_downloads_open_and_the_commands_repeat_the_page(tmp_path, visit, capsys, monkeypatch):
    machine = MACHINES[0]
    (fitted, unseen), effect = recorded(machine, tmp_path), machine.effect
    plain = load_model(machine.model)
    study = Study((read_record(fitted, plain),), (read_record(unseen, plain),), effects=machine.choice, level=0.02)
    source = OfflineSource(plain, study, paths=((fitted,), (unseen,)))
    site = Site(source, Place())
    try:
        page = visit(site.address).page
        for order, done in (
            (("diagnose",), lambda s: s.missing is not None),
            (("add", effect), lambda s: s.effects == (effect,)),
            (("diagnose",), lambda s: s.missing is not None),
        ):
            settled(source, lambda s: s.assessment is not None)
            source.order(*order)
            settled(source, done)
        page.wait_for_selector("#verdict >> text=Nothing significant")
        for name in ("model.yaml", "ladder.json", "report.html", "figures.zip"):
            with page.expect_download() as got:
                page.click(f"[data-file='{name}']")
            got.value.save_as(tmp_path / name)
        with page.expect_download() as got:
            page.click("#save")
        got.value.save_as(tmp_path / "strips.png")
        commands = [shlex.split(text) for text in page.locator("#commands code").all_inner_texts()]
        heads = page.locator("#fits .fit .value").all_inner_texts()
        page.goto("about:blank")  # a page whose server is gone complains
        report = page.context.browser.new_page()
        report.goto((tmp_path / "report.html").as_uri())
        report.wait_for_selector("figure.plot .bk-Figure")
        report.close()
    finally:
        site.close()
        source.close()
    assert [one.name for one in load_model(tmp_path / "model.yaml").effects] == [effect]
    ladder = json.loads((tmp_path / "ladder.json").read_text(encoding="utf-8"))
    assert len(ladder["ladder"]) == 2
    assert (tmp_path / "strips.png").read_bytes().startswith(b"\x89PNG")
    with zipfile.ZipFile(tmp_path / "figures.zip") as archive:
        roots = [ET.fromstring(archive.read(name)).tag for name in archive.namelist()]
    assert len(roots) > 2
    assert set(roots) == {"{http://www.w3.org/2000/svg}svg"}

    monkeypatch.chdir(tmp_path)
    said = {words[1]: ask(capsys, *words[1:], "--json", "--quiet") for words in reversed(commands)}
    fits = said["compare"]["comparisons"][0]["free_run"]["fit"].values()  # of the unseen data, which stand first
    assert [f"{fit:.3g}" for fit in fits] == [text.split()[0] for text in heads[: len(fits)]]
    assert said["diagnose"]["verdict"] == ladder["verdict"]
    assert said["diagnose"]["level"] == pytest.approx(0.02)
    assert load_model(tmp_path / "RUN" / "model.yaml").effects
