"""One look for every figure: palette, sizes, labels with units, and how a figure is written to a file.

The palette is that of Okabe and Ito (2008), which readers of every colour vision tell apart; lines differ
in their dashes as well, so that a grey print still reads.
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
    "svg.fonttype": "none",  # text stays text: it can be searched and edited
    "svg.hashsalt": "idloop",  # equal figures are equal files
    "pdf.fonttype": 42,
}

# Beyond this many points a vector file gets an image of the line: smaller and quicker to open.
RASTERISE_FROM = 5000


def model_look(index: int) -> dict[str, Any]:
    """Colour and dashes of the line of the model number `index`."""
    return {"color": MODELS[index % len(MODELS)], "linestyle": DASHES[index % len(DASHES)]}


def label(name: str, unit: str | None) -> str:
    """Text of an axis: the quantity and its unit, "[-]" for a pure number."""
    return f"{name} [{unit or '-'}]"


@contextlib.contextmanager
def styled() -> Iterator[None]:
    """Use the project's settings inside the block and leave the user's own as they were."""
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
    """Make a figure without any window or global state.

    Parameters
    ----------
    rows, columns : int
        Grid of axes. The time axes of a column are linked, and so are the value axes of a row.
    heights : tuple of float, optional
        Height of each row in inches.

    Returns
    -------
    figure : matplotlib Figure
    axes : ndarray of Axes, shape (rows, columns)
    """
    from matplotlib.figure import Figure

    tall = heights or (1.8,) * rows
    figure = Figure(figsize=(max(7.5, 4.6 * columns), sum(tall) + 0.9), layout="constrained")
    axes = figure.subplots(
        rows, columns, squeeze=False, sharex="col", sharey="row", gridspec_kw={"height_ratios": tall}
    )
    return figure, axes


def line(axes: Axes, x: Any, y: Any, **look: Any) -> None:
    """Draw a line, as an image inside vector files when it has very many points."""
    axes.plot(x, y, rasterized=len(x) > RASTERISE_FROM, **look)


def steps(axes: Axes, x: Any, y: Any, **look: Any) -> None:
    """Draw a value that is held from each point to the next, as a command is."""
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
