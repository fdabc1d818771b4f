"""Names, units and axes of results: as python-control takes them, and as figures show them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any


def control_names(names: Sequence[str]) -> list[str]:
    """Signal names without dots, which python-control keeps for its own use: ``motor.effort`` is ``motor_effort``."""
    return [name.replace(".", "_") for name in names]


def bode_labels(
    inputs: Sequence[str], input_units: Sequence[str], outputs: Sequence[str], output_units: Sequence[str]
) -> tuple[str | None, list[list[str]]]:
    """Unit of the magnitude, where all curves have the same, and the text of each curve."""
    units = [[ratio_unit(out, given) for given in input_units] for out in output_units]
    shared = len({unit for row in units for unit in row}) == 1
    texts = [
        [f"{given} → {out}" + ("" if shared else f" [{units[row][column]}]") for column, given in enumerate(inputs)]
        for row, out in enumerate(outputs)
    ]
    return (units[0][0] if shared else None), texts


def ratio_unit(output: str, given: str) -> str:
    """Unit of a response."""
    if given == "-":
        return output
    return f"{'1' if output == '-' else output}/{f'({given})' if set(given) & set('/·') else given}"


def title_over_legend(axes: Any, title: str) -> None:
    """Write title and legend above the axes, one over the other: inside, the legend would lie on the curves."""
    axes.set_title(title, loc="left", pad=20)
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.2, ncols=2, columnspacing=1.2)


def new_axes(axes: Any, rows: int = 1, height: float = 4.0, *, columns: int = 1, width: float = 8.0) -> Any:
    """Return the given matplotlib axes, or new ones; those below each other share the horizontal axis [inch]."""
    if axes is not None:
        return axes
    import matplotlib.pyplot as plt

    _, made = plt.subplots(rows, columns, sharex="col", figsize=(width, height), layout="constrained")
    return made
