"""Who may see the page and who may give orders."""

from __future__ import annotations

import asyncio
import json
import socket
import urllib.error
import urllib.request
from concurrent.futures import ThreadPoolExecutor

import pytest

pytest.importorskip("bokeh", reason="no Bokeh: launch_scripts/test installs it")

from fake import MISSING, FakeSource
from tornado.httpclient import HTTPClientError, HTTPRequest
from tornado.websocket import websocket_connect

from idloop.errors import InputError
from idloop.report.effect_names import words
from idloop.workbench import server
from idloop.workbench.server import KEY_HEADER, LONGEST_QUESTION, NONSENSE, Place, Site

TOO_LONG = 1009  # code of a web socket that is closed


@pytest.fixture
def source():
    one = FakeSource()
    one.feed(100)
    return one


@pytest.fixture
def site(source):
    one = Site(source, Place())
    yield one
    one.close()


def ask(address, body=None, **headers):
    """Return status and answer."""
    data = None if body is None else json.dumps(body).encode()
    request = urllib.request.Request(address, data, headers)
    try:
        with urllib.request.urlopen(request, timeout=200) as response:
            return response.status, response.read().decode()
    except urllib.error.HTTPError as error:
        with error:
            return error.code, error.read().decode()


# Tornado leaves the socket of the failed try to the garbage collector.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_free_port_that_somebody_else_was_quicker_to_take_is_not_the_end(source, monkeypatch):
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        taken, free = other.getsockname()[1], server._free_port("127.0.0.1")
        ports = iter([taken, free])
        monkeypatch.setattr(server, "_free_port", lambda address: next(ports))
        one = Site(source, Place())
        try:
            assert f":{free}/" in one.address
            assert ask(f"{one.address}state")[0] == 200
        finally:
            one.close()


def test_the_state_is_told_once_for_each_version(site):
    status, text = ask(f"{site.address}state")
    state = json.loads(text)
    assert status == 200
    assert state["missing"]["tied"] == [words(name) for name in MISSING.set]
    assert state["ladder"]["steps"][0]["fit"] == pytest.approx({"motor.position": 79.0, "motor.velocity": 58.0})
    _, again = ask(f"{site.address}state?have={state['run']}:{state['version']}")
    assert json.loads(again) == {"run": state["run"], "version": state["version"]}


def over_the_socket(address, *questions, **headers):
    """Return the answer to each question, the code with which the socket was closed, and the status of its request."""

    async def talk():
        request = HTTPRequest(f"{address.replace('http', 'ws')}strips", headers=headers)
        try:
            socket = await websocket_connect(request)
        except HTTPClientError as error:
            return [], None, error.code
        answers = []
        for question in questions:
            await socket.write_message(question)
            answers.append(await socket.read_message())
        code = socket.close_code
        socket.close()
        if code is None:
            assert await socket.read_message() is None
        return answers, code, 101

    # In a thread of its own: that of the tests may have a loop already, a browser's.
    with ThreadPoolExecutor(1) as thread:
        return thread.submit(asyncio.run, asyncio.wait_for(talk(), 200)).result()


def test_strips_are_sent_question_by_question(site):
    (first, second), code, _ = over_the_socket(site.address, "follow=5&have=", "start=0&stop=0.05&buckets=50")
    assert code is None
    for data, start in ((first, 0.099 - 5.0), (second, 0.0)):
        head = json.loads(data[4 : 4 + int.from_bytes(data[:4], "little")])
        assert head["start"] == pytest.approx(start)
        assert head["streams"][0]["count"] > 0


@pytest.mark.parametrize("question", ["follow=-1", "follow", "shown=all", b"\0", "buckets=" + "1" * LONGEST_QUESTION])
def test_strips_that_make_no_sense_are_refused(site, question):
    answers, code, _ = over_the_socket(site.address, question)
    assert answers == [None]
    assert code in (NONSENSE, TOO_LONG)


def test_another_site_cannot_look_on_through_the_readers_browser(site):
    assert over_the_socket(site.address, Host="elsewhere.example")[2] == 403
    assert over_the_socket(site.address, Origin="http://elsewhere.example")[2] == 403
    assert over_the_socket(site.address, Origin=site.address.rstrip("/"))[2] == 101


def test_an_order_needs_the_key_that_the_page_holds(site, source):
    order = {"verb": "add", "what": "dead_zone@input"}
    assert ask(f"{site.address}order", order)[0] == 403
    assert ask(f"{site.address}stop", {}, **{KEY_HEADER: "guess"})[0] == 403
    assert source.orders == []
    assert source.stops == 0
    assert ask(f"{site.address}order", order, **{KEY_HEADER: site.key})[0] == 200
    assert source.orders == [("add", "dead_zone@input")]


def test_a_foreign_name_for_this_machine_is_refused(site):
    assert ask(f"{site.address}state", Host="elsewhere.example")[0] == 403


@pytest.mark.parametrize("body", [{}, {"verb": "shutdown"}, [], "x", {"verb": None}])
def test_an_order_that_is_none_is_refused(site, source, body):
    assert ask(f"{site.address}order", body, **{KEY_HEADER: site.key})[0] == 400
    assert source.orders == []


def test_what_the_source_refuses_is_said_in_one_line(site):
    status, text = ask(f"{site.address}order", {"verb": "undo"}, **{KEY_HEADER: site.key})
    assert (status, json.loads(text)) == (409, {"refused": "there is no step to take back"})


def test_outside_this_machine_the_address_holds_a_token_and_nothing_is_served_without_it(source):
    site = Site(source, Place("0.0.0.0"))
    try:
        port, token = site.address.split(":")[2].strip("/").split("/")
        assert len(token) >= 32
        assert ask(f"http://127.0.0.1:{port}/{token}/state")[0] == 200
        for path in ("", "state", "assets/page.js", "static/js/bokeh.min.js", "guess/state"):
            assert ask(f"http://127.0.0.1:{port}/{path}")[0] == 404, path
    finally:
        site.close()


def test_a_port_in_use_is_one_line(source):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        with pytest.raises(InputError, match="in use; choose another port"):
            Site(source, Place(port=taken.getsockname()[1]))


def test_an_address_of_another_machine_is_one_line(source):
    with pytest.raises(InputError, match=r"203\.0\.113\.7"):
        Site(source, Place("203.0.113.7"))


@pytest.mark.parametrize(
    ("address", "local"), [("127.0.0.1", True), ("localhost", True), ("::1", True), ("0.0.0.0", False), ("x", False)]
)  # fmt: skip
def test_which_addresses_only_this_machine_reaches(address, local):
    assert Place(address).local is local
