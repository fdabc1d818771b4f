"""What `identify` prepares and prints: numbers and ranges, even grids, tables of methods, poles and sweeps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import click

from idloop.cli._assessment import percent
from idloop.cli._common import number, print_table
from idloop.errors import InputError
from idloop.spelling import did_you_mean, listed

if TYPE_CHECKING:
    from idloop.estimate.information import Information
    from idloop.estimate.method import Identified
    from idloop.estimate.sampled import SampledData
    from idloop.records import Record
    from idloop.report.identification import Drawn, SweepLine
    from idloop.validate.score import Score

_MOST_VALUES = 200  # of a range: more are a slip of the pen

_AWAY = -999.0  # FIT [%]
_AT_ZERO = 1e-12
_EDGE = 1e-3  # a pole this close to the unit circle is as good as on it

# Settings that a sweep may go over, and their units.
SWEPT: dict[str, str | None] = {"order": None, "delay": "samples", "horizon": "samples", "sample-time": "s"}


@dataclass(frozen=True, eq=False)
class Outcome:
    """What one method came to.

    Attributes
    ----------
    label : str
    found : Identified or None
        None where it failed.
    score : Score or None
        None for responses and failures.
    information : Information or None
    error : str
    """

    label: str
    found: Identified | None = None
    score: Score | None = None
    information: Information | None = None
    error: str = ""

    @property
    def states(self) -> int | None:
        """Number of states of a linear model."""
        linear = None if self.found is None else self.found.linear
        return None if linear is None else linear.order

    @property
    def largest_pole(self) -> float | None:
        """Size of a linear model's largest pole; None for others."""
        linear = None if self.found is None else self.found.linear
        return None if linear is None else float(max(abs(linear.poles), default=0.0))

    @property
    def stable(self) -> bool | None:
        """Whether a linear model's poles lie inside the unit circle; None for others."""
        return None if self.largest_pole is None else self.largest_pole < 1.0

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        document: dict[str, Any] = {"label": self.label, "error": self.error or None}
        if self.found is not None:
            document |= self.found.to_dict()
        if self.score is not None:
            document |= self.score.to_dict()
        return document | self.measures()

    def measures(self) -> dict[str, Any]:
        """States, stability and criteria."""
        known = self.information
        return {
            "states": self.states,
            "stable": self.stable,
            "largest_pole": self.largest_pole,
            "loss": None if known is None else known.loss,
            "fpe": None if known is None else known.fpe,
            "aic": None if known is None else known.aic,
            "bic": None if known is None else known.bic,
        }


@dataclass(frozen=True)
class Sweep:
    """One setting and the values that it takes.

    Attributes
    ----------
    name : str
        One of `SWEPT`.
    values : tuple of float
        Whole numbers but for the sample time.
    """

    name: str
    values: tuple[float, ...]


# ---------------------------------------------------------------- words of the command line


class NumbersArgument(click.ParamType[Any]):
    """A whole number, a range such as 1:8, a list such as 1,2,4, or auto."""

    name = "numbers"

    def __init__(self, least: int) -> None:
        self.least = least

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return an int, a tuple of int or "auto"."""
        text, option = str(value).strip(), param.opts[0] if param is not None else "numbers"
        if text == "auto":
            return text
        numbers = tuple(map(int, parse_values(text, option, whole=True, least=self.least)))
        return numbers[0] if len(numbers) == 1 else numbers


def parse_values(text: str, option: str, *, whole: bool, least: float) -> tuple[float, ...]:
    """Numbers of "4", "1:8", "0.01:0.05:0.01" or "1,2,4".

    Raises
    ------
    InputError
        No numbers, too many, or numbers below `least`.
    """
    kind: type[int | float] = int if whole else float
    example = "3, 1:8 or 1,2,4" if whole else "0.01,0.02 or 0.01:0.05:0.01"
    try:
        ranges = [[kind(word) for word in part.split(":")] for part in text.split(",")]
    except ValueError:
        ranges = [[]]
    values: list[float] = []
    for limits in ranges:
        spread = _spread(limits, whole=whole)
        if not spread:
            raise InputError(f"{option} {text}: write {example}")
        values += spread
    if not all(math.isfinite(value) and value >= least for value in values):
        raise InputError(f"{option} {text}: the least value is {least:g}")
    return tuple(values)


def _spread(limits: list[float], *, whole: bool) -> list[float]:
    """Numbers of one part, none where it is no range."""
    if len(limits) == 1:
        return limits
    # Between two times every step is possible: it has to be said.
    if len(limits) not in {2, 3} or (len(limits) == 2 and not whole) or not all(map(math.isfinite, limits)):
        return []
    first, last, step = limits if len(limits) == 3 else (*limits, 1)
    count = math.floor((last - first) / step * (1 + 1e-9)) + 1 if step else 0
    return [first + index * step for index in range(count)] if count <= _MOST_VALUES else []


def parse_sweep(text: str) -> Sweep:
    """Setting and values of "order=1:10".

    Raises
    ------
    InputError
        Another setting, or no values.
    """
    name, equals, values = text.partition("=")
    name = name.strip().replace("_", "-")
    if not equals or name not in SWEPT:
        near = did_you_mean(name, SWEPT)
        raise InputError(f"--sweep {text}: write NAME=VALUES{near}, NAME one of {listed(SWEPT)}")
    whole = name != "sample-time"
    least = {"order": 1, "delay": 0, "horizon": 2, "sample-time": 1e-9}[name]
    return Sweep(name, parse_values(values.strip(), f"--sweep {name}", whole=whole, least=least))


def parse_structure(text: str | None) -> dict[str, int]:
    """Degrees of "na=2,nb=1".

    Raises
    ------
    InputError
        Another name than of a polynomial, or no whole number.
    """
    degrees: dict[str, int] = {}
    for part in (text or "").split(",") if text else ():
        name, _, value = part.partition("=")
        name = name.strip()
        if name not in {"na", "nb", "nc", "nd", "nf"} or not value.strip().isdigit():
            raise InputError(f"--structure {text}: write NAME=NUMBER,..., NAME one of na, nb, nc, nd, nf")
        degrees[name] = int(value)
    return degrees


# ---------------------------------------------------------------- data


def even_grids(
    records: Sequence[Record], sample_time: float, detrend: Literal["none", "mean", "linear"], drop: float
) -> list[SampledData]:
    """Records cut, freed of their trends and put on one even grid.

    Parameters
    ----------
    records : sequence of Record
    sample_time : float
        [s]
    detrend : "none", "mean" or "linear"
        Of each record by itself.
    drop : float
        Seconds left out at both ends.
    """
    from idloop.estimate.sampled import sampled

    stretches: list[SampledData] = []
    for record in records:
        kept = record.drop(drop, drop) if drop else record
        level = kept if detrend == "none" else kept.detrend(detrend)
        stretches += sampled(level, sample_time)
    return stretches


# ---------------------------------------------------------------- tables


def print_methods() -> None:
    """Print every method with what it is for."""
    from idloop.estimate.methods import METHODS

    print_table(
        ["method", "what for", "loop", "source"],
        [(name, method.summary, method.loop, method.source) for name, method in METHODS.items()],
    )


def print_outcomes(outcomes: Sequence[Outcome], steps: int) -> None:
    """Print one line for each method and output; what belongs to the method is said once."""
    rows = []
    for one in outcomes:
        if one.score is None:
            continue
        known = one.information
        said = [number(None if known is None else getattr(known, name)) for name in ("loss", "fpe", "aic", "bic")]
        for index, name in enumerate(one.score.output_names):
            first = index == 0
            rows.append(
                (
                    one.label if first else "",
                    _text(one.states) if first else "",
                    _text(None if one.found is None else one.found.delay) if first else "",
                    name,
                    fit_text(float(one.score.free_run[index])),
                    fit_text(float(one.score.ahead[index])),
                    *(said if first else [""] * len(said)),
                    _stability(one) if first else "",
                )
            )
    if rows:
        header = ("method", "states", "delay", "output", "FIT % free run", f"FIT % {steps} ahead")
        print_table([*header, "loss", "FPE", "AIC", "BIC", "stable"], rows)


def print_responses(outcomes: Sequence[Outcome]) -> None:
    """Print what each frequency or impulse response covers."""
    rows = []
    for one in outcomes:
        if one.found is None or one.found.predicts:
            continue
        model: Any = one.found.model
        impulse = hasattr(model, "lag")
        for column, name in enumerate(model.output_names):
            if impulse:
                size, at = abs(model.response[:, column]), model.time
                row = (f"{at[0]:.4g} to {at[-1]:.4g} s", f"{number(at[size.argmax()])} s", "-")
            else:
                size, at = abs(model.response[:, column, 0]), model.frequency
                heard = None if model.coherence is None else sorted(model.coherence[:, column])[len(at) // 2]
                row = (f"{at[0]:.4g} to {at[-1]:.4g} Hz", f"{number(at[size.argmax()])} Hz", number(heard))
            rows.append((one.label, name, str(len(at)), row[0], number(float(size.max())), row[1], row[2]))
    if rows:
        print_table(["method", "output", "points", "range", "largest", "at", "median coherence"], rows)


def print_details(one: Outcome) -> None:
    """Print poles and, where they have a meaning of their own, coefficients of a single linear model."""
    model = None if one.found is None else one.found.linear
    if model is None:
        return
    click.echo()
    poles = sorted(model.poles, key=lambda p: (-abs(p), -p.imag))
    # A delay is a row of poles at zero.
    moving = [pole for pole in poles if abs(pole) > _AT_ZERO]
    rows = [pole_row(pole, model.sample_time) for pole in moving]
    if len(moving) < len(poles):
        rows.append((f"0 ({len(poles) - len(moving)} times)", "0", "-", "-", "-"))
    print_table(["pole", "|z|", "natural frequency Hz", "damping", "time constant s"], rows)
    if model.coefficients:
        click.echo()
        print_table(
            ["coefficient", "value", "standard error"],
            [(c.name, number(c.value, 6), number(c.stderr, 3)) for c in model.coefficients],
        )


def pole_row(pole: complex, sample_time: float) -> tuple[str, ...]:
    """Pole, its size, and frequency [Hz], damping and time constant [s] of the continuous pole of same samples."""
    import cmath

    text = f"{pole.real:.6g}" + (f"{pole.imag:+.6g}j" if pole.imag else "")
    s = cmath.log(pole) / sample_time
    natural = abs(s)
    damping = -s.real / natural if natural > 0 else math.nan
    return (
        text,
        f"{abs(pole):.6f}",
        number(natural / (2 * math.pi)),
        number(damping),
        number(1.0 / abs(s.real) if s.real else math.inf),
    )


def print_verdicts(outcomes: Sequence[Outcome]) -> None:
    """Print what was chosen, what a user should know of it, and what the one-step errors still hold."""
    for one in outcomes:
        if one.error:
            click.echo(f"{one.label}: failed: {one.error}")
        if one.found is None:
            continue
        tried = len(one.found.trials)
        if tried:
            delay = "" if one.found.delay is None else f", delay {one.found.delay}"
            click.echo(f"{one.label}: order {one.found.order}{delay}: the least BIC of {tried} tried")
        for note in one.found.model.notes:
            click.echo(f"{one.label}: {note}")
        for test in one.score.tests if one.score is not None else ():
            white = "white" if test.white else "not white"
            free = "free of the input" if test.input_free else "still follows the input"
            click.echo(
                f"{one.label}: residual of {test.name} is {white} (Ljung-Box p {test.ljung_box_p:.2g})"
                f" and {free} (p {test.cross_p:.2g})"
            )


def print_sweep(sweep: Sweep, rows: Sequence[tuple[float, Outcome]], steps: int) -> None:
    """Print one line for each value and method, then the best value of each method."""
    table = []
    for value, one in rows:
        known = one.information
        table.append(
            (
                number(value, 6),
                one.label,
                _text(one.states),
                fit_text(mean(one, "free_run")),
                fit_text(mean(one, "ahead")),
                *(number(None if known is None else getattr(known, name)) for name in ("loss", "fpe", "aic", "bic")),
                _stability(one),
                one.error,
            )
        )
    header = (sweep.name, "method", "states", "mean FIT % free run", f"mean FIT % {steps} ahead")
    failed = any(row[-1] for row in table)
    every = [*header, "loss", "FPE", "AIC", "BIC", "stable", *(["failed"] if failed else [])]
    print_table(every, table if failed else [row[:-1] for row in table])
    click.echo()
    for label, value in best_values(rows).items():
        fit = next(mean(one, "free_run") for at, one in rows if one.label == label and at == value)
        click.echo(f"{label}: best free run at {sweep.name} {value:g}: mean FIT {percent(fit)} %")


def best_values(rows: Sequence[tuple[float, Outcome]]) -> dict[str, float]:
    """Value of the best free run by method, the smaller of equals."""
    best: dict[str, tuple[float, float]] = {}
    for value, one in rows:
        fit = mean(one, "free_run")
        if math.isfinite(fit) and (one.label not in best or fit > best[one.label][0]):
            best[one.label] = (fit, value)
    return {label: value for label, (_, value) in best.items()}


def mean(one: Outcome, measure: Literal["free_run", "ahead"]) -> float:
    """Mean FIT over the outputs [%]; NaN where there is no model, minus infinity where it runs away."""
    return math.nan if one.score is None else float(getattr(one.score, measure).mean())


def sweep_lines(rows: Sequence[tuple[float, Outcome]]) -> list[SweepLine]:
    """Curves of the sweep's figure."""
    import numpy as np

    from idloop.report.identification import SweepLine

    lines = []
    for label in dict.fromkeys(one.label for _, one in rows):
        own = [(value, one) for value, one in rows if one.label == label and one.score is not None]
        columns = ([v for v, _ in own], [mean(o, "free_run") for _, o in own], [mean(o, "ahead") for _, o in own])
        lines.append(SweepLine(label, *(np.array(column, dtype=float) for column in columns)))
    return lines


def drawn(outcomes: Sequence[Outcome]) -> list[Drawn]:
    """Results of the comparison figure."""
    from idloop.report.identification import Drawn

    return [Drawn(one.label, one.found, one.score) for one in outcomes if one.found is not None]


def check_save(path: Path, kinds: Sequence[str], *, swept: bool) -> None:
    """Refuse a result that is no model, or a format that it does not have, before the work is done.

    Raises
    ------
    InputError
    """
    from idloop.estimate import linear, networks

    if swept or len(kinds) != 1:
        raise InputError(f"--save {path}: it takes one model; give one --method and no --sweep")
    if kinds[0] == "response":
        raise InputError(
            f"--save {path}: the method gives a response and no model; idloop identify --list shows which do"
        )
    file = networks.model_file if kinds[0] == "network" else linear.model_file
    file.check_suffix(path)


def save_model(model: Any, path: Path) -> None:
    """Write a linear model or a network."""
    from idloop.estimate import linear, networks

    if isinstance(model, networks.NarxModel):
        networks.save(model, path)
    else:
        linear.save(model, path)


def _text(value: int | None) -> str:
    return "-" if value is None else str(value)


def fit_text(fit: float) -> str:
    """Text of a FIT; of a model that runs away no digit means anything."""
    return percent(fit) if not fit < _AWAY else f"{_AWAY:.0f} or less"


def _stability(one: Outcome) -> str:
    if one.largest_pole is None:
        return "-"
    # An integrator's pole is found a little inside or outside the circle.
    return "edge" if abs(one.largest_pole - 1.0) < _EDGE else "yes" if one.stable else "NO"
