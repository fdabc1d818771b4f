"""Error analysis: the error of every output and of the drive force, along the variables that may explain it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from idloop.arrays import Array
from idloop.validation.breakdown import Breakdown
from idloop.validation.error_choice import MEASURES, choose_basis
from idloop.validation.operating_state import OperatingState, operating_state
from idloop.validation.runs import Runs
from idloop.validation.stretch import Stretch, worst_stretches
from idloop.validation.variables import TITLES, break_down_all
from idloop.validation.words import beside, force_text, percent, short

DRIVE_FORCE = "drive force"
NOISE_ALONE = "sensor noise may be all of it"

# Fewest samples for a breakdown.
_FEWEST = 50
# Printed: functions of one variable with this coefficient of determination, and at most so many stretches.
_FOLLOWS, _MOST_STRETCHES = 0.25, 3
# An error between these multiples of the stated noise is as large; one that is smaller refutes what is stated.
_NOISE = 0.7, 1.1


@dataclass(frozen=True)
class ErrorMap:
    """One error, broken down."""

    # Output such as "motor.position", or "drive force"
    name: str
    unit: str
    basis: str  # ``free_run``, ``ahead``, ``one_step``, or ``force``
    kind: str  # description of the basis
    why: str  # reason why it is not the free run, or why the drive side says nothing about the model; empty otherwise
    # shape (m,): instants [s] and measured minus modelled; on the drive side applied minus needed force
    time: Array
    error: Array
    # Mean and root mean square of the error in its unit; rms over that of the measurement about its mean, of the drive
    # side over that of the commanded force
    mean: float
    rms: float
    relative: float
    breakdowns: tuple[Breakdown, ...]  # along each variable that varies in the record
    left_out: dict[str, str]  # reason by variable that has no breakdown
    stretches: tuple[Stretch, ...]  # the worst ones, worst first

    def along(self, variable: str) -> Breakdown | None:
        """Return the breakdown along a variable; None when it was left out."""
        return next((b for b in self.breakdowns if b.variable == variable), None)

    @property
    def relative_text(self) -> str:
        """Text of `relative`: "26.3 % of the commanded force"; empty where it is not known."""
        if not np.isfinite(self.relative):
            return ""
        of, text = "commanded force" if self.basis == "force" else "measured motion", force_text(self.relative, 3, " %")
        return f"{text} of the {of}" if text.endswith("%") else f"{short(self.relative)} times the {of}"

    def lines(self) -> list[str]:
        """Return a few lines of text: notable parts, functions of one variable, worst stretches."""
        relative = f", {self.relative_text}" if self.relative_text else ""
        mean = beside(self.mean, self.rms)
        found = [f"{self.name}: {self.kind}, rms {short(self.rms)} {self.unit}{relative}, mean {mean}"]
        if self.why:
            found.append(f"  {self.why}")
        loud = sorted((b for b in self.breakdowns if b.stands_out), key=lambda b: b.worst.usual - b.worst.error)
        width = max((len(TITLES[b.variable]) for b in loud), default=0)
        for breakdown in loud:
            worst = breakdown.worst
            # The mean is printed where the error has mostly one sign.
            mean = f" (mean {short(worst.mean)} {self.unit})" if abs(worst.mean) > 0.5 * worst.rms else ""
            found.append(f"  {TITLES[breakdown.variable]:<{width}}  {worst.text}{mean}")
        even = [TITLES[b.variable] for b in self.breakdowns if not b.stands_out]
        if even:
            found.append(f"  evenly distributed along {', '.join(even)}")
        led = sorted((b for b in self.breakdowns if b.follows >= _FOLLOWS), key=lambda b: -b.follows)
        if led:
            shares = ", ".join(f"{TITLES[b.variable]} {percent(b.follows)}" for b in led)
            found.append(f"  share explained by a function of one variable: {shares}")
        found.extend(f"  worst: {stretch.line()}" for stretch in self.loud_stretches[:_MOST_STRETCHES])
        return found

    @property
    def loud_stretches(self) -> tuple[Stretch, ...]:
        """The worst stretches whose error clearly exceeds that of the rest of the record."""
        return tuple(stretch for stretch in self.stretches if stretch.stands_out)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        own = {key: getattr(self, key) for key in ("unit", "basis", "kind", "why", "mean", "rms")}
        return own | {
            "relative": self.relative if np.isfinite(self.relative) else None,
            "share": {b.variable: b.to_dict() for b in self.breakdowns},
            "left_out": dict(self.left_out),
            "worst": [stretch.to_dict() for stretch in self.stretches],
        }


@dataclass(frozen=True)
class Where:
    """Error analysis of a model on one record."""

    model: str
    record: str
    maps: tuple[ErrorMap, ...]  # the drive force first where it can be compared, then the outputs

    @property
    def measures(self) -> dict[str, str]:
        """Error of each output that was broken down, as `where` takes it."""
        return {one.name: one.basis for one in self.maps if one.basis in MEASURES}

    def __getitem__(self, name: str) -> ErrorMap:
        """Return the map of an output or of the ``drive force``."""
        for one in self.maps:
            if one.name == name:
                return one
        raise KeyError(name)

    def lines(self) -> list[str]:
        """Return the text for a terminal, a few lines for each error."""
        return [line for one in self.maps for line in one.lines()]

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON: by output and ``drive force``."""
        return {one.name: one.to_dict() for one in self.maps}


def where(runs: Runs, measures: Mapping[str, str] | None = None) -> Where:
    """Break the errors of a model down by all variables.

    `measures`: by output the error to break down (``free_run``, ``ahead``, ``one_step``), that of the models that this
    one is compared with; the one that suits where there is none.
    """
    maps = []
    force = _force_map(runs)
    if force is not None:
        maps.append(force)
    states: dict[str, OperatingState] = {}
    for column, output in enumerate(runs.model.outputs):
        if output.body not in states:
            states[output.body] = operating_state(runs.model, runs.data, output.body)
        basis = choose_basis(runs, column, (measures or {}).get(output.name, ""))
        known = np.isfinite(basis.error)
        if np.sum(known) < _FEWEST:
            continue
        measured = runs.measured[known, column]
        state = states[output.body] if np.all(known) else states[output.body].at(runs.time[known])
        why = basis.why or _noise_alone(basis.error[known], output.noise)
        named = (output.name, output.unit, basis.name, basis.kind, why)
        maps.append(_map(named, basis.error[known], measured, state, float(np.std(measured)), runs.record.start_ns))
    return Where(runs.model.name, runs.record.name, tuple(maps))


def _noise_alone(error: Array, noise: float | None) -> str:
    """Say that an error is as large as the noise that the model file states for the sensor; empty where it is not."""
    low, high = _NOISE
    return NOISE_ALONE if noise and low * noise <= np.sqrt(np.mean(error**2)) <= high * noise else ""


def _force_map(runs: Runs) -> ErrorMap | None:
    force = runs.force
    if force is None or len(force.time) < _FEWEST:
        return None
    model = runs.model
    state = operating_state(model, runs.data, model.bodies[0]).at(force.time, force.command)
    size = float(np.sqrt(np.mean(force.commanded**2)))
    # The noise that the model file states may be all of it where it is small as well.
    why = "" if force.trusted else f"sensor noise alone makes {force_text(force.noise, 3, ' %')} of the commanded force"
    why = NOISE_ALONE if force.noise >= force.relative else why
    named = (DRIVE_FORCE, model.units.force, "force", "applied minus needed", why)
    return _map(named, force.applied - force.required, force.applied, state, size, runs.record.start_ns)


def _map(
    named: tuple[str, str, str, str, str],
    error: Array,
    signal: Array,
    state: OperatingState,
    size: float,
    start_ns: int,
) -> ErrorMap:
    breakdowns, left_out = break_down_all(error, signal, state)
    rms = float(np.sqrt(np.mean(error**2)))
    return ErrorMap(
        *named,
        time=state.time,
        error=error,
        mean=float(np.mean(error)),
        rms=rms,
        relative=rms / size if size > 0.0 else np.nan,
        breakdowns=breakdowns,
        left_out=left_out,
        stretches=worst_stretches(error, state, start_ns),
    )
