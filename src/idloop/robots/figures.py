"""Figures of an identified robot: measured and modelled torque of every joint, for paper and for the page."""

from __future__ import annotations

from typing import TYPE_CHECKING

from idloop import drawing
from idloop.robots.identify import Robot

if TYPE_CHECKING:
    from bokeh.plotting import figure
    from matplotlib.figure import Figure


def plot_robot(robot: Robot) -> Figure:
    """Draw torque and residual of every joint along the last record."""
    from matplotlib.figure import Figure

    shown = robot.errors[-1]
    names = robot.rigid_body.joints
    with drawing.styled():
        figure = Figure(figsize=(9.0, 1.7 * len(names) + 0.8), layout="constrained")
        rows = figure.subplots(len(names), 2, squeeze=False, sharex=True)
        for place, (name, (whole, left)) in enumerate(zip(names, rows, strict=True)):
            unit = robot.tasks[place].model.units.force
            measured, error = shown.measured[:, place], shown.error[:, place]
            drawing.line(whole, shown.time, measured, color=drawing.MEASURED, linewidth=1.6, label="measured")
            drawing.line(whole, shown.time, measured - error, **drawing.model_look(0), linewidth=1.0, label="model")
            drawing.line(left, shown.time, error, **drawing.model_look(0), linewidth=0.8)
            whole.set_ylabel(drawing.label(name, unit))
            left.set_title(f"{name}: residual", fontsize="small", loc="left")
        rows[0][0].legend(loc="upper right", fontsize="small")
        for axis in rows[-1]:
            axis.set_xlabel("time [s]")
        figure.suptitle(f"torque along {shown.record}, {'unseen' if shown.unseen else 'fitted'}")
    return figure


def torque_figures(robot: Robot, place: int) -> list[figure]:
    """Draw torque and residual of one joint along the last record, for the page."""
    from idloop.reporting.figures.theme import (
        BUCKETS,
        LIGHT,
        add_legend,
        add_zero_line,
        draw_thinned,
        new_figure,
        padded,
    )

    shown = robot.errors[-1]
    unit = robot.tasks[place].model.units.force
    measured, error = shown.measured[:, place], shown.error[:, place]
    time, span = ("time", "s"), padded(float(shown.time[0]), float(shown.time[-1]), 0.01)
    top = new_figure(LIGHT, time, ("torque", unit), x_range=span, height=240)
    below = new_figure(LIGHT, time, ("residual", unit), x_range=top.x_range, height=160)
    add_zero_line(below, LIGHT)
    drawn = draw_thinned(top, shown.time, measured, BUCKETS, color=LIGHT.measured, line_width=2.4)
    look = {**LIGHT.model(0), "line_width": 1.4}
    model = draw_thinned(top, shown.time, measured - error, BUCKETS, **look)
    left = draw_thinned(below, shown.time, error, BUCKETS, **look)
    add_legend(top, LIGHT, [("measured", [drawn]), ("model", [model, left])])
    return [top, below]
