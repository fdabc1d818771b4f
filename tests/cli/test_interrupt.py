"""Ctrl-C during long work: what was found is kept, what to type to go on is said, and no traceback."""

from __future__ import annotations

import json
import shlex
import signal
import subprocess
import sys
import threading
from collections.abc import Callable

import pytest

from idloop.cli import main

DEADLINE = 600.0
# A line on stdout after every step; what is done then goes on.
STEPS = """
import sys
from idloop.cli import main
from idloop.cli.verbs import refine
write = refine.write_ladder
def told(folder, kept):
    write(folder, kept)
    print("step", flush=True)
refine.write_ladder = told
sys.exit(main.run(sys.argv[1:]))
"""
# A line of progress soon.
SOON = """
import sys
from idloop.cli import _progress, main
_progress.PERIOD = 0.01
sys.exit(main.run(sys.argv[1:]))
"""


# A fit that is sure to be interrupted.
FITS = SOON.replace(
    "import sys",
    "import sys, itertools, idloop.estimation\n"
    "once = idloop.estimation.fit\n"
    "idloop.estimation.fit = lambda *given, **named: [once(*given, **named) for _ in itertools.count()]",
)


# What a shell has begun in the background ignores SIGINT, and so do its children, were it not for this.
HEEDED = "import signal\nsignal.signal(signal.SIGINT, signal.default_int_handler)\n"


def interrupted(code: str, words: list[object], *, when: Callable[[subprocess.Popen[str]], str]) -> tuple[str, str]:
    """Send SIGINT as soon as a line has come; the last line on stderr, and all of stdout after that."""
    command = [sys.executable, "-c", HEEDED + code, *map(str, words)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        late = threading.Timer(DEADLINE, process.kill)
        late.start()
        try:
            assert when(process), process.communicate()
            process.send_signal(signal.SIGINT)
            out, err = process.communicate()
        finally:
            late.cancel()
            process.kill()
    assert process.returncode == 130, err
    assert "Traceback" not in err
    return err.splitlines()[-1], out


def step_is_written(process: subprocess.Popen[str]) -> str:
    return process.stdout.readline()


def work_has_begun(process: subprocess.Popen[str]) -> str:
    return process.stderr.readline()


@pytest.mark.slow
def test_refine_keeps_its_steps_and_says_how_to_go_on(hidden, refined, tmp_path, capsys):
    folder = tmp_path / "a folder"
    words = ["refine", hidden.model, hidden.levels, "--validate", hidden.unseen, "--most", 3, "--output", folder]
    line, out = interrupted(STEPS, words, when=step_is_written)
    assert out.replace("step\n", "") == ""
    assert line.startswith(
        f"idloop refine: interrupted: {folder} keeps model.yaml and ladder.json with dead_zone@input"
    )
    assert {path.name for path in folder.iterdir()} == {"model.yaml", "ladder.json"}
    program, *again = shlex.split(line.partition("; go on with: ")[2])
    assert [program, *again] == ["idloop", "refine", "--resume", str(folder), "--most", "3"]

    assert main.run(again) == 0
    capsys.readouterr()
    ended, whole = (json.loads((place / "ladder.json").read_text(encoding="utf-8")) for place in (folder, refined))
    for key in ("verdict", "criterion", "untestable", "validate"):
        assert ended[key] == whole[key]
    assert [step["added"] for step in ended["ladder"]] == [step["added"] for step in whole["ladder"]]


@pytest.mark.slow
def test_without_a_folder_refine_says_what_it_had_found(hidden):
    code = STEPS.replace("refine.write_ladder", "refine._Keeper.__call__")
    line, _ = interrupted(code, ["refine", hidden.model, hidden.levels], when=step_is_written)
    assert line == (
        "idloop refine: interrupted: nothing is kept without --output; found so far: dead_zone@input"
    )  # fmt: skip


def test_before_the_first_step_there_is_nothing_to_keep(hidden, tmp_path):
    folder = tmp_path / "ladder"
    words = ["refine", hidden.model, hidden.levels, "--output", folder]
    line, out = interrupted(SOON, words, when=work_has_begun)
    assert line == "idloop refine: interrupted: nothing is kept, no step was finished"
    assert out == ""
    assert not folder.exists()


@pytest.mark.parametrize(("verb", "code"), (("fit", FITS), ("diagnose", SOON)))
def test_one_line_says_that_nothing_is_kept(verb, code, hidden):
    line, out = interrupted(code, [verb, hidden.model, hidden.levels, "--json"], when=work_has_begun)
    assert line == f"idloop {verb}: interrupted: nothing is kept"
    assert out == ""
