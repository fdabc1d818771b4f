"""Who may see the page and who may give orders."""

from __future__ import annotations

import asyncio
import contextlib
import json
import socket
import threading
import time
import urllib.error
import urllib.parse
import urllib.request
from concurrent.futures import ThreadPoolExecutor

import pytest

pytest.importorskip("bokeh", reason="no Bokeh: launch_scripts/test installs it")

from fake import MISSING, FakeSource
from tornado.httpclient import HTTPClientError, HTTPRequest
from tornado.websocket import websocket_connect

from idloop.errors import InputError
from idloop.reporting.terms import effect_words
from idloop.reporting.workbench.server import KEY_HEADER, LONGEST_QUESTION, NONSENSE, Place, Site
from idloop.reporting.workbench.strips import answer

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


def netloc(site):
    """Return host and port of the page."""
    return urllib.parse.urlsplit(site.address).netloc


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


def test_the_state_is_told_once_for_each_version(site):
    status, text = ask(f"{site.address}state")
    state = json.loads(text)
    assert status == 200
    assert state["missing"]["tied"] == [effect_words(name) for name in MISSING.set]
    scores = {one["quantity"]: one["value"] for one in state["ladder"]["steps"][0]["scores"]}
    assert scores == pytest.approx({"motor.position": 79.0, "motor.velocity": 58.0})
    _, again = ask(f"{site.address}state?have={state['run']}:{state['change']}")
    assert json.loads(again) == {"run": state["run"], "change": state["change"]}


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


@pytest.mark.parametrize("path", ["", "state", "strips", "assets/page.js", "static/js/bokeh.min.js", "ws", "nowhere"])
def test_a_foreign_name_for_this_machine_is_refused_on_every_path(site, path):
    assert ask(f"{site.address}{path}", Host="elsewhere.example")[0] == 403


@pytest.mark.parametrize("path", ["", "state", "assets/page.js", "static/js/bokeh.min.js", "nowhere"])
@pytest.mark.parametrize("host", [None, "elsewhere.example"])
def test_no_other_site_can_show_the_page_and_every_answer_says_so(site, path, host):
    head = raw(
        site,
        f"GET /{path} HTTP/1.1\r\nHost: {host or netloc(site)}\r\nConnection: close\r\n\r\n",
    ).lower()
    assert b"frame-ancestors 'none'" in head
    for line in (b"x-content-type-options: nosniff", b"x-frame-options: deny", b"referrer-policy: no-referrer"):
        assert line in head


def raw(site, text, until=b"\r\n\r\n"):
    """What the server answers to bytes, up to the end of its head."""
    address = urllib.parse.urlsplit(site.address)
    with socket.create_connection((address.hostname, address.port), timeout=200) as one:
        one.sendall(text.encode())
        answer = b""
        while until not in answer and (more := one.recv(65_536)):
            answer += more
        return answer


@pytest.mark.parametrize(
    ("head", "status"),
    [
        ("POST /order HTTP/1.1\r\nHost: {host}\r\nContent-Length: 5000\r\n\r\n", 403),
        ("POST /order HTTP/1.1\r\nHost: {host}\r\n{key}Content-Length: 1000000000\r\n\r\n", 413),
        ("POST /order HTTP/1.1\r\nHost: {host}\r\n{key}Transfer-Encoding: chunked\r\n\r\n", 411),
        ("POST / HTTP/1.1\r\nHost: {host}\r\n{key}Content-Length: 5000\r\n\r\n", 404),
        ("PUT /order HTTP/1.1\r\nHost: {host}\r\n{key}Content-Length: 5000\r\n\r\n", 405),
        ("GET /state HTTP/1.1\r\nHost: {host}\r\nContent-Length: 5000\r\n\r\n", 400),
    ],
)
def test_a_body_that_nobody_wants_is_refused_before_it_is_sent(site, source, head, status):
    text = head.format(host=netloc(site), key=f"{KEY_HEADER}: {site.key}\r\n")
    assert raw(site, text).startswith(f"HTTP/1.1 {status} ".encode())
    assert source.orders == []


def test_a_browser_that_asks_and_does_not_read_costs_no_memory(site, source, monkeypatch):
    """Every question is answered, and the answer sent, before the next one is read."""
    asked = []
    monkeypatch.setattr("idloop.reporting.workbench.server.answer", lambda *words: asked.append(1) or answer(*words))
    source.feed(20_000)
    question = b"start=0&stop=20&buckets=5000"
    address = urllib.parse.urlsplit(site.address)
    with socket.create_connection((address.hostname, address.port), timeout=200) as one:
        one.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        one.sendall(
            f"GET /strips HTTP/1.1\r\nHost: {netloc(site)}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n\r\n".encode()
        )
        frame = bytes([0x81, 0x80 | len(question), 0, 0, 0, 0]) + question  # text, masked with zeros
        one.setblocking(False)
        with contextlib.suppress(BlockingIOError):
            for _ in range(5_000):
                one.send(frame)
        held(lambda: asked)
        for _ in range(20):
            assert ask(f"{site.address}state")[0] == 200, "the others are served"
        assert len(asked) < 200


@pytest.mark.slow
def test_a_connection_that_takes_nothing_is_put_out(site, source, monkeypatch):
    monkeypatch.setattr("idloop.reporting.workbench.admission.LOOKS", 1)
    source.feed(20_000)
    address = urllib.parse.urlsplit(site.address)
    with socket.create_connection((address.hostname, address.port), timeout=200) as one:
        one.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        for _ in range(50):
            one.sendall(f"GET /static/js/bokeh.min.js HTTP/1.1\r\nHost: {netloc(site)}\r\n\r\n".encode())
        held(lambda: closed(one))


def closed(one):
    """Whether the other side has closed the connection, without reading what it has sent."""
    state = one.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, 1)[0]
    return state != 1  # ESTABLISHED


def held(condition):
    deadline = time.monotonic() + 200.0
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def test_the_stop_does_not_wait_for_the_page(site, source):
    """The page's own thread is held up for good; the stop has another."""
    held_up = threading.Event()
    site._thread._loop.add_callback(held_up.wait, 200.0)
    try:
        request = urllib.request.Request(f"http://127.0.0.1:{site.stop_port}/stop/{site.key}", method="POST")
        with urllib.request.urlopen(request, timeout=200) as response:
            assert json.load(response) == {"said": "stopped"}
        assert source.stops == 1
        for body in ({}, {"verb": "release"}):
            assert ask(f"http://127.0.0.1:{site.stop_port}/stop/{site.key}", body) == (200, '{"said": "stopped"}')
        assert source.stops == 3, "a body is no reason not to stop"
    finally:
        held_up.set()


@pytest.mark.parametrize("key", ["", "guess"])
@pytest.mark.parametrize("host", [{}, {"Host": "elsewhere.example"}])
def test_the_stops_own_server_asks_for_the_key_and_the_host(site, source, key, host):
    path = key or (site.key if host else "")
    request = urllib.request.Request(f"http://127.0.0.1:{site.stop_port}/stop/{path}", headers=host, method="POST")
    with pytest.raises(urllib.error.HTTPError) as refused:
        urllib.request.urlopen(request, timeout=200)
    refused.value.close()
    assert refused.value.code == 403
    assert source.stops == 0


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
