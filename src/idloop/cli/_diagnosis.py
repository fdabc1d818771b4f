"""What `diagnose`, `refine` and `suggest` share: options, tables of evidence, limits, the file of an experiment."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

import click

from idloop.cli._common import ListOptionCommand

if TYPE_CHECKING:
    from idloop.diagnosis.design.suggest import Limits

Function = TypeVar("Function", bound=Callable[..., Any])

CRITERIA = ("auto", "prediction", "simulation", "force")


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
