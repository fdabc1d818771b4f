"""One figure for each row of the papers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from paper_dc_motor import THESIS, UNSEEN, DcMotorRow, thesis_gains
from paper_torsion import (
    CASES,
    EFFECTS,
    LARGE,
    LINEAR,
    LINEAR_SMALL,
    ONE,
    TRUE,
    AmplitudeRow,
    TorsionCase,
)

from idloop import drawing

# Stretch of the A6 record that is drawn [s].
SHOWN = (10.0, 16.0)


def a6(rows: Sequence[DcMotorRow], path: Path) -> Path:
    """Drift of the linear fits beside the published one, FIT by amplitude, and the motion at the unseen one."""
    from matplotlib.figure import Figure

    row = rows[0]
    with drawing.styled():
        figure = Figure(figsize=(11.0, 3.3), layout="constrained")
        drift, fits, motion = figure.subplots(1, 3, width_ratios=(1.0, 1.0, 1.35))
        amplitude = np.array(list(THESIS))
        theirs, ours = thesis_gains(), {u: row.drift.gain(u) for u in THESIS}
        drift.plot(amplitude, list(theirs.values()), "o", color=drawing.MEASURED, label="published linear fits")
        drift.plot(amplitude, list(ours.values()), "s", color=drawing.MODELS[1], mfc="none", label="linear fits here")
        fine = np.linspace(0.21, 0.46, 100)
        values = row.found.ladder.model.values
        width = values.get("dead_zone@input.width", 0.0)
        gain = values["drive.gain"] / values["motor.viscous_friction"]
        label = f"the one model: {gain:.2f} (1 − {width:.3f} V / u)"
        drift.plot(fine, gain * (1.0 - width / fine), color=drawing.MODELS[0], label=label)
        drift.set(xlabel="amplitude u [V]", ylabel="apparent gain b/a [rad/(s V)]", ylim=(0.0, None))
        drift.set_title("Linear fits drift with the amplitude", loc="left")
        drift.legend(loc="lower right")
        for index, (name, by_amplitude) in enumerate(row.fits.items()):
            colour = (drawing.MODELS[1], drawing.MODELS[0], drawing.MEASURED)[index]
            dashes, marker = ("-", "-", ":")[index], ("o", "o", "")[index]
            position = [p for p, _ in by_amplitude.values()]
            fits.plot(list(by_amplitude), position, marker=marker, markersize=4, color=colour, ls=dashes, label=name)
        fits.axvspan(UNSEEN - 0.015, UNSEEN + 0.015, color=drawing.BAND, alpha=0.25, linewidth=0, label="never fitted")
        fits.set(xlabel="amplitude u [V]", ylabel="FIT of the position in free run [%]", ylim=(None, 100.0))
        fits.set_title("One model for every amplitude", loc="left")
        fits.legend(loc="lower right")
        _motion(motion, row)
        motion.set_title(f"Free run at {UNSEEN} V, which was never fitted", loc="left")
        return drawing.save(figure, path)


def _motion(axes: Any, row: DcMotorRow) -> None:
    from idloop.validate import compare

    record = row.records[UNSEEN]
    inside = (record.time >= SHOWN[0]) & (record.time <= SHOWN[1])
    axes.plot(
        record.time[inside], record.output[inside, 0], ".", color=drawing.MEASURED, markersize=3, label="measured"
    )
    for index, name in ((1, "one linear model"), (0, "with the effects")):
        simulated = compare(row.models[name], record).simulated
        axes.plot(record.time[inside], simulated[inside, 0], color=drawing.MODELS[index], label=name)
    axes.set(xlabel="time [s]", ylabel="position [rad]")
    _legend_above(axes)


def b2(cases: Sequence[TorsionCase], path: Path) -> Path:
    """Errors of the parameters with their intervals, and the force error before and after, by case."""
    from matplotlib.figure import Figure

    count = len(cases)
    names = [f"{case.name}, {100 * case.share:.0f} %" for case in cases]
    with drawing.styled():
        figure = Figure(figsize=(11.0, 0.42 * count + 1.6), layout="constrained")
        parameters, forces = figure.subplots(1, 2, sharey=True)
        place = {effect: i for i, effect in enumerate(CASES["all"])}
        drawn: set[str] = set()
        for y, case in enumerate(cases):
            for rung in case.found.rungs:
                for estimate in rung.estimates:
                    if np.isfinite(estimate.deviations) and abs(estimate.true) > 0.0:
                        _estimate(parameters, y, rung.hidden, estimate, place, drawn)
            errors = {name: worth.force for name, worth in case.found.worth.items()}
            forces.plot([errors[LINEAR], errors[ONE]], [y, y], color=drawing.BAND, linewidth=1.0)
            if not case.found.right:
                said = "not all found" if case.found.missed else "one too many"
                forces.annotate(
                    said, (errors[LINEAR], y), (6, 0), textcoords="offset points", fontsize=7.5, va="center"
                )
        for name, marker, colour in (
            (LINEAR, "o", drawing.MODELS[1]),
            (ONE, "o", drawing.MODELS[0]),
            (TRUE, "|", drawing.MEASURED),
        ):
            values = [case.found.worth[name].force for case in cases]
            forces.plot(values, range(count), marker, color=colour, markersize=9 if marker == "|" else 5, label=name)
        parameters.axvline(0.0, color=drawing.MEASURED, linewidth=0.6)
        parameters.set_yticks(range(count), names)
        parameters.invert_yaxis()
        parameters.set(xlabel="error of the parameter, ± 2 standard errors [% of its true value]")
        parameters.set_title("Effects that were found", loc="left")
        parameters.legend(loc="upper left", bbox_to_anchor=(0.0, -0.12), ncols=3)
        forces.set_xscale("log")
        _plain(forces.xaxis)
        forces.set(xlabel="error of the drive's torque on validation [%]")
        forces.set_title("What they are worth", loc="left")
        forces.legend(loc="upper left", bbox_to_anchor=(0.0, -0.12), ncols=3)
        return drawing.save(figure, path)


def _estimate(axes: Any, y: int, hidden: str | None, estimate: Any, place: dict[str, int], drawn: set[str]) -> None:
    short = next(name for name, (effect, at, _) in EFFECTS.items() if f"{effect}@{at}" == hidden)
    index = place[short]
    error = 100.0 * (estimate.value - estimate.true) / abs(estimate.true)
    label = None if short in drawn else short
    drawn.add(short)
    offset = 0.12 * (index - 2) + (0.06 if estimate.name == "phase" else 0.0)
    axes.errorbar(
        error, y + offset, xerr=200.0 * estimate.stderr / abs(estimate.true), fmt="o", markersize=4, capsize=2,
        color=drawing.MODELS[index], label=label,
    )  # fmt: skip


def b9(rows: Sequence[AmplitudeRow], path: Path) -> Path:
    """FIT by amplitude of linear models and of the one model, and the free run at the large amplitude."""
    from matplotlib.figure import Figure

    with drawing.styled():
        figure = Figure(figsize=(11.0, 3.3 * len(rows)), layout="constrained")
        grid = figure.subplots(len(rows), 3, squeeze=False, width_ratios=(1.0, 1.0, 1.5))
        colours = (drawing.MODELS[4], drawing.MODELS[1], drawing.MODELS[0], drawing.MEASURED)
        for (fits, forces, motion), row in zip(grid, rows, strict=True):
            for colour, (name, by_amplitude) in zip(colours, row.worths.items(), strict=True):
                at = [100.0 * amplitude for amplitude in by_amplitude]
                look: dict[str, Any] = {"color": colour, "marker": "o", "markersize": 4, "label": name}
                if name == TRUE:
                    look |= {"linestyle": ":", "marker": ""}
                fits.plot(at, [worth.free_run for worth in by_amplitude.values()], **look)
                forces.plot(at, [worth.force for worth in by_amplitude.values()], **look)
            fits.set(xlabel="amplitude [%]", ylabel="FIT of the free run, fresh records [%]")
            fits.set_title(f"Disturbance {100 * row.share:.0f} %; 50 % was never fitted", loc="left")
            fits.legend(loc="lower right")
            forces.set_yscale("log")
            _plain(forces.yaxis)
            forces.set(xlabel="amplitude [%]", ylabel="error of the drive's torque [%]")
            _free_run(motion, row)
        return drawing.save(figure, path)


def _free_run(axes: Any, row: AmplitudeRow) -> None:
    from idloop.validate import compare

    record = row.shown
    inside = record.time >= 0.0
    column = record.output_names.index("load2.position")
    axes.plot(record.time[inside], record.output[inside, column], color=drawing.MEASURED, label="measured")
    for index, name in ((4, LINEAR_SMALL), (0, ONE)):
        simulated = compare(row.models[name], record).simulated
        axes.plot(record.time[inside], simulated[inside, column], color=drawing.MODELS[index], label=name)
    axes.set(xlabel="time [s]", ylabel="angle of the second load [rad]")
    axes.set_title(f"Free run at {100 * LARGE:.0f} %", loc="left")
    _legend_above(axes)


def _plain(axis: Any) -> None:
    """Numbers as they are along a logarithmic axis."""
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axis.set_minor_formatter(NullFormatter())


def _legend_above(axes: Any) -> None:
    """Legend in one line, with room above the curves."""
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.15 * (high - low))
    axes.legend(loc="upper right", ncols=3)


FIGURES: dict[str, Callable[..., Path]] = {"A6": a6, "B2": b2, "B9": b9}
