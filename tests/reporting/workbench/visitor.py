"""A reader with a browser of his own."""

from __future__ import annotations

from urllib.parse import urlsplit

WAIT = 200_000  # milliseconds


class Visitor:
    """A reader with a browser of his own."""

    def __init__(self, browser, address, wait=WAIT):
        self.address = address
        self.context = browser.new_context(viewport={"width": 1500, "height": 1000})
        self.page = self.context.new_page()
        self.page.set_default_timeout(wait)
        self.complaints: list[str] = []
        self.foreign: list[str] = []
        self.page.on("console", lambda m: self.complaints.append(m.text) if m.type == "error" else None)
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("request", self._watch)
        self.open()

    def _watch(self, request):
        # The stop has a port of its own.
        here = urlsplit(request.url).hostname == urlsplit(self.address).hostname
        if not (here or request.url.startswith(("data:", "blob:"))):
            self.foreign.append(request.url)

    def open(self):
        self.page.goto(self.address)
        self.ready()

    def ready(self):
        self.page.wait_for_selector("body[data-ready]")
        self.page.wait_for_selector("body[data-version]")

    def until(self, expression, argument=None):
        self.page.wait_for_function(expression, arg=argument)

    def close(self):
        self.context.close()
