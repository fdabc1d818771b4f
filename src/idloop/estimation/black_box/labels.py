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


def draw_bode(axes: Any, model: Any, frequency: Any, response: Any, title: str, radius: Any = None) -> None:
    """Draw magnitude and phase of a response (f, p, m), with bands where the radius of its circles is known.

    `axes`: of magnitude and phase; `model`: whose signals have the names and units.
    """
    import numpy as np

    from idloop import drawing

    magnitude, phase = axes
    unit, texts = bode_labels(model.input_names, model.input_units, model.output_names, model.output_units)
    for index, (row, column) in enumerate(np.ndindex(response.shape[1:])):
        look, value = drawing.model_look(index), response[:, row, column]
        size, angle = np.abs(value), np.degrees(np.unwrap(np.angle(value)))
        drawing.line(magnitude, frequency, size, label=texts[row][column], **look)
        drawing.line(phase, frequency, angle, **look)
        width = None if radius is None else radius[:, row, column]
        if width is not None and np.any(np.isfinite(width)):
            # Where the circle holds the origin the phase is unknown.
            turn = np.degrees(np.arcsin(np.minimum(width / np.maximum(size, 1e-300), 1.0)))
            turn = np.where(width < size, turn, 180.0)
            shade = {"color": look["color"], "alpha": 0.2, "linewidth": 0}
            # A band that reaches zero has no lower edge on a logarithmic axis: it ends below the curve.
            magnitude.fill_between(frequency, np.maximum(size - width, 0.3 * np.min(size)), size + width, **shade)
            phase.fill_between(frequency, angle - turn, angle + turn, **shade)
    magnitude.set(xscale="log", yscale="log")
    phase.set(xscale="log", ylabel=drawing.label("phase", "deg"))
    magnitude.set_ylabel("magnitude" if unit is None else drawing.label("magnitude", unit))
    # Title and legend above the axes, one over the other: inside, the legend would lie on the curves.
    magnitude.set_title(title, loc="left", pad=20)
    magnitude.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.2, ncols=2, columnspacing=1.2)


def new_axes(axes: Any, rows: int = 1, height: float = 4.0) -> Any:
    """Return the given matplotlib axes, or new ones; those below each other share the horizontal axis [inch]."""
    if axes is not None:
        return axes
    import matplotlib.pyplot as plt

    _, made = plt.subplots(rows, sharex=True, figsize=(8.0, height), layout="constrained")
    return made
