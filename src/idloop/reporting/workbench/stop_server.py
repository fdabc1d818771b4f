"""The stop has a port and a thread of its own: nothing that the page is busy with delays it."""

from __future__ import annotations

import secrets
from collections.abc import Callable, Mapping
from urllib.parse import urlsplit

from tornado.httpserver import HTTPServer
from tornado.httputil import HTTPHeaders
from tornado.netutil import bind_sockets
from tornado.web import Application, RequestHandler

from idloop.reporting.serving import ServerThread
from idloop.reporting.workbench.admission import Admission


class StopServer:
    """Takes ``POST /stop/<key>``; what a body says changes nothing.

    `stop`: stops the motor; any thread may call it.
    `key`: what the page holds.
    `address`: to listen on; the port is one that is free.
    `hosts`: hosts of the page, without ports; none lets any in.
    """

    def __init__(self, stop: Callable[[], str], key: str, address: str, hosts: set[str]) -> None:
        self._path = f"/stop/{key}"
        self._hosts = hosts
        sockets = bind_sockets(0, address)
        self.port = int(sockets[0].getsockname()[1])
        admission = Admission(Application([(r"/stop/.*", _StopHandler, {"stop": stop})]), self._refusal, self._headers)

        def serve() -> None:
            self._server = HTTPServer(
                admission, max_body_size=16_384, max_header_size=16_384, body_timeout=10.0, idle_connection_timeout=60.0
            )
            self._server.add_sockets(sockets)

        self._thread = ServerThread("stop", serve, self._end)

    def close(self) -> None:
        """End the server."""
        self._thread.close()

    async def _end(self) -> None:
        self._server.stop()

    def _refusal(self, method: str, path: str, headers: HTTPHeaders) -> int:
        host = urlsplit(f"//{headers.get('Host', '')}").hostname or ""
        known = not self._hosts or host in self._hosts
        return 0 if known and method == "POST" and secrets.compare_digest(path.encode(), self._path.encode()) else 403

    def _headers(self, headers: HTTPHeaders) -> Mapping[str, str]:
        """Let the page, which is served at another port of this host, read the answer."""
        origin = headers.get("Origin", "")
        known = bool(origin) and (not self._hosts or urlsplit(origin).hostname in self._hosts)
        return {"Access-Control-Allow-Origin": origin, "Vary": "Origin"} if known else {}


class _StopHandler(RequestHandler):
    def initialize(self, stop: Callable[[], str]) -> None:
        self._stop = stop

    def post(self) -> None:
        """Stop the motor."""
        self.set_header("Cache-Control", "no-store")
        self.finish({"said": self._stop()})
