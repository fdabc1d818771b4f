"""Arguments of `identify`: numbers and ranges, sweeps, degrees of a structure, where to save."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from idloop.errors import InputError
from idloop.spelling import did_you_mean, listed

if TYPE_CHECKING:
    from idloop.estimation.black_box.method import Method

_MOST_VALUES = 200  # of a range: more are a slip of the pen
# Settings that a sweep may go over, and their units.
SWEPT: dict[str, str | None] = {"order": None, "delay": "samples", "horizon": "samples", "sample-time": "s"}
MEASURED = ("amplitude", "bandwidth")  # what it may go over in the bags themselves


@dataclass(frozen=True)
class Sweep:
    """One setting and the values that it takes."""

    name: str  # one of `SWEPT` or `MEASURED`
    values: tuple[float, ...] = ()  # whole numbers but for the sample time; none of what each bag has of itself

    def unit(self, command: str) -> str | None:
        """Unit of the values; None of a number of states. `command`: unit of the command."""
        return {"amplitude": command, "bandwidth": "Hz", **SWEPT}[self.name]


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

    Raises InputError: no numbers, too many, or numbers below `least`.
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
    """Setting and values of "order=1:10"; of "amplitude" the setting alone.

    Raises InputError: another setting, or no values where there must be some.
    """
    name, equals, values = text.partition("=")
    name = name.strip().replace("_", "-")
    if name in MEASURED:
        if equals:
            raise InputError(
                f"--sweep {text}: every bag has its own {name}; write --sweep {name} and give several bags"
            )
        return Sweep(name)
    if not equals or name not in SWEPT:
        known = [*SWEPT, *MEASURED]
        near = did_you_mean(name, known)
        raise InputError(
            f"--sweep {text}: write NAME=VALUES{near}, NAME one of {listed(SWEPT)}; or {' or '.join(MEASURED)} alone,"
            " for a row of each bag"
        )
    whole = name != "sample-time"
    least = {"order": 1, "delay": 0, "horizon": 2, "sample-time": 1e-9}[name]
    return Sweep(name, parse_values(values.strip(), f"--sweep {name}", whole=whole, least=least))


def parse_structure(text: str | None) -> dict[str, int]:
    """Degrees of "na=2,nb=1". Raises InputError: another name than of a polynomial, or no whole number."""
    degrees: dict[str, int] = {}
    for part in (text or "").split(",") if text else ():
        name, _, value = part.partition("=")
        name = name.strip()
        if name not in {"na", "nb", "nc", "nd", "nf"} or not value.strip().isdigit():
            raise InputError(f"--structure {text}: write NAME=NUMBER,..., NAME one of na, nb, nc, nd, nf")
        degrees[name] = int(value)
        if name == "nb" and degrees[name] == 0:
            raise InputError(f"--structure {text}: with nb=0 the command has no effect in the model; take 1 or more")
    return degrees


def check_structure(degrees: Mapping[str, int], methods: Sequence[Method]) -> None:
    """Refuse degrees of polynomials that none of the methods has."""
    with_some = [method for method in methods if method.polynomials]
    for name in degrees if with_some else ():
        if not any(name in method.polynomials for method in with_some):
            own = "; ".join(f"{method.name} has {', '.join(method.polynomials)}" for method in with_some)
            raise InputError(f"--structure {name}={degrees[name]}: {own}; leave {name} out")


def check_save(path: Path, kinds: Sequence[str], *, swept: bool) -> None:
    """Refuse a result that is no model, or a format that it does not have, before the work is done."""
    from idloop.estimation import linear, networks

    if swept or len(kinds) != 1:
        raise InputError(f"--save {path}: it takes one model; give one --method and no --sweep")
    if kinds[0] == "response":
        raise InputError(
            f"--save {path}: the method gives a response and no model (idloop identify --list shows which do); leave it"
            " out, --json holds the response"
        )
    file = networks.model if kinds[0] == "network" else linear.model_file
    file.check_suffix(path)
