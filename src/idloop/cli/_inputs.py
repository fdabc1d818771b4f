"""What the verbs take: arguments, the options that they share, and the models and records that these name."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from idloop.api.data import existing_bag
from idloop.cli._command_line import kept, kept_option, together
from idloop.cli._outputs import log
from idloop.cli._progress import progress
from idloop.errors import InputError
from idloop.spelling import listed

if TYPE_CHECKING:
    from idloop.api.inspection import BagGrade
    from idloop.diagnosis.design.suggest import Limits
    from idloop.physics import Model
    from idloop.records import Record
    from idloop.records.align import ModelSignals

CRITERIA = ("auto", "prediction", "simulation", "force")
_MOST_LISTED = 6  # effects in a message
_MOST_ALIKE = 3  # records of which each is named in what was noticed
_DIGITS = re.compile(r"\d+(?:\.\d+)?(?:e[+-]?\d+)?")


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
        return existing_bag(value)


class ListOptionCommand(click.Command):
    """A command whose repeatable options also take several values at once, up to the next option: see `lists`."""

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


def lists(*options: str) -> type[ListOptionCommand]:
    """Class of a command whose `options` take several values at once: `--validate A B C`."""
    return type("ListOptionCommand", (ListOptionCommand,), {"list_options": options})


MODEL = ModelArgument()
BAG = BagArgument()
POSITIVE = click.FloatRange(min=0.0, min_open=True)

model_argument = click.argument("model", type=MODEL, metavar="MODEL")
bags_argument = click.argument("bags", type=BAG, nargs=-1, required=True, metavar="BAG...")


# ---------------------------------------------------------------- options

option = partial(click.option, show_default=True)


validate_option = click.option(
    "--validate", type=BAG, multiple=True, metavar="BAG...", help="Bags that the fits do not see."
)
seed_option = option("--seed", type=click.IntRange(min=0), default=0, help="Equal seeds give equal answers.")
domain_option = click.option(
    "--domain", type=click.IntRange(0, 232), help="ROS domain of this graph alone (ROS_DOMAIN_ID)."
)
criterion_option = option(
    "--criterion",
    type=click.Choice(CRITERIA),
    default="auto",
    help="What models are measured by: one-step errors, free-run errors or the unexplained drive force.",
)
# Eager: read before any model, whatever its place.
trust_option = kept_option(
    "--trust-effects",
    is_flag=True,
    is_eager=True,
    help="Run the Python files in `effects` beside a MODEL this once; see idloop trust.",
)
# For `with_options`.
model_options = together(
    kept_option(
        "--set",
        "settings",
        multiple=True,
        metavar="NAME=VALUE",
        help="Change a parameter of the model, as in --set motor.inertia=0.5. May be repeated.",
    ),
    kept_option(
        "--effect",
        "effects",
        multiple=True,
        metavar="NAME@SITE[(PARAMETER=VALUE,...)]",
        help="Add an effect to the model, as in --effect 'dead_zone@input(width=0.1)'. May be repeated.",
    ),
    kept_option(
        "--joint",
        multiple=True,
        metavar="NAME=IN_BAG",
        help="Joint of the model that has another name in the bags, as in --joint axis=elbow_joint. May be repeated.",
    ),
    trust_option,
)
# For `search_options`.
diagnosis_options = together(
    option(
        "--level",
        type=click.FloatRange(0.0, 0.5, min_open=True, max_open=True),
        default=0.01,
        help="How often an effect may be named where none is missing, over the whole catalogue.",
    ),
    click.option(
        "--effects",
        "only",
        multiple=True,
        metavar="NAME[@SITE]...",
        help="Choose from these effects only; the whole catalogue when left out.",
    ),
    criterion_option,
    option(
        "--minimum-improvement",
        type=click.FloatRange(0.0, 100.0, max_open=True),
        default=1.0,
        metavar="PERCENT",
        help="An effect that makes the errors on unseen samples smaller by less is listed, not added.",
    ),
    seed_option,
)
# Of an experiment, for `limits_of`.
limit_options = together(
    click.option("--max-command", type=float, metavar="VALUE", help="Largest command [input unit]."),
    click.option("--position-range", type=(float, float), metavar="LOW HIGH", help="Range of the position."),
    click.option("--max-velocity", type=float, metavar="VALUE", help="Largest velocity."),
    click.option("--duration", type=POSITIVE, metavar="SECONDS", help="Its length."),
)


def search_options(options: dict[str, Any]) -> dict[str, Any]:
    """Take the values of `diagnosis_options` out of those of a verb, as `idloop.diagnose` names them."""
    found = {name: options.pop(name) for name in ("level", "criterion", "seed")}
    improvement = 0.01 * options.pop("minimum_improvement")
    return {**found, "effects": options.pop("only") or None, "minimum_improvement": improvement}


def limits_of(options: dict[str, Any]) -> Limits:
    """Take limits out of the options of a verb; what is not given is the largest seen in the data."""
    from idloop.diagnosis.design.suggest import Limits

    return Limits(*(options.pop(name) for name in ("max_command", "position_range", "max_velocity")))


# ---------------------------------------------------------------- models


def open_model(source: str) -> Model:
    """Load a model that the command line names.

    Raises InputError: as `load_model`; effect files beside it that are not trusted, without `--trust-effects`.
    """
    from idloop.physics import load_model

    return load_model(source, allow_effects=bool(kept("trust_effects")))


def with_options(model: Model) -> Model:
    """Model with the joints of `--joint` renamed, the effects of `--effect` added, and the values of `--set`."""
    joints, effects, settings = (kept(name) or () for name in ("joint", "effects", "settings"))
    if joints:
        from idloop.physics.model_file import with_joints

        pairs = [text.partition("=")[::2] for text in joints]
        wrong = next((text for text, pair in zip(joints, pairs, strict=True) if not all(pair)), None)
        if wrong is not None:
            raise InputError(f"--joint {wrong}: write NAME=IN_BAG, as in --joint axis=elbow_joint")
        model = with_joints(model, dict(pairs))
    if effects:
        model = model.with_effects([effect_text(text, model) for text in effects])
    return model.with_values(dict(map(parse_setting, settings))) if settings else model


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


def effect_text(text: str, model: Model) -> str:
    """Return an effect as `Model.with_effects` takes it, with `dead zone` written as `dead_zone`.

    Raises InputError: there is no site; the message has those of the model where the effect acts.
    """
    name, at, rest = text.partition("@")
    name = re.sub(r"[\s\-]+", "_", name.strip())
    if at:
        return f"{name}@{rest}"
    from idloop.physics.effect import catalogue, unknown_effect

    known = catalogue()
    word = name.partition("(")[0].lower()
    meant = [word] if word in known else [one for one, several in known.items() if word in several[0].also_called]
    if not meant:
        raise unknown_effect(word, known)
    places = [f"{one}@{site}" for one in meant for effect in known[one] for site in model.sites(effect.site)]
    if not places:
        raise InputError(f"--effect {text}: model {model.name} has no site at which {' or '.join(meant)} acts")
    raise InputError(f"--effect {text}: give the site as well: {listed(places, _MOST_LISTED)}")


# ---------------------------------------------------------------- recordings


def read_fitted_and_unseen(
    bags: Sequence[Path], unseen: Sequence[Path], model: ModelSignals
) -> tuple[list[Record], list[Record]]:
    """Read what is fitted, and what is to judge it. Raises InputError: as `read_records`; a bag that is both."""
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

    records = read_bags(bags, model, fitted=fitted, excited=excited)
    log_warnings(records)
    return records


def log_warnings(records: Iterable[Record]) -> None:
    """Print what was noticed while records were read, once for many records in which it is the same but for numbers."""
    alike: dict[tuple[str, str, str], list[tuple[str, str]]] = {}
    for record in records:
        for finding in record.findings:
            if finding.level == "warning":
                kind = finding.kind, finding.where, _DIGITS.sub("", finding.text.replace(record.name, ""))
                alike.setdefault(kind, []).append((record.name, finding.text))
    for several in alike.values():
        shown = several if len(several) <= _MOST_ALIKE else several[:1]
        others = f" (so in {len(several) - 1} more records)" if len(shown) < len(several) else ""
        for name, text in shown:
            log(f"{name}: {text}{others}")


def log_grades(bags: Sequence[Path], model: Model, records: Iterable[Record]) -> list[BagGrade]:
    """Say in one line for each bag what an inspection finds wrong with it, beside what was noticed while reading."""
    from idloop.api.inspection import bag_grades

    with progress("inspecting the bags"):
        grades = bag_grades(bags, model)
    said = {finding.text for record in records for finding in record.findings}
    for line in filter(None, (one.line(said) for one in grades)):
        log(line)
    return grades
