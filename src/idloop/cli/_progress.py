"""How far the work is: a bar on a terminal, a plain line every few seconds elsewhere, nothing with `--quiet`."""

from __future__ import annotations

import contextlib
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from datetime import timedelta
from typing import TYPE_CHECKING

import click

from idloop.cli._command_line import kept

if TYPE_CHECKING:
    from rich.progress import Task
    from rich.text import Text

_FALL = 0.005  # by which a share is smaller than before, and not by rounding
PERIOD = 5.0  # seconds from one plain line to the next; what ends sooner is silent


@dataclass
class Work:
    """What is being done, since when, and how far it is."""

    text: str  # what it is, as a whole
    clock: Callable[[], float] = time.monotonic  # seconds since any instant
    share: float = 0.0  # part done, from 0 to 1
    note: str = ""  # what is being done now
    started: float = field(init=False)
    updated: float = field(init=False)  # when the share was told
    grown: bool = field(default=False, init=False)  # whether more is to do than was known at the start

    def __post_init__(self) -> None:
        self.started = self.updated = self.clock()

    def update(self, fraction: float, note: str = "") -> None:
        """Keep how far it is; a share that falls says that the work has grown, and is not shown."""
        share = min(max(float(fraction), 0.0), 1.0)
        self.grown = self.grown or share < self.share - _FALL
        self.share, self.note, self.updated = max(share, self.share), note, self.clock()

    @property
    def used(self) -> timedelta:
        """Time since its start, in whole seconds."""
        return timedelta(seconds=int(self.clock() - self.started))

    @property
    def left(self) -> timedelta | None:
        """Time to its end if it goes on as it had gone at the last update; None where that is not known, or over."""
        if self.grown or not 1e-3 < self.share < 1.0:
            return None
        end = self.started + (self.updated - self.started) / self.share
        left = end - self.clock()
        return timedelta(seconds=round(left)) if left >= 0.0 else None

    @property
    def line(self) -> str:
        """All of it in one line."""
        said = [f"{self.text}: {100.0 * self.share:.0f} %", self.note, f"{self.used} used"]
        if self.left is not None:
            said.append(f"about {self.left} left")
        return ", ".join(filter(None, said))


@contextlib.contextmanager
def progress(text: str, *, writes: bool = False) -> Iterator[Callable[..., None]]:
    """Say on stderr how far the block is while it runs.

    `text`: what it does. `writes`: it leaves files behind as it goes; else Ctrl-C says that nothing is kept. Yields:
    `update(fraction, note="")` with the part done, from 0 to 1.
    """
    work = Work(text)
    loud = _bar if sys.stderr.isatty() else _lines
    shown = contextlib.nullcontext(work.update) if kept("quiet") else loud(work)
    try:
        with shown as update:
            yield update
    except KeyboardInterrupt as end:
        if writes or end.args:
            raise
        raise KeyboardInterrupt("interrupted: nothing is kept") from None


@contextlib.contextmanager
def _lines(work: Work) -> Iterator[Callable[..., None]]:
    """Plain lines, in a thread of their own: the work may be busy for long between two updates."""
    ended = threading.Event()

    def tell() -> None:
        while not ended.wait(PERIOD):
            with contextlib.suppress(OSError):  # the reader may be gone
                click.echo(work.line, err=True)

    teller = threading.Thread(target=tell, name="progress", daemon=True)
    teller.start()
    try:
        yield work.update
    finally:
        ended.set()
        teller.join()


@contextlib.contextmanager
def _bar(work: Work) -> Iterator[Callable[..., None]]:
    """A bar with the time used and left, gone in the end."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, ProgressColumn, SpinnerColumn, TextColumn, TimeElapsedColumn
    from rich.text import Text

    class TimeLeftColumn(ProgressColumn):
        # Not rich's own, which forgets its speed where updates are rare.
        def render(self, task: Task) -> Text:
            return Text("-:--:--" if work.left is None else f"{work.left} left", style="progress.remaining")

    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}"),
        BarColumn(),
        TimeElapsedColumn(),
        TimeLeftColumn(),
        TextColumn("{task.fields[note]}"),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bars:
        task = bars.add_task(work.text, total=1.0, note="")

        def update(fraction: float, note: str = "") -> None:
            work.update(fraction, note)
            bars.update(task, completed=work.share, note=note)

        yield update
