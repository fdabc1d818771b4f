"""Measured conditions of an experiment, such as a temperature or the supply, that effects depend on."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from idloop.arrays import Array
from idloop.errors import InputError
from idloop.spelling import did_you_mean, listed

# Site and condition of an effect that depends on it.
Wanted = tuple[str, str]
# Tolerance of the median interval of the samples for rounding.
_ONE_INTERVAL = 1.0 + 1e-6


@dataclass(frozen=True, eq=False)
class Condition:
    """One measured condition: linear between its samples, constant before the first and after the last.

    Raises InputError: no samples, stamps that do not increase, or values that are not finite.
    """

    name: str  # such as ``temperature`` or ``supply``, or of one site: ``motor.temperature``
    unit: str  # such as ``°C`` or ``V``
    # shape (m,): stamps [s], strictly increasing, and values
    time: Array
    value: Array

    def __post_init__(self) -> None:
        where = f"condition {self.name!r}"
        if self.time.ndim != 1 or self.time.shape != self.value.shape or not self.time.size:
            raise InputError(
                f"{where}: time {self.time.shape} and value {self.value.shape} must be of one length, at least 1"
            )
        if not (np.all(np.isfinite(self.time)) and np.all(np.isfinite(self.value))):
            raise InputError(f"{where}: a time or a value is not finite; leave such samples out")
        if np.any(np.diff(self.time) <= 0.0):
            raise InputError(f"{where}: time does not increase strictly; sort the samples and drop repeated stamps")

    def at(self, time: Array) -> Array:
        """Value at each instant (k,) -> (k,)."""
        return np.interp(time, self.time, self.value)

    def cut(self, low: float, high: float) -> Condition:
        """Samples in low <= time <= high [s], with one before and one after."""
        first = max(int(np.searchsorted(self.time, low, side="right")) - 1, 0)
        last = int(np.searchsorted(self.time, high, side="left")) + 1
        part = slice(min(first, self.time.size - 1), max(last, first + 1))
        return replace(self, time=self.time[part], value=self.value[part])


def condition_name(wanted: Wanted, names: Collection[str]) -> str:
    """Name of the condition for an effect: that of its site where it was recorded, otherwise the general one."""
    at, name = wanted
    return f"{at}.{name}" if f"{at}.{name}" in names else name


class Conditions:
    """The conditions of one experiment, as the compiled simulator reads them. Raises InputError: two of one name."""

    def __init__(self, conditions: Iterable[Condition]) -> None:
        several = list(conditions)
        self._by_name = {one.name: one for one in several}
        if len(self._by_name) < len(several):
            raise InputError(f"conditions {listed(one.name for one in several)}: name each once")
        # Piecewise linear functions stay so on the union of their samples.
        self.time = np.unique(np.concatenate([one.time for one in several])) if several else np.zeros(0)
        self._tables: dict[tuple[Wanted, ...], Array] = {}

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the conditions."""
        return tuple(self._by_name)

    @property
    def units(self) -> dict[str, str]:
        """Units by name."""
        return {name: one.unit for name, one in self._by_name.items()}

    def __getitem__(self, name: str) -> Condition:
        """One condition by name. Raises InputError: there is none of this name."""
        if name not in self._by_name:
            raise InputError(f"no condition {name!r}; there are {listed(self.names)}{did_you_mean(name, self.names)}")
        return self._by_name[name]

    def interval(self, wanted: Sequence[Wanted]) -> float:
        """Time over which the wanted conditions may be taken as constant: between two samples [s]."""
        times = [self[condition_name(one, self._by_name)].time for one in wanted]
        return min((float(np.median(np.diff(t))) * _ONE_INTERVAL for t in times if t.size > 1), default=np.inf)

    def table(self, wanted: Sequence[Wanted]) -> Array:
        """Values at `time`, one column for each wanted condition. Raises InputError: a condition is missing."""
        key = tuple(wanted)
        if key not in self._tables:
            columns = [self[condition_name(one, self._by_name)].at(self.time) for one in key]
            self._tables[key] = np.ascontiguousarray(np.column_stack(columns))
        return self._tables[key]

    def sampled(self, time: Array, stamps: Array | None = None) -> Conditions:
        """The conditions at some instants (k,) [s], with other stamps where given."""
        when = time if stamps is None else stamps
        return Conditions(replace(one, time=when, value=one.at(time)) for one in self._by_name.values())

    @classmethod
    def joined(cls, parts: Sequence[Conditions]) -> Conditions:
        """Conditions one after the other, of those names that all parts have."""
        names = [name for name in parts[0].names if all(name in part.names for part in parts)]
        each = {name: [part[name] for part in parts] for name in names}
        times = {name: np.concatenate([one.time for one in several]) for name, several in each.items()}
        values = {name: np.concatenate([one.value for one in several]) for name, several in each.items()}
        return cls(replace(each[name][0], time=times[name], value=values[name]) for name in names)
