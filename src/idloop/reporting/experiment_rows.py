"""A suggested experiment as curves: what is sent in, what each rival would show, and by how much they differ.

What the printed and the interactive figure draw alike.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from idloop import drawing
from idloop.arrays import Array
from idloop.reporting.estimates import NORMAL_95
from idloop.reporting.terms import in_words

if TYPE_CHECKING:
    from idloop.diagnosis.design.suggest import Suggestion
    from idloop.physics import Model
    from idloop.records import Record


# A limit is drawn where the view need not grow by more than this share of what it shows, at either end.
_NEAR = {"sent": 2.0, "output": 0.5}
_DEVIATIONS = NORMAL_95


@dataclass(frozen=True)
class Curve:
    """A line."""

    # shape (n,): instants [s] and values
    time: Array
    value: Array
    rival: int | None = None  # whose it is; None for what is sent in
    held: bool = False  # whether each value is held to the next instant


@dataclass(frozen=True)
class Row:
    """A row of the figure."""

    kind: str
    label: str  # of its axis
    curves: list[Curve]
    limits: tuple[float, ...] = ()  # those that are drawn
    bounds: tuple[float, ...] = ()  # all of them
    band: float | None = None  # half width of the band of the noise
    # Legend: what it says, and for what: "limit", "band", or the number of a rival
    entries: list[tuple[str, str]] = field(default_factory=list)


def rows_of(suggestion: Suggestion) -> list[Row]:
    """Simulate the experiment with every rival; rows from top to bottom."""
    experiment = suggestion.experiment
    records = [experiment.run(model) for _, model in suggestion.rivals]
    return [*_sent(suggestion, records), *_outputs(suggestion, records)]


def rival_name(suggestion: Suggestion, index: int, *, first: bool = True) -> str:
    """A rival, by how much it leads if it is right, and where `first` whether the differences are from it."""
    from idloop.diagnosis.design.expected_outcome import lead_text

    label, lead = in_words(suggestion.rivals[index][0]), suggestion.outcomes[index].in_favour
    notes = [f"leads by {lead_text(lead)} if right"] if lead >= 1.0 else []
    notes += ["differences are from it"] if first and index == 0 else []
    return f"{label} ({'; '.join(notes)})" if notes else label


def _sent(suggestion: Suggestion, records: list[Record]) -> list[Row]:
    """What is sent in, and in a closed loop the command that each rival then gets."""
    model, limits = suggestion.rivals[0][1], suggestion.limits
    most: tuple[float, ...] = () if limits.command is None else (-limits.command, limits.command)
    signal, unit = suggestion.experiment.built, sent_unit(suggestion)
    reference, name, value, own = records[0].reference, "excitation", signal.value, most
    if reference is not None:
        name, value, own = "reference", reference[:, 0], _scaled(limits.position, _followed(suggestion)[1])
    elif suggestion.controller is None:
        name = model.input.name
    else:
        own = ()
    row = Row("sent", drawing.label(name, unit), [Curve(signal.time, value, held=True)])
    rows = [_limited(row, own, unit)]
    if suggestion.controller is not None:
        curves = [Curve(r.input_time, r.input, i, held=True) for i, r in enumerate(records)]
        row = Row("sent", drawing.label(model.input.name, model.input.unit), curves)
        rows += [_limited(row, most, model.input.unit), _differences(curves, model.input.unit)]
    return rows


def _outputs(suggestion: Suggestion, records: list[Record]) -> list[Row]:
    """For each output the rivals, and their differences from the first."""
    model, limits = suggestion.rivals[0][1], suggestion.limits
    rows = []
    for column, output in enumerate(model.outputs):
        curves = [Curve(r.time, r.output[:, column], i) for i, r in enumerate(records)]
        row = Row("output", drawing.label(output.name, output.unit), curves)
        own: tuple[float, ...] = ()
        if output.field == "position":
            own = _scaled(limits.position, output.scale)
        elif output.field == "velocity" and limits.velocity is not None:
            own = _scaled((-limits.velocity, limits.velocity), output.scale)
        rows.append(_limited(row, own, output.unit))
        rows.append(_differences(curves, output.unit, _DEVIATIONS * suggestion.noise[column]))
    return rows


def _differences(curves: list[Curve], unit: str, band: float | None = None) -> Row:
    """How far the rivals are from the first one."""
    apart = [replace(curve, value=curve.value - curves[0].value) for curve in curves]
    sizes = [float(np.sqrt(np.mean(curve.value**2))) for curve in apart]
    entries = [(f"RMS {_with_unit(size, unit)}", str(index)) for index, size in enumerate(sizes) if index]
    if band is not None:
        entries.append((f"95 % of the noise (±{_with_unit(band, unit)})", "band"))
    return Row("difference", drawing.label("difference", unit), apart, band=band, entries=entries)


def _with_unit(value: float, unit: str) -> str:
    return f"{value:.2g} {unit}".rstrip()


def _limited(row: Row, limits: tuple[float, ...], unit: str) -> Row:
    """A row with the limits that lie near what it shows; a far one is named only."""
    if not limits:
        return row
    low, high = reach(row.curves)
    room = _NEAR[row.kind] * max(high - low, 1e-12)
    near = tuple(limit for limit in limits if low - room <= limit <= high + room)
    text = _range_text(limits, unit) + ("" if near else ", beyond this view")
    return replace(row, limits=near, bounds=limits, entries=[(text, "limit")])


def _followed(suggestion: Suggestion) -> tuple[str, float]:
    """Unit and scale of the position that the controller follows."""
    from idloop.control import build_controller

    model: Model = suggestion.rivals[0][1]
    reads = build_controller(suggestion.controller).inputs
    followed = [output for output in model.outputs if output.name in reads and output.field == "position"]
    return (followed[0].unit, followed[0].scale) if followed else (model.units.position, 1.0)


def sent_unit(suggestion: Suggestion) -> str:
    """Unit of what is sent in."""
    return _followed(suggestion)[0] if suggestion.adds_to == "reference" else suggestion.rivals[0][1].input.unit


def _scaled(limits: tuple[float, float] | None, scale: float) -> tuple[float, ...]:
    """Limits of a body in the unit of a sensor, the lower first."""
    return () if limits is None else tuple(sorted(limit * scale for limit in limits))


def _range_text(limits: tuple[float, ...], unit: str) -> str:
    # Three digits of the larger one; adding zero leaves no sign to a zero.
    places = 2 - int(np.floor(np.log10(max(map(abs, limits)))))
    low, high = (round(limit, places) + 0.0 for limit in limits)
    text = f"±{high:g}" if low == -high else f"{low:g} .. {high:g}".replace("-", "−")
    return f"limit {text} {unit}".rstrip()


def reach(curves: list[Curve], stretch: tuple[float, float] | None = None) -> tuple[float, float]:
    """Least and largest value of some curves, in a stretch of time."""
    low, high = stretch or (-np.inf, np.inf)
    values = np.concatenate([one.value[(one.time >= low) & (one.time <= high)] for one in curves])
    values = values[np.isfinite(values)]
    return (float(np.min(values)), float(np.max(values))) if values.size else (0.0, 0.0)
