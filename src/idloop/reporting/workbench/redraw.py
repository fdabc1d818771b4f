"""Figures that follow new data in place: a browser releases nothing of a figure that is replaced.

BokehJS keeps every model that it was ever sent (bokeh/bokeh issues 15289, 15290), and a page that draws its figures
anew for each fit grows by some MB a minute. In place, a reader's zoom outlives the next fit, too.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from bokeh.model import Model
from bokeh.models import ColumnDataSource
from bokeh.models.ranges import Range1d

if TYPE_CHECKING:
    from bokeh.models.layouts import Column
    from bokeh.models.ui import UIElement

Drawn = list[tuple[Model, dict[str, Any]]]


class Canvas:
    """Figures in one place of the page."""

    def __init__(self, place: Column) -> None:
        self._place = place
        self._drawn: Drawn = []

    def draw(self, figures: Sequence[UIElement], *, anew: bool = False) -> None:
        """Show figures; those that differ from the ones before in values alone are brought up to them in place.

        `figures`: new ones, of which none is in a document.
        `anew`: not in place: BokehJS paints another background from the second pixel on, and leaves a line of the old
        one.
        """
        self.show(figures, drawn(figures), anew=anew)

    def show(self, figures: Sequence[UIElement], wanted: Drawn, *, anew: bool = False) -> None:
        """As `draw`, where the list of `drawn` was made before: listing takes as long as making the figures."""
        if anew or not alike(self._drawn, wanted):
            self._drawn = wanted
            self._place.children = list(figures)
            return
        kept: Drawn = []
        for (model, before), (_, now) in zip(self._drawn, wanted, strict=True):
            # Against what was drawn, not what is there: a reader's zoom and choice of tools are his own.
            for name, value in now.items():
                if not _same(model, name, value, before[name]):
                    if not (isinstance(model, ColumnDataSource) and name == "data" and streamed(model, value)):
                        setattr(model, name, value)
                    if isinstance(model, Range1d) and name in {"start", "end"}:
                        setattr(model, f"reset_{name}", value)  # where the figure's reset goes back to
            kept.append((model, now))
        self._drawn = kept


def streamed(source: ColumnDataSource, data: dict[str, Any]) -> bool:
    """Replace the rows of a source by new ones; False where they are fewer or not of the same kind.

    BokehJS builds every entry of a legend anew, with a canvas each, when a source of any of its lines changes, and not
    when rows stream in. Of fewer rows than before it keeps the last ones of the old.
    """
    old = source.data
    lengths = {len(column) for column in data.values()}
    if data.keys() != old.keys() or len(lengths) != 1 or 0 in lengths:
        return False
    if any(_kind(data[name]) != _kind(old[name]) or len(data[name]) < len(old[name]) for name in data):
        return False
    source.stream(data, rollover=lengths.pop())
    return True


def _kind(column: Any) -> str:
    """How a browser keeps a column: a list, or numbers of one type."""
    return str(column.dtype) if isinstance(column, np.ndarray) else "list"


def drawn(figures: Sequence[Model]) -> Drawn:
    """List the models of figures with their values as they are now, in an order that their structure gives.

    In the values a model is its place in this list.
    """
    places: dict[int, int] = {}
    found: list[Model] = []
    waiting = list(reversed(figures))
    while waiting:
        model = waiting.pop()
        if id(model) not in places:
            places[id(model)] = len(found)
            found.append(model)
            waiting.extend(reversed([inner for value in _values(model).values() for inner in _models(value)]))
    return [(model, {name: _placed(value, places) for name, value in _values(model).items()}) for model in found]


def alike(one: Drawn, other: Drawn) -> bool:
    """Tell whether two lists of `drawn` differ in values alone: the same kinds of models, joined in the same way."""
    if len(one) != len(other):
        return False
    return all(
        type(a) is type(b) and {n: _joints(v) for n, v in had.items()} == {n: _joints(v) for n, v in has.items()}
        for (a, had), (b, has) in zip(one, other, strict=True)
    )


def _same(model: Model, name: str, one: Any, other: Any) -> bool:
    both_nan = all(isinstance(value, float) and math.isnan(value) for value in (one, other))
    return both_nan or model.lookup(name).property.matches(one, other)


class _Place(int):
    """A model's place in a list of models."""


def _values(model: Model) -> dict[str, Any]:
    """What was set, by name; the rest is Bokeh's default in every figure."""
    return dict(sorted(model.properties_with_values(include_defaults=False).items()))


def _models(value: Any) -> Iterator[Model]:
    if isinstance(value, Model):
        yield value
    elif isinstance(value, dict | list | tuple):
        for inner in value.values() if isinstance(value, dict) else value:
            yield from _models(inner)


def _placed(value: Any, places: dict[int, int]) -> Any:
    if isinstance(value, Model):
        return _Place(places[id(value)])
    if isinstance(value, dict):
        return {key: _placed(inner, places) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        placed = [_placed(inner, places) for inner in value]
        return tuple(placed) if isinstance(value, tuple) else placed
    return value


def _joints(value: Any) -> tuple[int, ...]:
    """Places in a value, in their order."""
    if isinstance(value, _Place):
        return (int(value),)
    if isinstance(value, dict | list | tuple):
        return tuple(p for inner in (value.values() if isinstance(value, dict) else value) for p in _joints(inner))
    return ()
