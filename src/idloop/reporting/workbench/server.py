"""Serves the page: Bokeh's server in a thread of its own, on this machine only unless another address is given."""

from __future__ import annotations

import contextlib
import functools
import ipaddress
import json
import logging
import re
import secrets
import socket
import uuid
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import parse_qsl, urlsplit

from bokeh.application import Application
from bokeh.application.handlers.function import FunctionHandler
from bokeh.server.server import BaseServer
from bokeh.server.tornado import BokehTornado
from tornado.httpserver import HTTPServer
from tornado.httputil import HTTPHeaders
from tornado.ioloop import IOLoop
from tornado.iostream import StreamBufferFullError
from tornado.netutil import bind_sockets
from tornado.web import HTTPError, StaticFileHandler
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from idloop.errors import InputError
from idloop.reporting.serving import JsonHandler, ServerThread
from idloop.reporting.workbench.admission import Admission
from idloop.reporting.workbench.files import TYPES
from idloop.reporting.workbench.page import make_page
from idloop.reporting.workbench.state import ORDERS, Source
from idloop.reporting.workbench.state_json import answered
from idloop.reporting.workbench.stop_server import StopServer
from idloop.reporting.workbench.strips import Question, answer

ASSETS = Path(__file__).with_name("assets")
KEY_HEADER = "X-Idloop-Key"
LONGEST_QUESTION = 10_000  # bytes of what a browser asks for at once
LONGEST_ORDER = 10_000  # bytes of the body of an order
POSTS = ("order", "stop")
NONSENSE = 1003  # code of a web socket that is closed: it cannot take what was sent
UNUSED_SESSION = 5_000  # milliseconds after which a closed browser's figures are forgotten


@dataclass(frozen=True)
class Place:
    """Where the page is served."""

    address: str = "127.0.0.1"  # to listen on
    port: int = 0  # 0 takes any that is free

    @property
    def local(self) -> bool:
        """Whether only this machine can reach it."""
        with contextlib.suppress(ValueError):
            return ipaddress.ip_address(self.address).is_loopback
        return self.address == "localhost"


class Site:
    """The running page of a source.

    `address` is what to open in a browser; outside this machine it holds a random token, without which nothing is
    served.
    Raises InputError: the address or port cannot be listened on.
    """

    def __init__(self, source: Source, place: Place) -> None:
        self.source = source
        self.place = place
        self.run = uuid.uuid4().hex  # a page of another run loads itself anew
        self.key = secrets.token_urlsafe(24)
        self.prefix = "" if place.local else secrets.token_urlsafe(24)
        self.address = ""
        self.hosts: set[str] = set()
        self._server: BaseServer | None = None
        self._stop: StopServer | None = None
        self._sockets = _bound(place)
        self._thread = ServerThread("workbench page", self._serve, self._end)

    @property
    def sessions(self) -> int:
        """Browsers that look on."""
        server = self._server
        return 0 if server is None else len(server.get_sessions("/"))

    @property
    def stop_port(self) -> int:
        """Port of the stop's own server."""
        return 0 if self._stop is None else self._stop.port

    def close(self) -> None:
        """End the server; browsers say that they lost it."""
        if self._stop is not None:
            self._stop.close()
        self._thread.close()

    async def _end(self) -> None:
        server = self._server
        if server is None:
            return
        if hasattr(server, "stop_async"):  # from Bokeh 3.10 on a stop has something to wait for
            await server.stop_async()
        else:
            server.stop()
        # A connection that is kept open would let the browser wait for an answer that never comes.
        await server._http.close_all_connections()  # noqa: SLF001  (Bokeh has no other way to it)

    def _serve(self) -> None:
        for name in ("bokeh", "tornado.access", "tornado.application"):
            logging.getLogger(name).setLevel(logging.ERROR)
        self._server = self._make(self._sockets[0].getsockname()[1])
        self._server.start()

    def _make(self, port: int) -> BaseServer:
        place = self.place
        name = f"[{place.address}]" if ":" in place.address else place.address
        self.hosts = {f"{name}:{port}"} | ({f"localhost:{port}", f"127.0.0.1:{port}"} if place.local else set())
        anywhere = place.address in ("0.0.0.0", "::")  # noqa: S104  (only with a token in the address)
        if anywhere:
            self.hosts = set()
            name = socket.gethostname()
        prefix = f"/{self.prefix}" if self.prefix else ""
        self.address = f"http://{name}:{port}{prefix}/"
        names = {urlsplit(f"//{host}").hostname or "" for host in self.hosts}
        self._stop = StopServer(self.source.stop, self.key, place.address, names)
        page = functools.partial(make_page, source=self.source, key=self.key, run=self.run, stop_port=self._stop.port)
        own: dict[str, Any] = {"site": self}
        application = BokehTornado(
            {"/": Application(FunctionHandler(page))},
            prefix=self.prefix,
            extra_websocket_origins=["*"] if anywhere else sorted(self.hosts),
            absolute_url=self.address.removesuffix(f"{prefix}/"),
            extra_patterns=[
                (r"/state", StateHandler, own),
                (r"/strips", StripsHandler, own),
                (r"/order", OrderHandler, own),
                (r"/stop", StopHandler, own),
                (r"/files/([\w.]+)", FileHandler, own),
                (r"/assets/(.*)", AssetHandler, {"path": str(ASSETS)}),
            ],
            unused_session_lifetime_milliseconds=UNUSED_SESSION,
            check_unused_sessions_milliseconds=1_000,
            stats_log_frequency_milliseconds=3_600_000,
        )
        admission = Admission(application, self._refusal, self._headers)
        http = HTTPServer(admission, max_body_size=LONGEST_ORDER, max_header_size=65_536, body_timeout=10.0)
        http.add_sockets(self._sockets)
        admission.start()
        return BaseServer(IOLoop.current(), application, http)

    def _refusal(self, method: str, path: str, headers: HTTPHeaders) -> int:
        """Status with which a request is refused, from its head alone; 0 for none."""
        # Another site must not reach the motor through the reader's browser, whatever name it gives this machine.
        if self.hosts and headers.get("Host", "") not in self.hosts:
            return 403
        if method in ("GET", "HEAD"):
            return 400 if "Transfer-Encoding" in headers or headers.get("Content-Length", "0") != "0" else 0
        prefix = f"/{self.prefix}" if self.prefix else ""
        if method != "POST" or path not in [f"{prefix}/{one}" for one in POSTS]:
            return 404 if method == "POST" else 405
        if not secrets.compare_digest(headers.get(KEY_HEADER, "").encode(), self.key.encode()):
            return 403
        length = headers.get("Content-Length", "")
        if not (length.isascii() and length.isdigit()):
            return 411
        return 413 if len(length) > 9 or int(length) > LONGEST_ORDER else 0

    def _headers(self, headers: HTTPHeaders) -> dict[str, str]:
        """Headers that keep other sites from showing the page, and the page from asking others."""
        host = headers.get("Host", "")
        # The host is the browser's word: only what can be one goes back.
        host = host if re.fullmatch(r"[\w.\-:\[\]]+", host) else "invalid"
        name = host.rpartition(":")[0] or host
        policy = {
            "default-src": "'self'",
            "script-src": "'self' 'unsafe-inline' 'unsafe-eval'",  # Bokeh starts itself by a script in the page
            "style-src": "'self' 'unsafe-inline'",
            "img-src": "'self' data: blob:",
            "connect-src": f"'self' ws://{host} http://{name}:{self.stop_port}",
            "object-src": "'none'",
            "base-uri": "'none'",
            "form-action": "'none'",
            "frame-ancestors": "'none'",
        }
        return {
            "Content-Security-Policy": "; ".join(f"{name} {value}" for name, value in policy.items()),
            "Cross-Origin-Resource-Policy": "same-origin",
        }


def _bound(place: Place) -> list[socket.socket]:
    """Sockets that listen at a place, or one line on why nothing can."""
    try:
        family, _, _, _, address = socket.getaddrinfo(place.address, place.port, type=socket.SOCK_STREAM)[0]
        # Tornado leaves the socket of a failed try open.
        with socket.socket(family, socket.SOCK_STREAM) as one:
            one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            one.bind(address)
        return bind_sockets(place.port, place.address)
    except (OSError, OverflowError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(
            f"the page cannot be served at {place.address}, port {place.port}: {reason}; choose another port (0: any)"
        ) from error


class _Handler(JsonHandler[Site]):
    """A request of the page itself."""

    def attempt(self, action: Callable[[], str]) -> None:
        try:
            self.answer({"said": action()})
        except InputError as error:
            self.answer({"refused": " ".join(str(error).split())}, 409)


class StateHandler(_Handler):
    """What the page shows beside the figures."""

    def get(self) -> None:
        """Answer with all of it, or with the version alone where the page has it already."""
        self.answer(answered(self.site.source, self.site.run, self.get_query_argument("have", "")))


class StripsHandler(_Handler, WebSocketHandler):
    """The streams, as far as the browser does not have them.

    A question is answered before the next one is sent, so that nothing queues up for a slow browser. It goes over a web
    socket, for a request of its own costs the browser as much as the drawing.
    """

    @property
    def max_message_size(self) -> int:
        """Of a question [B]."""
        return LONGEST_QUESTION

    async def on_message(self, message: str | bytes) -> None:
        """Answer a `Question`, written as a query, in binary form; the next one is read when that has been sent."""
        try:
            question = Question.read(dict(parse_qsl(message if isinstance(message, str) else "", strict_parsing=True)))
        except (InputError, ValueError):
            self.close(NONSENSE)
            return
        with contextlib.suppress(WebSocketClosedError, StreamBufferFullError):
            await self.write_message(answer(self.site.source.signals, question), binary=True)


class OrderHandler(_Handler):
    """Orders that change something."""

    def post(self) -> None:
        """Give an order to the source."""
        try:
            body = json.loads(self.request.body)
            verb, what = str(body["verb"]), str(body.get("what", ""))
        except (ValueError, KeyError, TypeError, AttributeError):
            raise HTTPError(400) from None
        if verb not in ORDERS:
            raise HTTPError(400)
        self.attempt(lambda: self.site.source.order(verb, what))


class StopHandler(_Handler):
    """The emergency stop: it goes past everything that may be under way."""

    def post(self) -> None:
        """Stop the motor."""
        self.attempt(self.site.source.stop)


class FileHandler(_Handler):
    """What may be taken along."""

    async def get(self, name: str) -> None:
        """Answer with a file; a report takes seconds, in which the page goes on."""
        try:
            content = await IOLoop.current().run_in_executor(None, self.site.source.file, name)
        except InputError:
            raise HTTPError(404) from None
        self.set_header("Content-Type", TYPES[name])
        self.set_header("Content-Disposition", f'attachment; filename="{name}"')
        self.finish(content)


class AssetHandler(StaticFileHandler):
    """Style and script of the page."""

    def set_extra_headers(self, path: str) -> None:
        """Never an old script with a new server."""
        self.set_header("Cache-Control", "no-cache")
