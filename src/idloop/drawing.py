"""Style of figures: palette, sizes, labels with units, and files.

The palette of Okabe and Ito (2008) is distinguishable with any colour vision; lines also differ in their dashes, for
grey prints.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from idloop.errors import IdloopError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MEASURED = "#000000"
COMMAND = "#555555"
BAND = "#999999"
MODELS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#F0E442")
DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1.5, 1)), (0, (5, 1, 1, 1)))

SETTINGS: Any = {
    "figure.dpi": 120,
    "savefig.dpi": 150,
    "font.size": 9.0,
    "axes.titlesize": 9.0,
    "axes.labelsize": 9.0,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "grid.color": "#DDDDDD",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.1,
    "legend.frameon": False,
    "legend.fontsize": 8.0,
    "svg.fonttype": "none",  # text can be searched and edited
    "svg.hashsalt": "idloop",  # equal figures are equal files
    "pdf.fonttype": 42,
}

# From so many points on a line is an image in a vector file, which is smaller and faster to open.
RASTERISE_FROM = 5000


def model_look(index: int) -> dict[str, Any]:
    """Colour and dashes of the line of the model number `index`."""
    return {"color": MODELS[index % len(MODELS)], "linestyle": DASHES[index % len(DASHES)]}


def label(name: str, unit: str | None) -> str:
    """Text of an axis: the quantity and its unit, "[-]" for a pure number."""
    return f"{name} [{unit or '-'}]"


@contextlib.contextmanager
def styled() -> Iterator[None]:
    """Use the project's settings inside the block, without a change of the user's own."""
    import matplotlib as mpl

    with mpl.rc_context(SETTINGS):
        yield


@contextlib.contextmanager
def short_numbers() -> Iterator[None]:
    """Write large and small numbers at the ticks with one common power of ten, for narrow axes."""
    import matplotlib as mpl

    with mpl.rc_context({"axes.formatter.limits": (-2, 4)}):
        yield


def new_figure(rows: int, columns: int = 1, heights: tuple[float, ...] | None = None) -> tuple[Figure, Any]:
    """Make a figure without a window or global state.

    `rows`, `columns`: grid of axes. The time axes of a column and the value axes of a row are linked.
    `heights`: height of each row in inches.
    Returns `figure`.
    and `axes` (rows, columns).
    """
    from matplotlib.figure import Figure

    tall = heights or (1.8,) * rows
    figure = Figure(figsize=(max(7.5, 4.6 * columns), sum(tall) + 0.9), layout="constrained")
    axes = figure.subplots(
        rows, columns, squeeze=False, sharex="col", sharey="row", gridspec_kw={"height_ratios": tall}
    )
    return figure, axes


def line(axes: Axes, x: Any, y: Any, **look: Any) -> None:
    """Draw a line, as an image in vector files when it has very many points."""
    axes.plot(x, y, rasterized=len(x) > RASTERISE_FROM, **look)


def steps(axes: Axes, x: Any, y: Any, **look: Any) -> None:
    """Draw a value that is held from each point to the next, such as a command."""
    axes.plot(x, y, drawstyle="steps-post", rasterized=len(x) > RASTERISE_FROM, **look)


def save(figure: Figure, path: Path) -> Path:
    """Write the figure; the suffix chooses the format.

    Raises
    ------
    IdloopError
        When the file cannot be written.
    """
    # Without the date, equal figures are equal files.
    metadata = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}.get(path.suffix.lower())
    try:
        with styled():
            figure.savefig(path, metadata=metadata)
    except OSError as error:
        raise IdloopError(f"cannot write {path}: {error.strerror or error}") from error
    return path
