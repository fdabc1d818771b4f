"""What `diagnose`, `refine` and `suggest` share: options, tables of evidence, limits, the file of an experiment."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from idloop.cli._common import ListOptionCommand, format_table, number
from idloop.errors import InputError

if TYPE_CHECKING:
    from idloop.diagnosis import Candidate
    from idloop.diagnosis.design.suggest import Limits
    from idloop.diagnosis.evidence.detection_limit import DetectionLimit
    from idloop.physics import Model
    from idloop.records import Record

Function = TypeVar("Function", bound=Callable[..., Any])

CRITERIA = ("auto", "prediction", "simulation", "force")
_NORMAL_95 = 1.959963984540054


class DiagnosisCommand(ListOptionCommand):
    """A command whose list options take several values at once."""

    list_options = ("--validate", "--effects", "--also")


def diagnosis_options(function: Function) -> Function:
    """Add `--level`, `--minimum-improvement`, `--effects` (given as `only`), `--criterion` and `--seed`."""
    function = seed_option(function)
    function = click.option(
        "--minimum-improvement",
        type=click.FloatRange(0.0, 100.0, max_open=True),
        default=1.0,
        show_default=True,
        metavar="PERCENT",
        help="An effect that makes the errors on unseen samples smaller by less is listed, not added.",
    )(function)
    function = criterion_option(function)
    function = click.option(
        "--effects",
        "only",
        multiple=True,
        metavar="NAME[@SITE]...",
        help="Choose from these effects only; the whole catalogue when left out.",
    )(function)
    return click.option(
        "--level",
        type=click.FloatRange(0.0, 0.5, min_open=True, max_open=True),
        default=0.01,
        show_default=True,
        help="How often an effect may be named where none is missing, over the whole catalogue.",
    )(function)


def criterion_option(function: Function) -> Function:
    """Add `--criterion`."""
    return click.option(
        "--criterion",
        type=click.Choice(CRITERIA),
        default="auto",
        show_default=True,
        help="What models are measured by: one-step errors, free-run errors or the unexplained drive force.",
    )(function)


def seed_option(function: Function) -> Function:
    """Add `--seed`."""
    return click.option(
        "--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Equal seeds give equal answers."
    )(function)


def limit_options(function: Function) -> Function:
    """Add the limits of an experiment, for `read_limits`."""
    options = (
        click.option("--max-command", type=float, metavar="VALUE", help="Largest command [input unit]."),
        click.option(
            "--position-range", type=(float, float), default=None, metavar="LOW HIGH", help="Range of the position."
        ),
        click.option("--max-velocity", type=float, metavar="VALUE", help="Largest velocity."),
        click.option("--duration", type=click.FloatRange(0.0, min_open=True), metavar="SECONDS", help="Its length."),
    )
    for option in reversed(options):
        function = option(function)
    return function


def read_limits(
    max_command: float | None, position_range: tuple[float, float] | None, max_velocity: float | None
) -> Limits:
    """Limits from the options; what is not given is the largest seen in the data."""
    from idloop.diagnosis.design.suggest import Limits

    return Limits(max_command, position_range, max_velocity)


# ---------------------------------------------------------------- evidence


def parameter_text(name: str, entry: Mapping[str, Any]) -> str:
    """Text of a parameter with its 95 % interval: "width 0.121 ± 0.002 V"; one that is held is said to be."""
    value, stderr, unit = entry.get("value"), entry.get("stderr"), (entry.get("unit") or "").removeprefix("-")
    if value is None:
        return f"{name} -"
    if stderr is None or not math.isfinite(stderr):
        return f"{name} {number(value)} {unit}".rstrip() + (" (held)" if entry.get("held") else "")
    if stderr == 0.0:  # read off the data
        return f"{name} {number(value, 6)} {unit}".rstrip()
    reach = _NORMAL_95 * stderr
    # As many digits as the interval bears.
    digits = 2 if value == 0.0 or reach == 0.0 else max(2, 2 + math.ceil(math.log10(max(abs(value) / reach, 1.0))))
    return f"{name} {number(value, min(digits, 6))} ± {number(reach, 2)} {unit}".rstrip()


def parameters_text(parameters: Mapping[str, Mapping[str, Any]]) -> str:
    """Text of all parameters of an effect."""
    return ", ".join(parameter_text(name, entry) for name, entry in parameters.items())


def p_text(value: float | None) -> str:
    """Text of a family-wise p-value."""
    if value is None:
        return "-"
    return f"{value:.2g}" if value >= 1e-3 else "< 0.001"


def print_candidates(
    candidates: Sequence[Candidate],
    tied: Sequence[str],
    limits: Mapping[str, DetectionLimit],
    *,
    everything: bool = False,
) -> None:
    """Print the ranked table of effects.

    Parameters
    ----------
    candidates : sequence of Candidate
    tied : sequence of str
        Names of the best effect and of those that the data cannot tell from it.
    limits : mapping of str to DetectionLimit
        Size from which on each would show.
    everything : bool
        Also effects that were only screened.
    """
    rows = []
    for candidate in candidates:
        if candidate.model is None and not everything:
            continue
        mark = "*" if tied and candidate.name == tied[0] else "=" if candidate.name in tied else ""
        rows.append(
            (
                mark,
                candidate.name,
                p_text(candidate.p_value),
                f"{100.0 * candidate.explains:.1f}" if candidate.model is not None else "-",
                parameters_text(candidate.parameters) if candidate.model is not None else "-",
                candidate.testable,
                limits[candidate.name].short if candidate.name in limits else "-",
            )
        )
    if rows:
        click.echo(
            format_table(("", "effect", "p", "explains %", "parameters (95 %)", "testable", "would show with"), rows)
        )
    screened = sum(candidate.model is None for candidate in candidates)
    if screened and not everything:
        click.echo(f"{screened} more effects were screened and show nothing (--all lists them)")


def tie_text(tied: Sequence[str]) -> str:
    """Sentence about effects that the data cannot tell from the best one; empty without any."""
    if len(tied) < 2:
        return ""
    return f"this data cannot tell {tied[0]} from {', '.join(tied[1:])} (marked =)"


# ---------------------------------------------------------------- the next experiment


def experiment_text(suggested: Mapping[str, Any]) -> str:
    """YAML that the excitation node takes as its parameter `experiment`, with what to know as comments."""
    import io

    from ruamel.yaml import YAML

    lines = [f"# {suggested['text']}"] + [f"# {outcome['text']}" for outcome in suggested.get("outcomes", ())]
    lines.append(f"# starts at rest at position {suggested.get('start', 0.0):.6g}; lasts {suggested['duration']:g} s")
    buffer = io.StringIO()
    plain = {
        key: list(value) if isinstance(value, list | tuple) else value for key, value in suggested["signal"].items()
    }
    YAML().dump({"signal": plain, "adds_to": suggested["adds_to"]}, buffer)
    return "\n".join(lines) + "\n" + buffer.getvalue()


def read_some(bags: Sequence[Path], model: Model) -> list[Record]:
    """Read the records of bags that must be there.

    Raises
    ------
    InputError
        No bag is given.
    """
    from idloop.cli._common import read_records

    if not bags:
        raise InputError("BAG is missing: name the recordings that the model is to explain")
    return read_records(bags, model)
