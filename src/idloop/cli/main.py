"""The command `idloop`: finds the verb, loads only that one, and turns every failure into one line."""

from __future__ import annotations

import _thread
import difflib
import importlib
import keyword
import os
import sys
import tempfile
import threading
import traceback
import warnings
from collections.abc import Sequence
from typing import NoReturn

import click

from idloop import __version__
from idloop.errors import IdloopError, InputError, one_line

DONE, COULD_NOT, WRONG_USE, INTERRUPTED, BROKEN_PIPE = 0, 1, 2, 130, 141
COMPLETE = "_IDLOOP_COMPLETE"  # click's name for the variable by which a shell asks for completions


# What each verb does, in one line; the module of its name has a click command `command`.
VERBS = {
    "demo": "Run the loop from end to end on this machine and check it.",
    "start": "From a log of any form to bags, a model file and a first fit.",
    "launch": "Start a node graph without ros2 launch.",
    "model": "Print a preset model, or check a model file and print it whole.",
    "import": "Turn a log or a foreign bag into a bag of our topics, by a mapping.",
    "inspect": "Say what is in a recording and what it can and cannot show.",
    "fit": "Estimate a model's free parameters from bags, with intervals.",
    "identify": "Identify black-box models by any method and compare them.",
    "compare": "Compare what was measured with what models say.",
    "diagnose": "Name the physical effects that a model lacks.",
    "refine": "Add what is missing, step by step: the ladder.",
    "robot": "Identify a whole robot: its links, and every joint of a bag.",
    "fleet": "Identify the joints of many robots over time: who wears, what changed.",
    "workbench": "Look, find what is missing and add it, in a browser.",
    "suggest": "Choose the next experiment, within limits.",
    "report": "Write a ladder as one HTML page that can be mailed.",
    "compensate": "Cancel in the controller what was found, and measure the gain.",
    "monitor": "Watch wear: alarm when friction, play or another effect grows.",
    "export": "Write a model for URDF, MuJoCo, python-control or ros2_control.",
    "trust": "Let the effect files beside a model run, once for each folder.",
    "replay": "Play a recording into a live estimator.",
    "papers": "Redo a row of the source papers and put ours beside theirs.",
    "recover": "Save what can be read of a recording cut off by a crash.",
}


class LazyGroup(click.Group):
    """A group that knows its verbs' names and summaries without importing any of them."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Verbs in the order of the table, which is that of the work."""
        return list(VERBS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import the verb; None when there is none of that name."""
        if cmd_name not in VERBS:
            return None
        # A keyword of Python has an underscore behind it.
        module = f"{cmd_name}_" if keyword.iskeyword(cmd_name) else cmd_name
        command: click.Command = importlib.import_module(f"idloop.cli.verbs.{module}").command
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the table of verbs from their summaries alone."""
        with formatter.section("Verbs"):
            formatter.write_dl(list(VERBS.items()))

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the verb, or say which one was probably meant."""
        name = args[0]
        if name not in VERBS and not name.startswith("-"):
            near = difflib.get_close_matches(name, VERBS, n=1, cutoff=0.5)
            hint = f"did you mean {near[0]!r}?" if near else f"choose from {', '.join(VERBS)}"
            raise click.UsageError(f"no verb {name!r}: {hint}", ctx)
        return super().resolve_command(ctx, args)


@click.group(cls=LazyGroup, invoke_without_command=True, no_args_is_help=False)
@click.version_option(__version__, prog_name="idloop")
@click.pass_context
def group(ctx: click.Context) -> None:
    """Identification in the loop: what a servo axis really does.

    Every verb has --help. With --json it prints one JSON document on stdout; logs go to stderr.
    Exit code 0: done, 1: could not, 2: wrong use or bad input.
    """
    if ctx.invoked_subcommand is None:
        click.echo(ctx.get_help())


def _complain(verb: str, text: object) -> None:
    sys.stderr.write(f"idloop {verb}".rstrip() + f": {one_line(str(text))}\n")


def _usage_line(error: click.ClickException, verb: str) -> str:
    text = one_line(error.format_message())
    # Messages of our own already say how to mend it.
    hint = "" if ": " in text or not isinstance(error, click.UsageError) else f" (see: idloop {verb} --help)"
    return text + hint.replace("  ", " ")


def _save_traceback() -> str:
    with tempfile.NamedTemporaryFile("w", prefix="idloop-", suffix=".log", delete=False) as file:
        traceback.print_exc(file=file)
    return file.name


def run(arguments: Sequence[str]) -> int:
    """Run one command line and return its exit code; every failure is one line on stderr.

    `arguments`: the command line without the program's name. Returns: 0 done, 1 could not, 2 wrong use or bad input,
    130 after Ctrl-C, 141 when the reader of stdout has gone.
    """
    # The group itself takes no option with a value, so the first word is the verb.
    verb = next((word for word in arguments if not word.startswith("-")), "")
    try:
        # Not group.main: it would answer a closed pipe and Ctrl-C in its own way.
        with group.make_context("idloop", list(arguments)) as context:
            result = group.invoke(context)
        sys.stdout.flush()
    except click.exceptions.Exit as end:
        sys.stdout.flush()
        return end.exit_code
    except InputError as error:
        _complain(verb, error)
        return WRONG_USE
    except IdloopError as error:
        _complain(verb, error)
        return COULD_NOT
    except click.ClickException as error:
        _complain(verb if verb in VERBS else "", _usage_line(error, verb))
        return WRONG_USE
    except (click.Abort, KeyboardInterrupt) as end:
        _complain(verb, str(end) or "interrupted")
        return INTERRUPTED
    except BrokenPipeError:
        # The interpreter flushes stdout once more at its end: give it somewhere to go.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return BROKEN_PIPE
    except Exception as error:
        if os.environ.get("IDLOOP_DEBUG"):
            raise
        _complain(verb, f"a fault in idloop, {type(error).__name__}: {error} (traceback: {_save_traceback()})")
        return COULD_NOT
    return result if isinstance(result, int) else DONE


def _say_again(lost: sys.UnraisableHookArgs) -> None:
    """Repeat a Ctrl-C that came inside a callback of C code, as the compiler has them: there it is lost."""
    if issubclass(lost.exc_type, KeyboardInterrupt):
        # Not at once, which would be inside the callback still.
        threading.Timer(0.05, _thread.interrupt_main).start()
    else:
        sys.__unraisablehook__(lost)


def main() -> NoReturn:
    """Run the command line of this process, or complete it for the shell."""
    sys.unraisablehook = _say_again
    # Sums depend on how many threads share them, and equal seeds give equal answers. Besides, our matrices are tall and
    # narrow: more threads of linear algebra only wait for each other.
    os.environ |= dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    if not sys.warnoptions:
        # What a library notices is no line for the user; what counts is said by us.
        warnings.simplefilter("ignore")
    if instruction := os.environ.get(COMPLETE):
        from click.shell_completion import shell_complete

        sys.exit(shell_complete(group, {}, "idloop", COMPLETE, instruction))
    sys.exit(run(sys.argv[1:]))
