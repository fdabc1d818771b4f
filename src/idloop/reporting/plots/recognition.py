"""Figure: the signals of a foreign log as they were recognised."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from idloop import drawing
from idloop.records.recognition.guess import Guess
from idloop.records.recognition.recognise import Recognition
from idloop.records.recognition.table_column import numbers_of
from idloop.records.tables.base_units import known_unit
from idloop.records.tables.expression import Expression

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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
