"""Progress: a bar with the time left on a terminal, plain lines elsewhere, nothing with `--quiet`."""

from __future__ import annotations

import importlib
import inspect
import io
import sys
import threading

import click
import pytest

from idloop.cli import _progress, main
from idloop.cli._outputs import work_options
from idloop.cli._progress import Work, progress

DEADLINE = 60.0


class Stream(io.StringIO):
    """A stream that says when a line has come."""

    def __init__(self, *, terminal: bool = False) -> None:
        super().__init__()
        self.terminal, self.came = terminal, threading.Event()

    def isatty(self) -> bool:
        return self.terminal

    def write(self, text: str) -> int:
        count = super().write(text)
        if "half" in text:
            self.came.set()
        return count


def work_of(text: str, seconds: float) -> Work:
    """Work that began so long ago."""
    work = Work(text, lambda: 100.0)
    work.started -= seconds
    return work


def tellers() -> list[threading.Thread]:
    return [thread for thread in threading.enumerate() if thread.name == "progress"]


def test_the_line_says_how_far_what_and_how_long():
    work = work_of("fitting torsion", 12.0)
    work.update(0.4, "iteration 3")
    assert work.line == "fitting torsion: 40 %, iteration 3, 0:00:12 used, about 0:00:18 left"


def test_the_time_left_falls_between_updates():
    now = [10.0]
    work = Work("importing", lambda: now[0])
    now[0] += 1.0
    work.update(0.1)
    assert work.left.seconds == 9
    now[0] += 4.0
    assert work.left.seconds == 5
    # What takes longer than expected has no known end.
    now[0] += 6.0
    assert work.left is None


def test_work_that_grows_goes_not_back_and_has_no_known_end():
    """A ladder does not know how many steps it has: with each further one the share would begin again."""
    work = work_of("refining axis", 30.0)
    work.update(0.75, "refitting")
    assert work.left is not None
    work.update(0.25, "screening")
    assert work.line == "refining axis: 75 %, screening, 0:00:30 used"
    work.update(0.8, "refitting")
    assert work.line == "refining axis: 80 %, refitting, 0:00:30 used"


@pytest.mark.parametrize(("share", "percent"), ((0.0, 0), (1.5, 100)))
def test_no_time_left_is_named_where_none_is_known(share, percent):
    work = work_of("fitting", 61.0)
    work.update(share)
    assert work.line == f"fitting: {percent} %, 0:01:01 used"


def test_a_plain_line_comes_where_stderr_is_no_terminal_though_nothing_is_updated(monkeypatch, capsys):
    stream = Stream()
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setattr(_progress, "PERIOD", 0.001)
    with progress("fitting") as update:
        update(0.5, "half")
        assert stream.came.wait(DEADLINE)
    assert stream.getvalue().splitlines()[-1].startswith("fitting: 50 %, half, 0:")
    assert capsys.readouterr().out == ""
    assert not tellers()


def test_what_ends_soon_is_silent(monkeypatch, capsys):
    monkeypatch.setattr(_progress, "PERIOD", 1e6)
    with progress("fitting") as update:
        update(0.5, "half")
    assert capsys.readouterr() == ("", "")


def test_a_terminal_has_a_bar_with_the_time_left(monkeypatch):
    stream = Stream(terminal=True)
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "120")
    monkeypatch.setattr(_progress, "Work", lambda text: work_of(text, 60.0))
    with progress("fitting") as update:
        update(0.5, "half")
        assert stream.came.wait(DEADLINE)
    assert "0:01:00 left" in stream.getvalue()


@pytest.mark.parametrize("terminal", (False, True))
def test_quiet_is_silent(terminal, monkeypatch):
    stream = Stream(terminal=terminal)
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setattr(_progress, "PERIOD", 0.001)

    @click.command()
    @work_options
    def verb(*, as_json: bool) -> None:
        with progress("fitting") as update:
            update(0.5, "half")
            assert not tellers()

    verb.main(["--quiet"], standalone_mode=False)
    assert stream.getvalue() == ""


@pytest.mark.parametrize("writes", (False, True))
def test_an_interrupted_verb_says_that_nothing_is_kept_unless_it_leaves_files(writes):
    with pytest.raises(KeyboardInterrupt) as caught, progress("fitting", writes=writes):
        raise KeyboardInterrupt
    assert str(caught.value) == ("" if writes else "interrupted: nothing is kept")


@pytest.mark.parametrize("verb", main.VERBS)
def test_every_verb_with_progress_has_quiet(verb):
    module = importlib.import_module(main.group.get_command(None, verb).callback.__module__)
    options = {name for parameter in module.command.params for name in parameter.opts}
    # `narrated` shows the progress of both demonstrations.
    source = inspect.getsource(module)
    assert ("--quiet" in options) == (" progress(" in source or " narrated(" in source)
