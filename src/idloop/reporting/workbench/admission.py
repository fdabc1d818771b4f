"""Who is let in: decided by the head of a request, before its body is kept; and who is put out for being slow."""

from __future__ import annotations

import functools
import socket
import struct
from collections.abc import Awaitable, Callable, Mapping
from http import HTTPStatus
from typing import Any
from weakref import WeakKeyDictionary

from tornado.httputil import (
    HTTPConnection,
    HTTPHeaders,
    HTTPMessageDelegate,
    HTTPServerConnectionDelegate,
    RequestStartLine,
    ResponseStartLine,
)
from tornado.ioloop import PeriodicCallback

BACKLOG = 16 << 20  # bytes that may wait for one browser
LOOKS = 30  # seconds in a row for which a browser may have something to fetch
HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",  # an address outside this machine holds a token
    "Cross-Origin-Opener-Policy": "same-origin",
}

Rule = Callable[[str, str, HTTPHeaders], int]


class Admission(HTTPServerConnectionDelegate):
    """Stands before an application of Tornado's, whoever wrote its handlers.

    `rule`: given method, path and headers of a request, returns the status with which it is refused; 0 lets it in.
    `headers`: given the headers of a request, returns those that every answer gets beside `HEADERS`.
    """

    def __init__(
        self, application: HTTPServerConnectionDelegate, rule: Rule, headers: Callable[[HTTPHeaders], Mapping[str, str]]
    ) -> None:
        self._application = application
        self.rule = rule
        self.headers = headers
        self._streams: WeakKeyDictionary[Any, int] = WeakKeyDictionary()
        self._looks = PeriodicCallback(self.put_out_the_slow, 1_000)

    def start(self) -> None:
        """Begin to look for slow browsers; in the thread that serves."""
        self._looks.start()

    def start_request(self, server_conn: object, request_conn: HTTPConnection) -> HTTPMessageDelegate:
        """Receive a request, see Tornado."""
        stream = getattr(request_conn, "stream")  # noqa: B009  (every connection that a server makes has one)
        stream.max_write_buffer_size = BACKLOG
        self._streams.setdefault(stream, 0)
        return _Visitor(self, functools.partial(self._application.start_request, server_conn), request_conn)

    def put_out_the_slow(self) -> None:
        """Close the connections to which something has been waiting to be sent at so many looks in a row."""
        for stream, looks in list(self._streams.items()):
            waiting = looks + 1 if stream.writing() else 0
            self._streams[stream] = waiting
            if waiting > LOOKS:
                # At once: the system would go on to offer what has been sent, and keep it.
                stream.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
                stream.close()


class _Visitor(HTTPMessageDelegate):
    """One request: handed on to the application, or answered here and its body thrown away."""

    def __init__(
        self, admission: Admission, enter: Callable[[HTTPConnection], HTTPMessageDelegate], request_conn: HTTPConnection
    ) -> None:
        self._admission = admission
        self._enter = enter
        self._request_conn = request_conn
        self._inside: HTTPMessageDelegate | None = None

    def headers_received(
        self, start_line: RequestStartLine | ResponseStartLine, headers: HTTPHeaders
    ) -> Awaitable[None] | None:
        """Let the request in, or refuse it at once."""
        assert isinstance(start_line, RequestStartLine)  # noqa: S101  (a server gets no responses)
        path = start_line.path.partition("?")[0]
        status = self._admission.rule(start_line.method, path, headers)
        more = {**HEADERS, **self._admission.headers(headers)}
        if status:
            self._refuse(status, more)
            return None
        self._inside = self._enter(_WithHeaders(self._request_conn, more))
        return self._inside.headers_received(start_line, headers)

    def _refuse(self, status: int, more: Mapping[str, str]) -> None:
        text = f"{status} {HTTPStatus(status).phrase}\n".encode()
        answer = {**more, "Content-Type": "text/plain", "Content-Length": str(len(text))}
        self._request_conn.write_headers(
            ResponseStartLine("HTTP/1.1", status, HTTPStatus(status).phrase), HTTPHeaders(answer), text
        )
        self._request_conn.finish()

    def data_received(self, chunk: bytes) -> Awaitable[None] | None:
        """Hand a part of the body on; of one that was refused it is thrown away."""
        return None if self._inside is None else self._inside.data_received(chunk)

    def finish(self) -> None:
        """Take in that the request is complete."""
        if self._inside is not None:
            self._inside.finish()

    def on_connection_close(self) -> None:
        """Take in that the browser has gone."""
        if self._inside is not None:
            self._inside.on_connection_close()


class _WithHeaders(HTTPConnection):
    """A connection that adds headers to every answer."""

    def __init__(self, connection: HTTPConnection, headers: Mapping[str, str]) -> None:
        self._connection = connection
        self._headers = headers

    def write_headers(self, start_line: Any, headers: HTTPHeaders, chunk: bytes | None = None) -> Any:
        for name, value in self._headers.items():
            headers[name] = value
        return self._connection.write_headers(start_line, headers, chunk)

    def write(self, chunk: bytes) -> Any:
        return self._connection.write(chunk)

    def finish(self) -> None:
        self._connection.finish()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._connection, name)
