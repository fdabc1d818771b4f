"""Figure: what was measured against what models say, with what is left over and the command below.

One column per record; for every output a row with the lines and a row with the residual and its band.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from idloop import drawing
from idloop.arrays import Array
from idloop.reporting.frame import Frame, residual_frame, value_frame, widest
from idloop.reporting.sensor_noise import believed_noise, refuted_noise
from idloop.validation.words import fit_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from idloop.records import Record
    from idloop.validation import Comparison


@dataclass(frozen=True)
class Panel:
    """One record and what the models say about it.

    Attributes
    ----------
    title : str
        Name of the record, and what it was used for.
    time : array, shape (n,)
        Instants of the outputs [s].
    output : array, shape (n, p)
        Measured outputs; NaN where not measured.
    modelled : mapping of str to array, shape (n, p)
        Outputs of each model by its label.
    input_time, input : array, shape (m,)
        Command and the instants from which it acts [s].
    band : array, shape (p,), optional
        Half width of the band in which the residual of a perfect model stays with 95 % probability.
    notes : mapping of str to sequence of str, optional
        For each model and output a few words for the legend, such as its FIT.

    The measured range sets the scale of the value axes; a curve that leaves it says in the legend how far it goes.
    """

    title: str
    time: Array
    output: Array
    modelled: Mapping[str, Array]
    input_time: Array
    input: Array
    band: Array | None = None
    notes: Mapping[str, Sequence[str]] = field(default_factory=dict)

    def values(self, column: int) -> dict[str, Array]:
        """Modelled values of one output."""
        return {label: modelled[:, column] for label, modelled in self.modelled.items()}

    def value_frame(self, column: int) -> Frame | None:
        """Frame of one output."""
        return value_frame(self.output[:, column], self.values(column))

    def residual_frame(self, column: int) -> Frame | None:
        """Frame of what is left of one output."""
        half = None if self.band is None else float(self.band[column])
        return residual_frame(self.output[:, column], self.values(column), half)

    def legend_entry(self, label: str, column: int) -> str:
        """A model's entry in the legend: its note, and how far it and its residual leave their frames."""
        note, frame, below = self.notes.get(label), self.value_frame(column), self.residual_frame(column)
        parts = [note[column]] if note else []
        if frame is not None and label in frame.strays:
            parts.append(f"leaves the frame, {frame.strays[label]}")
        elif below is not None and label in below.strays:
            parts.append(f"residual {below.strays[label]}")
        return f"{label} ({'; '.join(parts)})" if parts else label


def make_panel(title: str, rows: Sequence[tuple[str, Comparison]]) -> Panel:
    """Column of one record: what was measured, the free run of each model, and the band of the noise.

    `title`: above the column.
    `rows`: sequence of (str, Comparison). Label of each model and its comparison, all with the same record.
    Returns: without a band where a model misses less than the noise that is stated.
    """
    first = rows[0][1]
    believed = believed_noise(first.model, refuted_noise(comparison for _, comparison in rows))
    noise = [believed.get(output.name, np.nan) for output in first.model.outputs]
    return Panel(
        title=title,
        time=first.time,
        output=first.measured,
        modelled={label: comparison.simulated for label, comparison in rows},
        input_time=first.record.input_time,
        input=first.record.input,
        band=1.96 * np.array(noise),
        notes={
            label: [f"FIT {fit_text(comparison.fit[name], 3, ' %')}" for name in comparison.names]
            for label, comparison in rows
        },
    )


def plot_comparison(
    panels: Sequence[Panel], output_names: Sequence[str], output_units: Sequence[str], input_name: str, input_unit: str
) -> Figure:
    """Draw the figure.

    `panels`: one for each record.
    `output_names`, `output_units`: sequence of str, length p. Such as "motor.position" and "rad".
    `input_name`, `input_unit`: such as "motor.effort" and "V".
    """
    with drawing.styled():
        heights = (2.0, 1.2) * len(output_names) + (1.2,)
        figure, axes = drawing.new_figure(len(heights), len(panels), heights)
        for column, panel in enumerate(panels):
            _draw_panel(axes[:, column], panel, output_names)
        for row, (name, unit) in enumerate(zip(output_names, output_units, strict=True)):
            axes[2 * row, 0].set_ylabel(drawing.label(name, unit))
            axes[2 * row + 1, 0].set_ylabel(drawing.label("residual", unit))
            _fit_frame(axes[2 * row, 0], widest(panel.value_frame(row) for panel in panels))
            _fit_frame(axes[2 * row + 1, 0], widest(panel.residual_frame(row) for panel in panels))
        axes[-1, 0].set_ylabel(drawing.label(input_name, input_unit))
        figure.align_ylabels(axes[:, 0])
    return figure


def plot_panels(panels: Sequence[Panel], record: Record) -> Figure:
    """Draw panels of records that have the signals of `record`."""
    return plot_comparison(panels, record.output_names, record.output_units, record.input_name, record.input_unit)


def _fit_frame(axes: Any, frame: Frame | None) -> None:
    """Cut off what strays; the axes of a row are linked."""
    if frame is not None:
        axes.set_ylim(frame.low, frame.high)


def _draw_panel(axes: Any, panel: Panel, output_names: Sequence[str]) -> None:
    axes[0].set_title(panel.title, loc="left", fontweight="bold", pad=20)  # clear of the legend
    for row in range(len(output_names)):
        top, below = axes[2 * row], axes[2 * row + 1]
        drawing.line(top, panel.time, panel.output[:, row], color=drawing.MEASURED, linewidth=1.6, label="measured")
        below.axhline(0.0, color=drawing.MEASURED, linewidth=0.6)
        for index, (label, modelled) in enumerate(panel.modelled.items()):
            look = drawing.model_look(index)
            drawing.line(top, panel.time, modelled[:, row], label=panel.legend_entry(label, row), **look)
            drawing.line(below, panel.time, panel.output[:, row] - modelled[:, row], **look)
        if panel.band is not None and np.isfinite(panel.band[row]):
            half = float(panel.band[row])
            below.axhspan(-half, half, color=drawing.BAND, alpha=0.25, linewidth=0, label="95 % band of the noise")
            legend_above(below, 1)
        legend_above(top, 1 + len(panel.modelled))
    drawing.steps(axes[-1], panel.input_time, panel.input, color=drawing.COMMAND)
    axes[-1].set_xlabel(drawing.label("time", "s"))


def legend_above(axes: Any, entries: int) -> None:
    """Write the legend above the axes, to the right of their title."""
    if not axes.get_legend_handles_labels()[0]:
        return
    # Outside the axes: inside, it would lie on the curves somewhere.
    axes.legend(
        loc="lower right", bbox_to_anchor=(1.0, 0.98), borderaxespad=0.0, ncols=min(entries, 3), columnspacing=1.2
    )
