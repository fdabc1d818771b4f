"""Fewer points for the same picture: of every stretch that falls on a pixel the least and the largest value stay."""

from __future__ import annotations

from typing import Any

import numpy as np
from bokeh.models import ColumnDataSource
from bokeh.models.renderers import GlyphRenderer
from bokeh.plotting import figure
from numpy.typing import ArrayLike, NDArray

from idloop.arrays import Integers

# Stretches of a figure: more than a wide screen has pixels, so that some zooming shows more.
BUCKETS = 2000


def kept(x: ArrayLike, y: ArrayLike, buckets: int = BUCKETS) -> Integers:
    """Which points of a curve draw it as well as all of them do.

    `x` (n,): increasing.
    `y` (n,): NaN where the curve is interrupted.
    `buckets`: stretches of equal length in x.
    Returns shape (m,): increasing; m is at most ``2 buckets + 2``, or n where there are no more than that. Of each
    stretch the first of the least and of the largest values, one NaN of a stretch that has nothing else, and both ends.
    """
    place, value = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    n = len(place)
    if n <= 2 * buckets + 2:
        return np.arange(n)
    width = (place[-1] - place[0]) / buckets
    bucket = np.minimum(((place - place[0]) / width).astype(np.int64), buckets - 1)
    first = np.flatnonzero(np.diff(bucket, prepend=-1))
    inside = np.repeat(np.arange(len(first)), np.diff(np.append(first, n)))
    missing = np.isnan(value)
    found: list[Integers] = [first[np.logical_and.reduceat(missing, first)], np.array([0, n - 1])]
    for worst, pick in ((np.inf, np.minimum), (-np.inf, np.maximum)):
        filled = np.where(missing, worst, value)
        extreme = pick.reduceat(filled, first)
        hits = np.flatnonzero((filled == extreme[inside]) & ~missing)
        found.append(hits[np.unique(inside[hits], return_index=True)[1]])
    return np.unique(np.concatenate(found)).astype(np.int64)


def thinned(x: ArrayLike, y: ArrayLike, buckets: int = BUCKETS) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Points of a curve that draw it as well as all of them do, in single precision: half the bytes of a page.

    `x`, `y`, `buckets`: as for `kept`.
    """
    index = kept(x, y, buckets)
    return np.asarray(x, dtype=np.float32)[index], np.asarray(y, dtype=np.float32)[index]


def draw_thinned(
    plot: figure, x: ArrayLike, y: ArrayLike, buckets: int = BUCKETS, *, held: bool = False, **look: Any
) -> GlyphRenderer[Any]:
    """Draw a curve with as few points as it takes; with `held`, each value until the next instant."""
    place, value = thinned(x, y, buckets)
    data = ColumnDataSource(data={"x": place, "y": value})
    return plot.step("x", "y", source=data, mode="after", **look) if held else plot.line("x", "y", source=data, **look)
