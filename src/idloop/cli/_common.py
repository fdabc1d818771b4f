"""What the verbs share: arguments (MODEL, BAG, --set, --effect, --trust-effects, --plot), --json, tables."""

from __future__ import annotations

import contextlib
import dataclasses
import enum
import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from idloop.cli._places import PLOT
from idloop.errors import InputError

if TYPE_CHECKING:
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

    Raises
    ------
    InputError
        As `load_model`; effect files beside it that are not trusted, without `--trust-effects`.
    """
    from idloop.physics import load_model

    context = click.get_current_context(silent=True)
    return load_model(source, allow_effects=context is not None and context.meta.get(_TRUST_EFFECTS, False))


def plot_option(function: Function) -> Function:
    """Add `--plot FILE`, given to the verb as `plot` (a path or None)."""
    return click.option("--plot", type=PLOT, metavar="FILE", help="Write the figure (.png, .svg, .pdf).")(function)


def model_options(function: Function) -> Function:
    """Add `--set NAME=VALUE` and `--effect NAME@SITE(...)`, for `apply_options`, and `--trust-effects`."""
    function = trust_option(function)
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

    Raises
    ------
    InputError
        When there is no "=" or the value is not a finite number.
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
    """Model with the effects of `--effect` added and then the values of `--set` in place."""
    if effects:
        model = model.with_effects(list(effects))
    if settings:
        model = model.with_values(dict(map(parse_setting, settings)))
    return model


def read_fitted_and_unseen(
    bags: Sequence[Path], unseen: Sequence[Path], model: ModelSignals
) -> tuple[list[Record], list[Record]]:
    """Read what is fitted, and what is to judge it.

    Raises
    ------
    InputError
        As `read_records`; a bag that is both.
    """
    fitted = {bag.resolve() for bag in bags}
    for bag in unseen:
        if bag.resolve() in fitted:
            raise InputError(f"--validate {bag}: the fit sees this bag; give one that it does not see, or none")
    return read_records(bags, model), read_records(unseen, model, excited=False)


def read_records(
    bags: Iterable[Path], model: ModelSignals, *, fitted: bool = True, excited: bool = True
) -> list[Record]:
    """Read the streams that the model names: a record for each run of the clock in each bag.

    Raises
    ------
    InputError
        What cannot be read, a bag given twice; where they are to be `fitted`, also a motion that no fit can use, and
        where they are to be `excited`, commands of which none ever changes.
    """
    from idloop import records

    bags = list(bags)
    seen: set[Path] = set()
    for bag in bags:
        if bag.resolve() in seen:
            raise InputError(f"{bag} is given twice: one recording counts once; leave it out, or give another")
        seen.add(bag.resolve())
    found = records.read_records(bags, model)
    if fitted and excited:
        found = records.check_commands(found)
    return [_with_warnings(records.check_identifiable(record) if fitted else record) for record in found]


def read_one_record(bag: Path, model: Model) -> Record:
    """Read the streams that the model names from a bag that is one run of the clock; of several parts the longest."""
    from idloop import records
    from idloop.records.align import output_scales
    from idloop.records.inspection.velocity_check import without_wrong_velocities

    parts = records.cut_at_gaps(records.read_record(bag, model, check=False))
    longest = max(parts, key=lambda part: part.time.size)
    if len(parts) > 1:
        text = f"only the longest part is shown, {longest.time[0]:.6g} to {longest.time[-1]:.6g} s"
        finding = records.Finding("cut", text, where=longest.name, level="warning")
        longest = dataclasses.replace(longest, findings=(*parts[0].findings, finding))
    checked = records.check_record(longest, held=model.input.kind == "held")
    return _with_warnings(*without_wrong_velocities([checked], output_scales(model)))


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


def to_json(value: Any) -> Any:
    """Plain JSON types of anything the library returns; a number that is not finite becomes null."""
    if value is None or isinstance(value, bool | str):
        return value
    if isinstance(value, enum.Enum):
        return to_json(value.value)
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: to_json(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(key): to_json(item) for key, item in value.items()}
    if isinstance(value, Path):
        return str(value)
    # NumPy's arrays and scalars, told by what they can do so that NumPy need not be imported.
    if hasattr(value, "tolist"):
        return to_json(value.tolist())
    if isinstance(value, set | frozenset):
        return [to_json(item) for item in sorted(value)]
    if isinstance(value, Iterable):
        return [to_json(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, int):
        return value
    raise TypeError(f"{type(value).__name__} has no JSON form")


def print_json(document: Any) -> None:
    """Print the one document of a verb called with `--json`."""
    click.echo(json.dumps(to_json(document), indent=2, ensure_ascii=False, allow_nan=False))


def log(text: str) -> None:
    """Write one line for the reader on stderr, where it disturbs neither tables nor JSON."""
    with contextlib.suppress(OSError):  # the terminal may be gone
        click.echo(text, err=True)


def number(value: float | None, digits: int = 4) -> str:
    """Text of a number in tables; "-" where there is none."""
    return "-" if value is None or not math.isfinite(value) else f"{value:.{digits}g}"


def format_table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Text of aligned columns: words to the left, numbers to the right.

    The same on a terminal and in a pipe, so that scripts and eyes see one thing.
    """
    cells = [list(map(str, row)) for row in rows]
    columns = list(zip(header, *cells, strict=True))
    widths = [max(map(len, column)) for column in columns]
    numeric = [bool(column[1:]) and all(_looks_numeric(cell) for cell in column[1:]) for column in columns]

    def line(row: Sequence[str]) -> str:
        padded = (
            cell.rjust(width) if right else cell.ljust(width)
            for cell, width, right in zip(row, widths, numeric, strict=True)
        )
        return "  ".join(padded).rstrip()

    return "\n".join([line(header), line(["-" * width for width in widths]), *map(line, cells)])


def _looks_numeric(cell: str) -> bool:
    return cell in {"", "-"} or cell.lstrip("+-±").replace("%", "").strip()[:1].isdigit()


def print_table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print `format_table`."""
    click.echo(format_table(header, rows))
