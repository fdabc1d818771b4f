"""Figures of recordings: what a bag holds, with its faults, and the signals of a foreign log as recognised."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np

from idloop import drawing
from idloop.arrays import Array
from idloop.records.inspection.excitation import power_spectrum
from idloop.records.inspection.inspection import Inspection
from idloop.records.inspection.values import bad_readings, without_bad_readings
from idloop.records.recognition.guess import Guess
from idloop.records.recognition.recognise import Recognition
from idloop.records.recognition.table_column import numbers_of
from idloop.records.tables.base_units import known_unit
from idloop.records.tables.expression import Expression

if TYPE_CHECKING:
    from matplotlib.figure import Figure


_MOST_ROWS = 6
# Narrowest mark of a faulty place, as a share of the duration.
_LEAST_WIDTH = 0.004
# Faintest line of a spectrum that is drawn, as a share of the strongest.
_FAINTEST = 1e-9
_FIELD_UNITS = {"position": "rad or m", "velocity": "rad/s or m/s", "effort": "command unit"}


def plot_recording(inspection: Inspection) -> Figure:
    """Draw the figure.

    `inspection`: from `idloop.records.inspect_bag`.
    """
    from matplotlib.figure import Figure

    signals = [(topic, name) for topic, found in inspection.signals.items() for name in found]
    marked = {fault.where for fault in inspection.faults if fault.places}
    # Those with faults are shown where there are too many.
    shown = sorted(signals, key=lambda signal: signal[1] not in marked)[:_MOST_ROWS]
    signals = [signal for signal in signals if signal in shown]
    commands = [(inspection.command_topic, name) for name in inspection.commands]
    rows = commands + signals
    start = min((int(stream.stamp_ns.min()) for stream in inspection.streams.values()), default=0)
    with drawing.styled():
        height = 2.1 * (len(rows) + 1) + 0.9
        figure = Figure(figsize=(7.5, height), layout="constrained")
        grid = figure.add_gridspec(len(rows) + 1, 2)
        first: Any = None
        for row, (topic, name) in enumerate(rows):
            axes = figure.add_subplot(grid[row, :], sharex=first)
            first = first or axes
            stream = inspection.streams[topic]
            time = (stream.stamp_ns - start) * 1e-9
            draw = drawing.steps if topic == inspection.command_topic else drawing.line
            color = drawing.COMMAND if topic == inspection.command_topic else drawing.MEASURED
            value = stream.columns()[name]
            draw(axes, time, value, color=color)
            _fit_others(axes, value)
            axes.set_ylabel(drawing.label(name, _unit(inspection, name)))
            axes.set_title(topic, loc="left")
            _mark_faults(axes, inspection, name, float(time[-1] - time[0]) if time.size else 0.0)
        if first is not None:
            figure.axes[len(rows) - 1].set_xlabel(drawing.label("time", "s"))
        _draw_spectrum(figure.add_subplot(grid[len(rows), 0]), inspection)
        _draw_intervals(figure.add_subplot(grid[len(rows), 1]), inspection)
    return figure


def _fit_others(axes: Any, value: Array) -> None:
    """Scale to the motion where single readings lie far outside of it; their places are marked."""
    if bad_readings(value).size:
        kept = without_bad_readings(value)
        kept = kept[np.isfinite(kept)]
        margin = 0.05 * float(np.ptp(kept))
        axes.set_ylim(float(kept.min()) - margin, float(kept.max()) + margin)


def _mark_faults(axes: Any, inspection: Inspection, name: str, duration: float) -> None:
    """Shade the places of the faults of one signal, each kind in one colour."""
    least = _LEAST_WIDTH * duration
    for index, fault in enumerate(one for one in inspection.faults if one.where == name and one.places):
        look = {"color": drawing.MODELS[(index + 1) % len(drawing.MODELS)], "alpha": 0.45, "linewidth": 0.0}
        for start, stop in fault.places:
            middle, half = 0.5 * (start + stop), 0.5 * max(stop - start, least)
            axes.axvspan(middle - half, middle + half, **look)
        axes.fill_between([], [], label=f"{fault.kind.replace('_', ' ')} ({fault.count})", **look)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="upper right", frameon=True, framealpha=0.8, edgecolor="none")


def _unit(inspection: Inspection, name: str) -> str:
    return inspection.units.get(name) or _FIELD_UNITS.get(name.rpartition(".")[2], "unit unknown")


def _draw_spectrum(axes: Any, inspection: Inspection) -> None:
    largest = 0.0
    for index, name in enumerate(inspection.commands):
        stream = inspection.streams[inspection.command_topic]
        stamp, which = np.unique(stream.stamp_ns, return_index=True)
        value = stream.columns()[name][which]
        known = np.isfinite(value)
        if known.sum() < 3:
            continue
        frequency, power = power_spectrum((stamp[known] - stamp[0]) * 1e-9, value[known])
        shown = slice(1, None)  # the mean has been removed
        drawing.line(axes, frequency[shown], power[shown], label=name, **drawing.model_look(index))
        largest = max(largest, float(np.max(power[shown])))
    axes.set_xscale("log")
    axes.set_yscale("log")
    if largest > 0.0:
        # Lines without power are rounding errors of any size.
        axes.set_ylim(_FAINTEST * largest, 3.0 * largest)
    axes.set_title("power of the command", loc="left")
    axes.set_xlabel(drawing.label("frequency", "Hz"))
    axes.set_ylabel(drawing.label("share per line", None))


def _draw_intervals(axes: Any, inspection: Inspection) -> None:
    widest = [np.inf, -np.inf]
    for index, (topic, stream) in enumerate(inspection.streams.items()):
        step = np.diff(stream.stamp_ns) * 1e-6
        if step.size < 2:
            continue
        share = np.arange(1, step.size + 1) / step.size
        median = float(np.median(step))
        widest = [min(widest[0], float(step.min()), 0.9 * median), max(widest[1], float(step.max()), 1.1 * median)]
        drawing.line(axes, np.sort(step), share, label=topic, **drawing.model_look(index))
    axes.set_title("intervals between stamps", loc="left")
    axes.set_xlabel(drawing.label("interval", "ms"))
    axes.set_ylabel(drawing.label("share below", None))
    if axes.get_legend_handles_labels()[0]:
        # Not closer than this: rounding of the stamps would look like jitter.
        axes.set_xlim(*widest)
        axes.legend(loc="lower right")


_IN_BRACKETS = re.compile(r"[\[({]([^\])}]*)[\])}]\s*$")


def plot_recognition(found: Recognition) -> Figure:
    """Draw each recognised column over time, in the unit of the file."""
    from matplotlib.figure import Figure

    numbers = numbers_of(found.table)
    drawn = [(guess, value) for guess in found.guesses if (value := _values(numbers, guess.column)) is not None]
    with drawing.styled():
        figure = Figure(figsize=(7.5, 1.6 * max(len(drawn), 1) + 0.6), layout="constrained")
        first = None
        for row, (guess, value) in enumerate(drawn):
            axes = figure.add_subplot(len(drawn), 1, row + 1, sharex=first)
            first = first or axes
            time = _stamps(found, guess.column, value.size)
            held = guess.role in ("command", "reference", "reference velocity")
            color = drawing.COMMAND if guess.role == "command" else drawing.MEASURED
            (drawing.steps if held else drawing.line)(axes, time, value, color=color)
            axes.set_ylabel(_label(guess))
            axes.set_title(guess.role, loc="left")
        if drawn:
            figure.axes[-1].set_xlabel(drawing.label("time", "s"))
    return figure


def _label(guess: Guess) -> str:
    """Column and unit; a name that ends with its unit in brackets says it already."""
    written = _IN_BRACKETS.search(guess.column)
    if guess.unit and written and known_unit(written[1]) == guess.unit:
        return guess.column
    scaled = {"scale", "decode"} & set(guess.options)
    return drawing.label(guess.column, "as logged" if scaled else guess.unit or "unit unknown")


def _values(numbers: dict[str, np.ndarray], column: str) -> np.ndarray | None:
    if column in numbers:
        return numbers[column]
    return Expression(column).evaluate(numbers) if column else None


def _stamps(found: Recognition, column: str, count: int) -> np.ndarray:
    from idloop.records.recognition.time_base import base_of_clock

    clock = found.clocks.get(column)
    if clock is not None and clock.column is not None:
        return base_of_clock(found.table, str(clock.column), clock.unit, "").seconds
    seconds = found.base.seconds
    return seconds if seconds.size == count else np.arange(count, dtype=np.float64)
