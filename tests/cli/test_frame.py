"""The frame of the command: starts without heavy libraries, fails in one line with the right exit code."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from pathlib import Path

import click
import pytest

import idloop
from idloop.cli import main
from idloop.errors import IdloopError, InputError

HEAVY = ("numpy", "scipy", "numba", "control", "matplotlib", "rosbags", "mcap", "pydantic", "rich", "ruamel", "rclpy")
VERB_FOLDER = Path(main.__file__).parent


def idloop_process(*arguments: str, code: str | None = None, **variables: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", code] if code else [sys.executable, "-m", "idloop"]
    return subprocess.run(
        [*command, *arguments],
        capture_output=True,
        text=True,
        check=False,
        timeout=200,
        env={**os.environ, **variables},
    )


@pytest.fixture
def verb(monkeypatch: pytest.MonkeyPatch) -> dict[str, object]:
    """A verb `try` that does what the test puts in `behaviour`."""
    behaviour: dict[str, object] = {}

    @click.command()
    @click.option("--number", type=int)
    def command(number: int | None) -> None:
        behaviour["do"]()  # type: ignore[operator]

    module = type(sys)("try_verb")
    module.command = command  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "idloop.cli.verbs.try_", module)
    monkeypatch.setitem(main.VERBS, "try", "Try.")
    return behaviour


def raising(error: BaseException):
    def do() -> None:
        raise error

    return do


@pytest.mark.parametrize("arguments", ([], ["--help"], ["--version"]))
def test_help_and_version_import_nothing_heavy(arguments):
    code = (
        "import sys; from idloop.cli.main import run; code = run(sys.argv[1:]);"
        f"print(*sorted(set({HEAVY!r}) & set(sys.modules)), file=sys.stderr); sys.exit(code)"
    )
    result = idloop_process(*arguments, code=code)
    assert result.returncode == 0
    assert result.stderr.strip() == ""
    assert idloop.__version__ in result.stdout if "--version" in arguments else "Verbs" in result.stdout


def test_every_verb_of_the_table_is_a_file_and_every_file_is_in_the_table():
    verbs = {path.stem for path in (VERB_FOLDER / "verbs").glob("[a-z]*.py")}
    assert {verb.removesuffix("_") for verb in verbs} == main.VERBS.keys()


@pytest.mark.parametrize("name", main.VERBS)
def test_every_verb_explains_itself(name, capsys):
    assert main.run([name, "--help"]) == 0
    out = capsys.readouterr().out
    assert f"idloop {name}" in out
    assert "--json" in out


@pytest.mark.parametrize(
    ("arguments", "expected"),
    (
        (["modle"], "did you mean 'model'"),
        (["zzzzz"], "choose from"),
        (["--versoin"], "--version"),
        (["try", "--numbr", "3"], "--number"),
        (["try", "--number", "three"], "--number"),
        (["try", "extra"], "extra"),
    ),
)
def test_wrong_use_is_one_line_and_exit_code_2(arguments, expected, verb, capsys):
    assert main.run(arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert err.startswith("idloop")
    assert expected in err


@pytest.mark.parametrize(
    ("error", "code", "line"),
    (
        (InputError("key a:\n  mend it"), 2, "idloop try: key a: mend it\n"),
        (IdloopError("no convergence"), 1, "idloop try: no convergence\n"),
        (click.UsageError("mind: this"), 2, "idloop try: mind: this\n"),
        (KeyboardInterrupt(), 130, "idloop try: interrupted\n"),
        (KeyboardInterrupt("kept"), 130, "idloop try: kept\n"),
    ),
)
def test_failures_of_a_verb(error, code, line, verb, capsys):
    verb["do"] = raising(error)
    assert main.run(["try"]) == code
    out, err = capsys.readouterr()
    assert (out, err) == ("", line)


def test_a_fault_names_a_file_with_the_traceback(verb, capsys, monkeypatch, tmp_path):
    monkeypatch.delenv("IDLOOP_DEBUG", raising=False)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    verb["do"] = raising(ZeroDivisionError("division\nby \x1b[31mzero"))
    assert main.run(["try"]) == 1
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert err.rstrip("\n").isprintable()
    (log,) = tmp_path.iterdir()
    assert str(log) in err
    assert "ZeroDivisionError" in log.read_text()


def test_a_fault_is_raised_when_debugging(verb, monkeypatch):
    monkeypatch.setenv("IDLOOP_DEBUG", "1")
    verb["do"] = raising(ZeroDivisionError())
    with pytest.raises(ZeroDivisionError):
        main.run(["try"])


@pytest.mark.slow
def test_an_interrupt_inside_a_callback_of_c_code_is_not_lost():
    code = (
        "import ctypes, signal, threading, click; from idloop.cli import main\n"
        "callback = ctypes.CFUNCTYPE(None)(lambda: signal.raise_signal(signal.SIGINT))\n"
        "def do(): callback(); threading.Event().wait(100.0)\n"
        "module = type(sys)('try_verb'); module.command = click.Command('try', callback=do)\n"
        "sys.modules['idloop.cli.verbs.try_'] = module; main.VERBS['try'] = ''\n"
        "main.main()"
    )
    done = idloop_process("try", code=f"import sys; {code}")
    assert (done.returncode, done.stderr) == (130, "idloop try: interrupted\n")


def test_a_closed_pipe_is_quiet():
    code = (
        "import os, sys, click; from idloop.cli import main\n"
        "def do(): [click.echo('x' * 1000) for _ in range(1000)]\n"
        "module = type(sys)('try_verb'); module.command = click.Command('try', callback=do)\n"
        "sys.modules['idloop.cli.verbs.try_'] = module; main.VERBS['try'] = ''\n"
        "sys.exit(main.run(['try']))"
    )
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdout.read(10)
    process.stdout.close()
    errors = process.stderr.read()
    process.stderr.close()
    assert process.wait(60) == 141
    assert errors == b""


def test_json_has_null_for_what_is_no_number(capsys):
    import numpy as np

    from idloop.cli._outputs import print_json

    print_json({"a": math.nan, "b": np.array([1.0, np.inf]), "c": np.float64(2), 3: {"d"}, "p": Path("x")})
    document = json.loads(capsys.readouterr().out)
    assert document == {"a": None, "b": [1.0, None], "c": 2.0, "3": ["d"], "p": "x"}


def test_json_refuses_what_it_cannot_say():
    from idloop.json_values import to_json

    with pytest.raises(TypeError, match="object"):
        to_json(object())


@pytest.mark.parametrize("text", ("inertia", "=3", "a=b", "a=nan", "a=inf"))
def test_bad_settings(text):
    from idloop.cli._inputs import parse_setting

    with pytest.raises(InputError, match="--set"):
        parse_setting(text)


def test_several_values_after_one_validate():
    from idloop.cli._inputs import ListOptionCommand

    seen = {}
    command = ListOptionCommand(
        "x",
        params=[
            click.Argument(["bags"], nargs=-1),
            click.Option(["--validate"], multiple=True),
            click.Option(["--other"]),
        ],
        callback=lambda **given: seen.update(given),
    )
    command.main(["a", "b", "--validate", "c", "d", "--other", "e", "--validate", "f"], standalone_mode=False)
    assert seen == {"bags": ("a", "b"), "validate": ("c", "d", "f"), "other": "e"}


def test_the_shell_completes_verbs():
    result = idloop_process(
        code="from idloop.cli.main import main; main()",
        _IDLOOP_COMPLETE="bash_complete",
        COMP_WORDS="idloop mod",
        COMP_CWORD="1",
    )
    assert result.stdout.strip() == "plain,model"


def test_tables_align_words_left_and_numbers_right():
    from idloop.reporting.text.blocks import Table, as_text

    text = as_text([Table.of(["name", "value"], [["inertia", "1.5"], ["b", "-"], ["c", "-12"]])])
    assert text == "name     value\n-------  -----\ninertia    1.5\nb            -\nc          -12"
