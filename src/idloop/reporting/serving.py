"""Servers in threads of their own, and handlers that answer in JSON."""

from __future__ import annotations

import asyncio
import json
import threading
from collections.abc import Awaitable, Callable
from typing import Any, Generic, TypeVar

from tornado.ioloop import IOLoop
from tornado.web import RequestHandler

from idloop.errors import IdloopError

_ENDING = 5.0  # seconds that a thread may take to end
Owner = TypeVar("Owner")


class ServerThread:
    """A thread with a loop of Tornado's, in which `begin` sets a server up.

    `end`: called in the loop before it stops.
    Raises IdloopError: `begin` has failed, or takes longer than `patience` [s].
    """

    def __init__(
        self, name: str, begin: Callable[[], Any], end: Callable[[], Awaitable[None]], patience: float = 120.0
    ) -> None:
        self._begin, self._end = begin, end
        self._loop: IOLoop | None = None
        self._failure: Exception | None = None
        self._ready = threading.Event()
        self._thread = threading.Thread(target=self._serve, name=name, daemon=True)
        self._thread.start()
        if not self._ready.wait(patience):
            raise IdloopError(f"the page was not served within {patience:g} s")
        if self._failure is not None:
            raise IdloopError(f"the page cannot be served: {self._failure}") from self._failure

    def close(self) -> None:
        """End the server."""
        loop = self._loop
        if loop is None or not self._thread.is_alive():
            return

        async def end() -> None:
            await self._end()
            loop.stop()

        loop.add_callback(end)
        self._thread.join(timeout=_ENDING)

    def _serve(self) -> None:
        asyncio.set_event_loop(asyncio.new_event_loop())
        self._loop = loop = IOLoop.current()
        try:
            self._begin()
        except Exception as error:  # noqa: BLE001  (raised by the one who waits for this thread)
            self._failure = error
        self._ready.set()
        if self._failure is None:
            loop.start()
        loop.close()


class JsonHandler(RequestHandler, Generic[Owner]):
    """A request of a page, which is never kept by the browser."""

    site: Owner

    def initialize(self, site: Owner) -> None:
        """Take the page to which it belongs."""
        self.site = site

    def prepare(self) -> None:
        """Forbid the browser to keep the answer."""
        self.set_header("Cache-Control", "no-store")

    def answer(self, document: dict[str, Any], status: int = 200) -> None:
        """Answer with a document, which holds no NaN."""
        self.set_status(status)
        self.set_header("Content-Type", "application/json")
        self.finish(json.dumps(document, allow_nan=False))
