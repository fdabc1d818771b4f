"""Row A6: linear fits of the Lehigh motor drift with the amplitude, and one model with named effects does not.

The thesis fits b / (s² + a s) to square waves of four amplitudes, with an adjustable backlash between gearbox and
potentiometer, on a motor whose dead zone it measured as 0.12 V. Its gains b/a rise with the amplitude u as
K (1 − 0.12 V / u) does; the K and the a of its table are those of the machine here. It does not tell the gap of its
coupling, nor the length of its records.

Its a falls with the amplitude, which a dead zone alone does not make it do: dry friction does, because it brakes after
a reversal. A second machine therefore has a quarter of the 0.12 V as Coulomb friction.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from papers import Progress
from papers.claim import above, below, stated, within
from papers.hidden_effects import LEVEL, Answer, Recording, Simulate, climb, part_of, to_record, white_noise
from papers.motor import lehigh_motor
from papers.reproduction import Cell, Line, Reproduction, Table

if TYPE_CHECKING:
    from idloop.physics import Model
    from idloop.records import Record

Array = NDArray[np.float64]

DEAD_ZONE = lehigh_motor.DEAD_ZONE
THESIS = lehigh_motor.WITH_BACKLASH
# Gap [rad] of our machine, and the amplitude that no fit sees [V].
GAP, UNSEEN = 0.1, 0.45
# Part of the dead zone that is dry friction, by machine.
FRICTION = {"dead-zone": 0.0, "dead-zone+friction": 0.25}
# The thesis's square wave and grid, for so long [s]; and the record that is also diagnosed by itself [V].
RATE, DURATION, FREQUENCY = 1.0 / lehigh_motor.SAMPLE_TIME, 120.0, lehigh_motor.SQUARE_FREQUENCY
ALONE = 0.30
ONE_LINEAR, WITH_EFFECTS, TRUE = "one linear model", "with the effects", "the true machine"
# The published gains and the dead zone are met to these shares, the machine's own FIT to so many points.
_GAIN, _WIDTH, _AS_GOOD = 0.10, 0.03, 1.0
# Stretch of the record that is drawn [s].
_SHOWN = (10.0, 16.0)


@dataclass(frozen=True)
class Drift:
    """Linear fits at each amplitude: value and standard error of b and a by amplitude."""

    b: dict[float, tuple[float, float]]
    a: dict[float, tuple[float, float]]

    def gain(self, amplitude: float) -> float:
        """Apparent gain b/a."""
        return self.b[amplitude][0] / self.a[amplitude][0]

    @property
    def fall(self) -> float:
        """Change of a from the smallest to the largest amplitude [%]."""
        return _fall([value for value, _ in self.a.values()])


@dataclass(frozen=True, eq=False)
class MotorFits:
    """One machine: its linear fits and its diagnosis.

    Attributes
    ----------
    name : str
        A key of `FRICTION`.
    seed : int
    drift : Drift
    found, alone : Answer
        From all amplitudes at once, and from one.
    fits : dict
        FIT of the free run [%]: ``fits[model][amplitude] = (position, velocity)``.
    records : dict
        By amplitude.
    models : dict
        By name, as in `fits`.
    """

    name: str
    seed: int
    drift: Drift
    found: Answer
    alone: Answer
    fits: dict[str, dict[float, tuple[float, float]]]
    records: dict[float, Record]
    models: dict[str, Model]

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        drift = {
            f"{u:.2f}": {name: getattr(self.drift, name)[u][0] for name in ("b", "a")}
            | {f"{name}_stderr": getattr(self.drift, name)[u][1] for name in ("b", "a")}
            | {"thesis_b": THESIS[u].b, "thesis_a": THESIS[u].a}
            for u in THESIS
        }
        fits = {
            name: {f"{u:.2f}": {"position": p, "velocity": v} for u, (p, v) in by_amplitude.items()}
            for name, by_amplitude in self.fits.items()
        }
        alone = {**self.alone.to_dict(), "amplitude": ALONE, "untestable": list(self.alone.ladder.untestable)}
        return {
            "machine": self.name,
            "seed": self.seed,
            "drift": drift,
            "ladder": self.found.to_dict(),
            "one_amplitude": alone,
            "fit": fits,
        }


def _fall(values: Sequence[float]) -> float:
    return 100.0 * (values[-1] / values[0] - 1.0)


def thesis_gains() -> dict[float, float]:
    """Published b/a by amplitude [V]."""
    return {u: fit.b / fit.a for u, fit in THESIS.items()}


def implied(gains: Mapping[float, float]) -> tuple[float, float]:
    """Gain and dead zone that a table of apparent gains follows: least squares on K (1 − width / u).

    Parameters
    ----------
    gains : mapping of float to float
        b/a by amplitude.
    """
    regressor = np.array([[1.0, -1.0 / u] for u in gains])
    gain, product = np.linalg.lstsq(regressor, np.array(list(gains.values())), rcond=None)[0]
    return float(gain), float(product / gain)


def true_motor(friction: float) -> Model:
    """The thesis's motor: gain and damping read off its table, its dead zone, and a gap.

    Parameters
    ----------
    friction : float
        Part of the dead zone that is Coulomb friction instead, 0 to 1.
    """
    from idloop.physics import load_model

    share = np.array([1.0 - DEAD_ZONE / u for u in THESIS])
    gain = float(share @ np.array(list(thesis_gains().values())) / (share @ share))
    damping = float(np.mean([fit.a for fit in THESIS.values()]))
    model = replace(load_model("dc_motor"), controller=None)
    model = model.with_values({"drive.gain": gain * damping, "motor.viscous_friction": damping})
    model = model.with_effect("dead_zone", "input", width=DEAD_ZONE * (1.0 - friction))
    if friction > 0.0:
        model = model.with_effect("coulomb_friction", "motor", level=gain * damping * DEAD_ZONE * friction)
    return model.with_effect("backlash", "position[motor]", gap=GAP)


def square(amplitude: float) -> Recording:
    """The square wave of the thesis."""
    count = round(DURATION * RATE)
    phase = (np.arange(count) * FREQUENCY / RATE) % 1.0
    signal = np.where(phase < 0.5, amplitude, -amplitude)
    return Recording(f"square {amplitude:.2f} V", signal, None, RATE, np.zeros(count))


def simulated(model: Model, recording: Recording, seed: int) -> Record:
    """Run the motor by its closed-form pieces."""
    from papers.motor.independent_motor import GearedMotor

    values = model.values
    machine = GearedMotor(
        gain=values["drive.gain"] / values["motor.inertia"],
        damping=values["motor.viscous_friction"] / values["motor.inertia"],
        dead_zone=values["dead_zone@input.width"],
        friction=values.get("coulomb_friction@motor.level", 0.0) / values["motor.inertia"],
        gap=values["backlash@position[motor].gap"],
    )
    output = machine.run(recording.signal, 1.0 / recording.rate)
    return to_record(model, recording, recording.signal, output + white_noise(model, len(output), seed))


def linear_fits(start: Model, records: Mapping[float, Record]) -> Drift:
    """The linear model fitted to every record by itself, by output error."""
    from idloop.estimation import fit

    b, a = {}, {}
    for u, record in records.items():
        model = fit(start, [record], criterion="simulation").model
        gain, damping = model.parameter("drive.gain"), model.parameter("motor.viscous_friction")
        b[u] = gain.value, gain.stderr or float("nan")
        a[u] = damping.value, damping.stderr or float("nan")
    return Drift(b, a)


def motor_fits(
    name: str, seed: int, progress: Progress, simulate: Simulate = simulated, level: float = LEVEL
) -> MotorFits:
    """Linear fits drift; one model with the effects explains all amplitudes and one that it never saw.

    Parameters
    ----------
    name : str
        A key of `FRICTION`.
    seed : int
        Of the measurement noise.
    progress : callable
    simulate : callable
    level : float
        Family-wise error rate.
    """
    from idloop.physics import load_model
    from idloop.validation import compare

    truth = true_motor(FRICTION[name])
    records = {u: simulate(truth, square(u), 100 * seed + i) for i, u in enumerate((*THESIS, UNSEEN))}
    training = {u: records[u] for u in THESIS}
    start = replace(load_model("dc_motor"), controller=None)
    progress(0.0, f"{name}: linear fits")
    drift = linear_fits(start, training)
    found = climb(start, truth, list(training.values()), [records[UNSEEN]],
                  lambda share, text: progress(0.1 + 0.6 * share, f"{name}: {text}"), level)  # fmt: skip
    alone = climb(start, truth, [records[ALONE]], [],
                  lambda share, text: progress(0.7 + 0.2 * share, f"{name}, one record: {text}"), level)  # fmt: skip
    models = {ONE_LINEAR: found.ladder.steps[0].model, WITH_EFFECTS: found.ladder.model, TRUE: truth}
    progress(0.9, f"{name}: free runs")
    fits = {
        which: {u: _position_velocity(compare(model, record).fit) for u, record in records.items()}
        for which, model in models.items()
    }
    return MotorFits(name, seed, drift, found, alone, fits, records, models)


def _position_velocity(fit: Mapping[str, float]) -> tuple[float, float]:
    return fit["motor.position"], fit["motor.velocity"]


@dataclass(frozen=True, eq=False)
class DriftingFits(Reproduction):
    """Every machine that was asked for."""

    machines: tuple[MotorFits, ...]

    def rows(self) -> tuple[Line, ...]:
        """Gains and damping beside the thesis's, and what the diagnosis says of all four amplitudes."""
        theirs = thesis_gains()
        lines = [Line("dead zone in the published gains, K (1 − width / u)", implied(theirs)[1], DEAD_ZONE, "V",
                      "figure 6.4", within(DEAD_ZONE, 0.1))]  # fmt: skip
        for one in self.machines:
            lines += self._of(one, theirs)
        return tuple(lines)

    def _of(self, one: MotorFits, theirs: Mapping[float, float]) -> list[Line]:
        head, friction = f"{one.name}: ", FRICTION[one.name] > 0.0
        # The gain of the machine is read off the published ones as a dead zone alone would have made them.
        lines = [
            Line(f"{head}b/a at {u:.2f} V", one.drift.gain(u), theirs[u], "rad/(s V)", "eq. 7.3 to 7.10",
                 None if friction else within(theirs[u], _GAIN))
            for u in THESIS
        ]  # fmt: skip
        fall, published = one.drift.fall, _fall([fit.a for fit in THESIS.values()])
        # Without dry friction a does not fall, and nothing is claimed.
        falls = below(0.5 * published) if friction else None
        lines.append(Line(f"{head}change of a, smallest to largest amplitude", fall, published, "%",
                          "eq. 7.3 to 7.10", falls))  # fmt: skip
        lines.append(Line(f"{head}found from all four amplitudes, from the linear model", one.found.words,
                          "one model an amplitude", "", "section 7.2", one.found.claim))  # fmt: skip
        values = one.found.ladder.model.values
        width = values.get("dead_zone@input.width", 0.0)
        width += values.get("coulomb_friction@motor.level", 0.0) / values["drive.gain"]
        lines.append(Line(f"{head}dead zone found, dry friction included", width, DEAD_ZONE, "V", "figure 6.4",
                          within(DEAD_ZONE, _WIDTH)))  # fmt: skip
        for u in (min(THESIS), UNSEEN):
            linear, ours, most = (one.fits[name][u][0] for name in (ONE_LINEAR, WITH_EFFECTS, TRUE))
            never = ", never fitted" if u == UNSEEN else ""
            lines.append(Line(f"{head}FIT of the position at {u:.2f} V{never} (one linear model: {linear:.1f})", ours,
                              None, "%", "", above(float(np.maximum(linear, most - _AS_GOOD)))))  # fmt: skip
        alone = one.alone.ladder
        known = "dead_zone@input" in (*alone.untestable, *alone.added) or any(
            "dead_zone@input" in step.set for step in alone.steps
        )
        lines.append(Line(f"{head}from {ALONE:.2f} V alone, which cannot show a dead zone", one.alone.words, None, "",
                          "", stated("named or not testable", known)))  # fmt: skip
        return lines

    def tables(self) -> tuple[Table, ...]:
        """Parameters by amplitude, the rungs, and FIT of every model by amplitude."""
        found = []
        for one in self.machines:
            fits = [(f"{u:.2f}", *one.drift.b[u], THESIS[u].b, *one.drift.a[u], THESIS[u].a) for u in THESIS]
            header = ("u [V]", "b", "± b", "thesis: b", "a [1/s]", "± a", "thesis: a")
            runs: list[tuple[Cell, ...]] = [
                (f"{u:.2f}", *(number for name in one.fits for number in one.fits[name][u])) for u in one.records
            ]
            heads = [f"{name}, {what} [%]" for name in one.fits for what in ("position", "velocity")]
            found += [
                Table(f"{one.name}: linear fits b / (s² + a s), with standard errors", header, fits),
                one.found.table(f"{one.name}, all four amplitudes"),
                one.alone.table(f"{one.name}, {ALONE:.2f} V alone"),
                Table(f"{one.name}: FIT of the free run", ("u [V]", *heads), runs),
            ]
        return tuple(found)

    def notes(self) -> tuple[str, ...]:
        """What the machine is, and what the thesis does not tell."""
        return (
            (
                f"The machine has the thesis's dead zone of {DEAD_ZONE:g} V, the gain and the damping of its table, and"
                f" a gap of {GAP:g} rad at the potentiometer; the thesis tells neither its gap nor the length of its"
                f" records ({DURATION:g} s here). It is solved in closed form, by code that shares nothing with the"
                " models that are fitted."
            ),
            (
                "The thesis's a falls with the amplitude, which a dead zone alone does not make it do. Dry friction"
                " does: the second machine has a quarter of the dead zone as Coulomb friction."
            ),
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {**super().to_dict(), "machines": [one.to_dict() for one in self.machines]}

    def plot(self, axes: Any = None) -> Any:
        """Draw drift, FIT by amplitude and the motion at the unseen one, a row for each machine; returns the axes."""
        import matplotlib.pyplot as plt

        from idloop import drawing

        with drawing.styled():
            if axes is None:
                count = len(self.machines)
                _, axes = plt.subplots(count, 3, figsize=(11.0, 3.4 * count), layout="constrained", squeeze=False,
                                       width_ratios=(1.0, 1.0, 1.35))  # fmt: skip
            for row, one in zip(np.atleast_2d(axes), self.machines, strict=True):
                _draw_drift(row[0], one)
                _draw_fits(row[1], one)
                _draw_motion(row[2], one)
        return axes


def _draw_drift(axes: Any, one: MotorFits) -> None:
    from idloop import drawing

    amplitude = list(THESIS)
    axes.plot(amplitude, list(thesis_gains().values()), "o", color=drawing.MEASURED, label="published linear fits")
    ours = [one.drift.gain(u) for u in THESIS]
    axes.plot(amplitude, ours, "s", color=drawing.MODELS[1], mfc="none", label="linear fits here")
    fine = np.linspace(0.21, 0.46, 100)
    values = one.found.ladder.model.values
    friction = values.get("coulomb_friction@motor.level", 0.0) / values["drive.gain"]
    width = values.get("dead_zone@input.width", 0.0) + friction
    gain = values["drive.gain"] / values["motor.viscous_friction"]
    label = f"the one model: {gain:.2f} (1 − {width:.3f} V / u)"
    axes.plot(fine, gain * (1.0 - width / fine), color=drawing.MODELS[0], label=label)
    axes.set(xlabel="amplitude u [V]", ylabel="apparent gain b/a [rad/(s V)]", ylim=(0.0, None))
    axes.set_title(f"{one.name}: linear fits drift", loc="left")
    axes.legend(loc="lower right")


def _draw_fits(axes: Any, one: MotorFits) -> None:
    from idloop import drawing

    looks = ((drawing.MODELS[1], "-", "o"), (drawing.MODELS[0], "-", "o"), (drawing.MEASURED, ":", ""))
    for (name, by_amplitude), (colour, dashes, marker) in zip(one.fits.items(), looks, strict=True):
        position = [p for p, _ in by_amplitude.values()]
        axes.plot(list(by_amplitude), position, marker=marker, markersize=4, color=colour, ls=dashes, label=name)
    axes.axvspan(UNSEEN - 0.015, UNSEEN + 0.015, color=drawing.BAND, alpha=0.25, linewidth=0, label="never fitted")
    axes.set(xlabel="amplitude u [V]", ylabel="FIT of the position in free run [%]", ylim=(None, 100.0))
    axes.set_title("One model for every amplitude", loc="left")
    axes.legend(loc="lower right")


def _draw_motion(axes: Any, one: MotorFits) -> None:
    from idloop import drawing
    from idloop.validation import compare

    record = one.records[UNSEEN]
    inside = (record.time >= _SHOWN[0]) & (record.time <= _SHOWN[1])
    time = record.time[inside]
    axes.plot(time, record.output[inside, 0], ".", color=drawing.MEASURED, markersize=3, label="measured")
    for index, name in ((1, ONE_LINEAR), (0, WITH_EFFECTS)):
        free = compare(one.models[name], record).simulated[inside, 0]
        axes.plot(time, free, color=drawing.MODELS[index], label=name)
    axes.set(xlabel="time [s]", ylabel="position [rad]")
    axes.set_title(f"Free run at {UNSEEN} V, which was never fitted", loc="left")
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.15 * (high - low))
    axes.legend(loc="upper right", ncols=3)


def reproduce(seed: int, progress: Progress, parts: Sequence[str] = ()) -> DriftingFits:
    """Redo row A6.

    Parameters
    ----------
    seed : int
        Of the measurement noise.
    progress : callable
    parts : sequence of str
        Keys of `FRICTION`; all when empty.
    """
    names = [name for name in FRICTION if name in parts or not parts]
    count = len(names)
    return DriftingFits(tuple(motor_fits(name, seed, part_of(progress, i, count)) for i, name in enumerate(names)))
