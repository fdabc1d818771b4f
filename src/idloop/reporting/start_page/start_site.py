"""Serves the page on this machine: takes files, shows what was recognised, and hands over to the workbench."""

from __future__ import annotations

import functools
import json
import os
import secrets
import shutil
import tempfile
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tornado.httpserver import HTTPServer
from tornado.ioloop import IOLoop
from tornado.netutil import bind_sockets
from tornado.web import Application, HTTPError, StaticFileHandler

from idloop.errors import IdloopError, InputError
from idloop.reporting.serving import JsonHandler, ServerThread

HERE = Path(__file__).parent
SHARED = HERE.parent / "workbench" / "assets"
KEY_HEADER = "X-Idloop-Key"
MOST_BYTES = 1 << 30  # of a file


@dataclass(frozen=True)
class Steps:
    """What the page asks for."""

    # Given the files and what the user says of each signal, returns the document of the page
    recognise: Callable[[list[Path], Mapping[str, str]], dict[str, Any]]
    # Given the same, writes and fits. Returns the address of the workbench, what the inspection found (sentences), and
    # why there is no fit.
    begin: Callable[[list[Path], Mapping[str, str]], dict[str, Any]]


def plain_names(text: str, files: list[Path]) -> str:
    """Return a message in one line, with the names of the files and without the folder of their copies."""
    for path in files:
        text = text.replace(f"{path.parent}{os.sep}", "").replace(str(path.parent), "the files")
    return " ".join(text.split())


class StartSite:
    """The running page; `address` is what to open in a browser on this machine.

    `port`: 0 takes any that is free. Raises InputError: the port cannot be listened on.
    """

    def __init__(self, steps: Steps, port: int = 0) -> None:
        self.steps = steps
        self.key = secrets.token_urlsafe(24)
        self.folder = Path(tempfile.mkdtemp(prefix="idloop_start_"))
        self.files: list[Path] = []
        # What was last asked and answered: a page that is loaded again goes on from there.
        self.kept: dict[str, Any] = {}
        self.busy = threading.Lock()
        try:
            self._sockets = bind_sockets(port, "127.0.0.1")
        except OSError as error:
            raise InputError(
                f"the page cannot be served at port {port}: {error.strerror}; choose another (0: any)"
            ) from None
        self.host = f"127.0.0.1:{self._sockets[0].getsockname()[1]}"
        self.address = f"http://{self.host}/"
        self._thread = ServerThread("start page", self._serve, self._end)

    def close(self) -> None:
        """End the server, and remove the copies of the files."""
        self._thread.close()
        shutil.rmtree(self.folder, ignore_errors=True)

    def _serve(self) -> None:
        own = {"site": self}
        application = Application(
            [
                (r"/", PageHandler, own),
                (r"/file", FileHandler, own),
                (r"/state", StateHandler, own),
                (r"/(recognise|begin)", StepHandler, own),
                (r"/assets/(start\.(?:js|css))", StaticFileHandler, {"path": str(HERE)}),
                (r"/assets/(.*)", StaticFileHandler, {"path": str(SHARED)}),
            ],
            # What is refused is said on the page; a fault is logged by tornado all the same.
            log_function=lambda _: None,
        )
        self._server = HTTPServer(application, max_body_size=MOST_BYTES, max_buffer_size=MOST_BYTES)
        self._server.add_sockets(self._sockets)

    async def _end(self) -> None:
        self._server.stop()


class _Handler(JsonHandler[StartSite]):
    """A request of the page: of this machine alone, whatever name another site gives it."""

    def prepare(self) -> None:
        super().prepare()
        own = {self.site.host, self.site.host.replace("127.0.0.1", "localhost")}
        key = self.request.headers.get(KEY_HEADER, "")
        ordered = self.request.method != "POST" or secrets.compare_digest(key.encode(), self.site.key.encode())
        if self.request.host not in own or not ordered:
            raise HTTPError(403)
        self.set_header("X-Frame-Options", "DENY")
        self.set_header(
            "Content-Security-Policy",
            "default-src 'self'; img-src 'self' data:; object-src 'none'; base-uri 'none'; form-action 'none'",
        )


class PageHandler(_Handler):
    """The page itself."""

    def get(self) -> None:
        """Answer with it."""
        self.render(str(HERE / "start.html"), key=self.site.key)


class StateHandler(_Handler):
    """What was done with the page so far."""

    def get(self) -> None:
        """Answer with the files, what was said of them, and what came of it."""
        self.answer({"files": [one.name for one in self.site.files], **self.site.kept})


class FileHandler(_Handler):
    """A dropped file; the first of several forgets those before."""

    def post(self) -> None:
        """Keep a copy under its own name."""
        name = Path(self.get_query_argument("name")).name
        if not name or name in (".", ".."):
            raise HTTPError(400)
        if self.get_query_argument("first", "") == "yes":
            self.site.files.clear()
            self.site.kept = {}
        path = Path(tempfile.mkdtemp(dir=self.site.folder)) / name
        if self.site.files:
            # Files that belong together lie in one folder.
            path = self.site.files[0].parent / name
        path.write_bytes(self.request.body)
        self.site.files.append(path)
        self.answer({"files": [one.name for one in self.site.files]})


class StepHandler(_Handler):
    """What is done with the files."""

    async def post(self, step: str) -> None:
        """Recognise or begin, in another thread; what cannot be done is said in one line."""
        try:
            given = {str(role): str(text) for role, text in json.loads(self.request.body).items()}
        except (ValueError, AttributeError):
            raise HTTPError(400) from None
        work = functools.partial(self._work, step, given)
        try:
            self.answer(await IOLoop.current().run_in_executor(None, work))
        except IdloopError as error:
            self.answer({"error": plain_names(str(error), self.site.files)}, 409)

    def _work(self, step: str, given: dict[str, str]) -> dict[str, Any]:
        if not self.site.busy.acquire(blocking=False):
            raise InputError("the page is still at work on what was asked before")
        try:
            files = list(self.site.files)
            if step == "recognise":
                found = self.site.steps.recognise(files, given)
                if not found.get("missing"):
                    self.site.kept = {"given": given, "found": found}
                return found
            begun = self.site.steps.begin(files, given)
            self.site.kept |= {"begun": begun}
            return begun
        finally:
            self.site.busy.release()
