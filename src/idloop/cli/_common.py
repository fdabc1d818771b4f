"""What the verbs share: arguments (MODEL, BAG, --set, --effect, --trust-effects, --plot), --json, tables."""

from __future__ import annotations

import contextlib
import json
import math
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from idloop.cli._places import PLOT
from idloop.cli._progress import progress
from idloop.errors import InputError
from idloop.json_values import to_json
from idloop.reporting.text.blocks import Block, as_text, format_table

if TYPE_CHECKING:
    from idloop.api.inspection import BagGrade
    from idloop.physics import Model
    from idloop.records import Record
    from idloop.records.align import ModelSignals

Function = TypeVar("Function", bound=Callable[..., Any])


# ---------------------------------------------------------------- arguments


class ModelArgument(click.ParamType["Model"]):
    """MODEL: the name of a preset or the path of a model file."""

    name = "MODEL"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Model:
        """Load it; an InputError says in one line what is wrong with it."""
        return open_model(value)


class BagArgument(click.ParamType[Path]):
    """BAG: a recording that exists (a folder or a file)."""

    name = "BAG"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """Check that it is there."""
        path = Path(value)
        if not path.exists():
            raise InputError(f"no bag {value}: check the path (recordings go to bags/ by default)")
        return path


MODEL = ModelArgument()
BAG = BagArgument()
_TRUST_EFFECTS = "idloop.trust_effects"
_JOINTS = "idloop.joint"


def trust_option(function: Function) -> Function:
    """Add `--trust-effects`, which `open_model` obeys; whatever its place, it is read before any model."""

    def keep(context: click.Context, parameter: click.Parameter, value: bool) -> None:
        context.meta[_TRUST_EFFECTS] = value

    return click.option(
        "--trust-effects",
        is_flag=True,
        is_eager=True,
        expose_value=False,
        callback=keep,
        help="Run the Python files in `effects` beside a MODEL this once; see idloop trust.",
    )(function)


def open_model(source: str) -> Model:
    """Load a model that the command line names.

    Raises InputError: as `load_model`; effect files beside it that are not trusted, without `--trust-effects`.
    """
    from idloop.physics import load_model

    context = click.get_current_context(silent=True)
    return load_model(source, allow_effects=context is not None and context.meta.get(_TRUST_EFFECTS, False))


def plot_option(function: Function) -> Function:
    """Add `--plot FILE`, given to the verb as `plot` (a path or None)."""
    return click.option("--plot", type=PLOT, metavar="FILE", help="Write the figure (.png, .svg, .pdf).")(function)


def model_options(function: Function) -> Function:
    """Add `--set NAME=VALUE`, `--effect NAME@SITE(...)` and `--joint NAME=NAME`, and `--trust-effects`."""

    def keep(context: click.Context, parameter: click.Parameter, value: tuple[str, ...]) -> None:
        context.meta[_JOINTS] = value

    function = trust_option(function)
    function = click.option(
        "--joint",
        multiple=True,
        expose_value=False,
        callback=keep,
        metavar="NAME=IN_BAG",
        help="Joint of the model that has another name in the bags, as in --joint axis=elbow_joint. May be repeated.",
    )(function)
    function = click.option(
        "--effect",
        "effects",
        multiple=True,
        metavar="NAME@SITE[(PARAMETER=VALUE,...)]",
        help="Add an effect to the model, as in --effect 'dead_zone@input(width=0.1)'. May be repeated.",
    )(function)
    return click.option(
        "--set",
        "settings",
        multiple=True,
        metavar="NAME=VALUE",
        help="Change a parameter of the model, as in --set motor.inertia=0.5. May be repeated.",
    )(function)


def parse_setting(text: str) -> tuple[str, float]:
    """Split "motor.inertia=0.5" into its name and its value.

    Raises InputError: when there is no "=" or the value is not a finite number.
    """
    name, equals, value = text.partition("=")
    if not equals or not name.strip():
        raise InputError(f"--set {text}: write NAME=VALUE, as in --set motor.inertia=0.5")
    try:
        number = float(value)
    except ValueError:
        raise InputError(f"--set {text}: {value.strip()!r} is not a number") from None
    if not math.isfinite(number):
        raise InputError(f"--set {text}: the value must be finite")
    return name.strip(), number


def apply_options(model: Model, settings: Sequence[str], effects: Sequence[str]) -> Model:
    """Model with the joints of `--joint` renamed, the effects of `--effect` added, and the values of `--set`."""
    context = click.get_current_context(silent=True)
    joints = context.meta.get(_JOINTS, ()) if context is not None else ()
    if joints:
        from idloop.physics.model_file import with_joints

        pairs = [text.partition("=")[::2] for text in joints]
        wrong = next((text for text, pair in zip(joints, pairs, strict=True) if not all(pair)), None)
        if wrong is not None:
            raise InputError(f"--joint {wrong}: write NAME=IN_BAG, as in --joint axis=elbow_joint")
        model = with_joints(model, dict(pairs))
    if effects:
        from idloop.cli._effect_words import effect_text

        model = model.with_effects([effect_text(text, model) for text in effects])
    if settings:
        model = model.with_values(dict(map(parse_setting, settings)))
    return model


def read_fitted_and_unseen(
    bags: Sequence[Path], unseen: Sequence[Path], model: ModelSignals
) -> tuple[list[Record], list[Record]]:
    """Read what is fitted, and what is to judge it.

    Raises InputError: as `read_records`; a bag that is both.
    """
    fitted = {bag.resolve() for bag in bags}
    for bag in unseen:
        if bag.resolve() in fitted:
            raise InputError(f"--validate {bag}: the fit sees this bag; give one that it does not see, or none")
    return read_records(bags, model), read_records(unseen, model, excited=False)


def read_records(
    bags: Iterable[Path], model: ModelSignals, *, fitted: bool = True, excited: bool = True
) -> list[Record]:
    """Read the streams that the model names (`idloop.read_bags`), and print what was noticed."""
    from idloop.api.data import read_bags

    return [_with_warnings(record) for record in read_bags(bags, model, fitted=fitted, excited=excited)]


def log_grades(bags: Sequence[Path], model: Model, records: Iterable[Record]) -> list[BagGrade]:
    """Say in one line for each bag what an inspection finds wrong with it, beside what was noticed while reading."""
    from idloop.api.inspection import bag_grades

    with progress("inspecting the bags"):
        grades = bag_grades(bags, model)
    said = {finding.text for record in records for finding in record.findings}
    for line in filter(None, (one.line(said) for one in grades)):
        log(line)
    return grades


def read_one_record(bag: Path, model: Model) -> Record:
    """Read the streams that the model names from a bag (`idloop.read_bag`), and print what was noticed."""
    from idloop.api.data import read_bag

    return _with_warnings(read_bag(bag, model))


def _with_warnings(record: Record) -> Record:
    for finding in record.findings:
        if finding.level == "warning":
            log(f"{record.name}: {finding.text}")
    return record


class ListOptionCommand(click.Command):
    """A command whose repeatable path options also take several values at once: `--validate A B C`.

    Only options in `list_options` do so: they take the words up to the next option.
    """

    list_options: tuple[str, ...] = ("--validate",)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Write the option again before each further value, which is what click understands."""
        spelled: list[str] = []
        option = ""
        values = 0
        for word in args:
            if word.startswith("-") and word != "-":
                option, values = (word if word in self.list_options else ""), 0
                spelled.append(word)
                continue
            values += 1
            spelled.extend([option, word] if option and values > 1 else [word])
        return super().parse_args(ctx, spelled)


# ---------------------------------------------------------------- output


def json_option(function: Function) -> Function:
    """Add `--json`, given to the verb as `as_json`."""
    return click.option("--json", "as_json", is_flag=True, help="Print one JSON document on stdout, nothing else.")(
        function
    )


def print_json(document: Any) -> None:
    """Print the one document of a verb called with `--json`."""
    click.echo(json.dumps(to_json(document), indent=2, ensure_ascii=False, allow_nan=False))


def print_found(found: Any, *, as_json: bool, **more: Any) -> None:
    """Print a result: its document with `more` beside it, or its text."""
    if as_json:
        print_json({**found.to_dict(), **more})
    else:
        print_blocks(found.blocks())


def save_plot(draw: Callable[[], Any], path: Path | None) -> None:
    """Draw a figure and write it, where a file is asked for."""
    if path is not None:
        from idloop.drawing import save

        save(draw(), path)


def log_written(*paths: Path | None) -> None:
    """Name the files that were written, those that were asked for."""
    for path in paths:
        if path is not None:
            log(f"written: {path}")


def log(text: str) -> None:
    """Write one line for the reader on stderr, where it disturbs neither tables nor JSON."""
    with contextlib.suppress(OSError):  # the terminal may be gone
        click.echo(text, err=True)


def print_table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print `format_table`."""
    click.echo(format_table(header, rows))


def print_blocks(blocks: Iterable[Block]) -> None:
    """Print paragraphs and tables."""
    click.echo(as_text(blocks))
