"""Row A7: describing functions by theory, by simulation and from measured sines, and the limit cycles they predict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from papers import Progress
from papers.claim import below, near
from papers.log_ticks import plain_ticks
from papers.motor import lehigh_motor
from papers.motor.limit_cycle_check import CycleCheck, check_cycles
from papers.reproduction import Cell, Line, Reproduction, Table

if TYPE_CHECKING:
    from idloop.estimation.describing_functions import ClosedForm, Dwell, MeasuredDescribingFunction
    from idloop.physics import Model
    from idloop.records import Record

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

# Limits of the sine commands [V], how many, their frequency [Hz] and sample time [s], periods settled and measured.
LOW, HIGH, AMPLITUDES = 0.15, 3.0, 10
FREQUENCY, STEP, SETTLE, PERIODS = 0.5, 0.01, 3, 20
SATURATION, GAP = 0.3, 0.2
# The harmonic assumption: what goes into the element is a sine up to this share.
_SINE = 0.05
# The accuracy that is claimed, and the noise circle above which a measurement cannot tell it.
_ACCURACY = 0.05


@dataclass(frozen=True, eq=False)
class Element:
    """One nonlinearity, three ways.

    Attributes
    ----------
    name : str
    unit : str
        Of its input.
    amplitude : ndarray, shape (k,)
        At its input [unit].
    theory, simulated, measured : ndarray of complex, shape (k,)
        In closed form, by driving the simulator's effect alone, from the sines sent into the machine.
    radius : ndarray, shape (k,)
        Of the circle about the measured gain that holds the true one with 95 %.
    source_distortion, distortion : ndarray, shape (k,)
        Total harmonic distortion of what goes into the element in the machine, and of what a sine makes of it.
    """

    name: str
    unit: str
    amplitude: Array
    theory: Complex
    simulated: Complex
    measured: Complex
    radius: Array
    source_distortion: Array
    distortion: Array

    @property
    def sine(self) -> NDArray[np.bool_]:
        """Where the element is driven by a sine, so that the harmonic assumption holds."""
        return np.asarray(self.source_distortion <= _SINE)

    @property
    def clear(self) -> NDArray[np.bool_]:
        """Where the noise leaves the measurement clear enough to check it."""
        return np.asarray(self.radius <= _ACCURACY * np.abs(self.theory))

    @property
    def measured_error(self) -> Array:
        """Distance of the measured gain from theory, over theory."""
        return np.asarray(np.abs(self.measured - self.theory) / np.abs(self.theory))

    @property
    def simulated_error(self) -> Array:
        """The same of the simulated gain."""
        return np.asarray(np.abs(self.simulated - self.theory) / np.abs(self.theory))

    def where_not(self) -> str:
        """Where it is not to be relied on, in words."""

        def listed(mask: NDArray[np.bool_]) -> str:
            return ", ".join(f"{a:.3g}" for a in self.amplitude[mask])

        parts = []
        if not np.all(self.sine):
            most = 100.0 * float(np.max(self.source_distortion[~self.sine]))
            error = 100.0 * float(np.max(self.measured_error[~self.sine]))
            parts.append(
                f"at {listed(~self.sine)} {self.unit} its input is no sine (distortion up to {most:.0f} %), and the"
                f" measured gain is up to {error:.0f} % off"
            )
        hidden = self.sine & ~self.clear
        if np.any(hidden):
            parts.append(f"at {listed(hidden)} {self.unit} the noise hides the small gain")
        return "; ".join(parts) or "the harmonic assumption holds everywhere"

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        gains = {"theory": self.theory, "simulated": self.simulated, "measured": self.measured}
        return {
            "name": self.name,
            "unit": self.unit,
            "amplitude": self.amplitude,
            **{name: {"real": gain.real, "imag": gain.imag} for name, gain in gains.items()},
            "radius": self.radius,
            "source_distortion": self.source_distortion,
            "distortion": self.distortion,
            "sine": self.sine,
            "clear": self.clear,
        }


@dataclass(frozen=True, eq=False)
class DescribingFunctions(Reproduction):
    """Describing functions of the thesis's nonlinearities, and limit cycles of loops around them.

    Attributes
    ----------
    elements : tuple of Element
    printed : float
        Eq. 6.2 as printed, at A/M = 0.5.
    complete : complex
        The backlash's answer to a sine there, by simulation.
    cycles : tuple of CycleCheck
    """

    elements: tuple[Element, ...]
    printed: float
    complete: complex
    cycles: tuple[CycleCheck, ...]

    def rows(self) -> tuple[Line, ...]:
        """Largest errors, eq. 6.2, and the limit cycles."""
        lines = []
        for element in self.elements:
            simulated = float(np.max(element.simulated_error))
            good = element.sine & element.clear
            measured = float(np.max(element.measured_error[good])) if np.any(good) else float("nan")
            missed = "do not match" if element.name.startswith("backlash") else None
            lines += [
                Line(f"{element.name}: simulation off theory by at most", 100.0 * simulated, None, "%", "eq. 6.1, 6.2",
                     below(100.0 * _ACCURACY)),
                Line(f"{element.name}: measured off theory by at most, {int(good.sum())} of {good.size} amplitudes",
                     100.0 * measured, missed, "%", "chapter 8", below(100.0 * _ACCURACY)),
            ]  # fmt: skip
        ours = self.complete
        lines += [
            Line("backlash at A/M = 0.5: real part", ours.real, self.printed, "", "eq. 6.2", near(self.printed, 0.01)),
            Line("backlash at A/M = 0.5: imaginary part", ours.imag, "not printed", "", "eq. 6.2"),
            Line("backlash at A/M = 0.5: phase", float(np.degrees(np.angle(ours))), "not printed", "deg", "eq. 6.2"),
        ]  # fmt: skip
        for cycle in self.cycles:
            lines += cycle.lines()
        return tuple(lines)

    def tables(self) -> tuple[Table, ...]:
        """Every amplitude of every element, and every loop."""
        points: list[Sequence[Cell]] = []
        for e in self.elements:
            for k in range(e.amplitude.size):
                gains = [
                    part
                    for gain in (e.theory[k], e.simulated[k], e.measured[k])
                    for part in (abs(gain), float(np.degrees(np.angle(gain))))
                ]
                seen = "no sine" if not e.sine[k] else "noise" if not e.clear[k] else "yes"
                points.append((e.name, f"{e.amplitude[k]:.4g} {e.unit}", *gains,
                               100.0 * float(e.source_distortion[k]), seen))  # fmt: skip
        header = ("element", "amplitude", "|N| theory", "deg", "|N| simulated", "deg", "|N| measured", "deg",
                  "input distortion %", "counts")  # fmt: skip
        loops = Table("Limit cycles", CycleCheck.HEADER, [cycle.cells() for cycle in self.cycles])
        return Table("Describing functions", header, points), loops

    def notes(self) -> tuple[str, ...]:
        """Why the thesis could not match them, and where the harmonic assumption ends."""
        return (
            (
                "The thesis subtracts amplitudes and phases of linear models that were fitted with and without the"
                " coupling and calls that -1/N. N is the ratio of the first harmonics on its two sides: the"
                " tachometer, integrated, tells what goes into the coupling and the potentiometer what comes out."
            ),
            "Eq. 6.2 is the real part alone; the phase that it leaves out makes the loop with backlash oscillate.",
            *(f"{element.name}: {element.where_not()}." for element in self.elements),
            (
                "A sine that is sent into the open machine is one at the element, up to the distortion in the table;"
                " a square wave (row A5) and a loop that rests in its dead zone (row A8) show where that ends."
            ),
            *(cycle.words for cycle in self.cycles if cycle.words),
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            **super().to_dict(),
            "elements": [element.to_dict() for element in self.elements],
            "backlash_at_half": {"real": self.complete.real, "imag": self.complete.imag, "printed": self.printed},
            "limit_cycles": [cycle.to_dict() for cycle in self.cycles],
        }

    def plot(self, axes: Any = None) -> Any:
        """Draw size and phase of N, -1/N against G, and the limit cycles; returns the matplotlib axes, shape (2, 2)."""
        import matplotlib.pyplot as plt

        from idloop import drawing

        with drawing.styled():
            if axes is None:
                _, axes = plt.subplots(2, 2, figsize=(10.0, 7.5), layout="constrained")
            for index, e in enumerate(self.elements):
                colour = drawing.MODELS[index]
                order = np.argsort(e.amplitude)
                for ax, part in ((axes[0, 0], np.abs), (axes[1, 0], _degrees)):
                    ax.semilogx(e.amplitude[order], part(e.theory[order]), color=colour, linewidth=0.9)
                    ax.semilogx(e.amplitude, part(e.simulated), "x", color=colour, markersize=7)
                    for mask, fill in ((e.sine & e.clear, colour), (~(e.sine & e.clear), "none")):
                        ax.semilogx(e.amplitude[mask], part(e.measured[mask]), "o", color=colour, markersize=4,
                                    markerfacecolor=fill)  # fmt: skip
                axes[0, 0].plot([], [], color=colour, label=f"{e.name} [{e.unit}]")
            axes[0, 0].plot([], [], "x", color=drawing.COMMAND, label="simulated")
            axes[0, 0].plot([], [], "o", color=drawing.COMMAND, markersize=4, label="measured, open: does not count")
            axes[0, 0].set_ylabel(drawing.label("|N|", None))
            axes[0, 0].legend(fontsize=6)
            plain_ticks(axes[0, 0].xaxis, axes[1, 0].xaxis)
            axes[1, 0].set_ylabel(drawing.label("phase of N", "deg"))
            axes[1, 0].set_xlabel(drawing.label("amplitude at the element", "V, rad"))
            drawn = [cycle for cycle in self.cycles if cycle.found.cycles] or list(self.cycles)
            drawn[0].found.plot(axes[0, 1])
            axes[0, 1].set_title(drawn[0].name)
            # Around the cycle that the loop settles on: the other meeting lies far out.
            reach = 2.5 * max([abs(cycle.point) for cycle in drawn[0].found.stable], default=1.0)
            axes[0, 1].set(xlim=(-reach, 0.2 * reach), ylim=(-reach, 0.2 * reach))
            axes[0, 1].legend(fontsize=6)
            several = [cycle for cycle in self.cycles if cycle.predicted is not None]
            place = np.arange(len(several))
            bars = (
                ("predicted", [c.predicted.amplitude for c in several if c.predicted], -0.25),
                ("element simulated", [c.loop.amplitude for c in several if c.loop], 0.0),
                ("machine simulated", [c.machine_amplitude for c in several], 0.25),
            )
            for index, (label, values, shift) in enumerate(bars):
                axes[1, 1].barh(place + shift, values, 0.25, color=drawing.MODELS[index], label=label)
            axes[1, 1].set(yticks=place, xlabel=drawing.label("amplitude of the limit cycle", "rad, V"))
            axes[1, 1].set_yticklabels([c.name.replace(", ", "\n", 1) for c in several], fontsize=7)
            axes[1, 1].invert_yaxis()
            axes[1, 1].legend(fontsize=6)
        return axes


def _degrees(gain: Complex) -> Array:
    return np.asarray(np.degrees(np.angle(gain)), dtype=float)


def printed_backlash(ratio: float) -> float:
    """Eq. 6.2 of the thesis as printed, with k = 1.

    Parameters
    ----------
    ratio : float
        A/M, half the gap over the amplitude.
    """
    inner = (2.0 - 1.0 / ratio) / (1.0 / ratio)
    angle = np.arcsin(inner)
    return float(0.5 * (1.0 - 2.0 / np.pi * (angle + inner * np.cos(angle))))


def reproduce(
    seed: int, progress: Progress, amplitudes: int = AMPLITUDES, loops: Sequence[str] | None = None
) -> DescribingFunctions:
    """Compute, simulate and measure describing functions, and check the limit cycles that they predict.

    Parameters
    ----------
    seed : int
        Of the measurement noise.
    progress : callable
    amplitudes : int
        Of the sines, 2 or more.
    loops : sequence of str, optional
        Names of the loops to check, of `limit_cycle_check.LOOPS`; all by default.
    """
    import control
    from idloop.estimation.describing_functions import (
        DeadZone,
        FrictionBacklash,
        Saturation,
        drive_by_sine,
        measure_describing_function,
    )

    levels = np.geomspace(LOW, HIGH, amplitudes)
    motor = control.tf([lehigh_motor.B], [1.0, lehigh_motor.A])
    width = lehigh_motor.DEAD_ZONE
    dead_zone, backlash = f"dead_zone@input(width={width})", f"backlash@position[motor](gap={GAP})"
    cases: tuple[tuple[str, ClosedForm, list[str], str], ...] = (
        ("dead zone", DeadZone(width), [dead_zone], "V"),
        ("saturation", Saturation(SATURATION), [f"saturation@input(limit={SATURATION})"], "V"),
        ("backlash", FrictionBacklash(GAP), [backlash], "rad"),
        ("backlash behind the dead zone", FrictionBacklash(GAP), [dead_zone, backlash], "rad"),
    )
    elements = []
    for index, (name, element, effects, unit) in enumerate(cases):
        progress(0.1 * index, name)
        plant = lehigh_motor.motor(effects=effects)
        records, dwells = _sines(plant, levels, seed + 100 * index)
        speed = measure_describing_function(records, None, "motor.velocity", dwells)
        if unit == "V":
            measured = speed.without(motor)
        else:
            # Between tachometer and potentiometer lie an integrator and the coupling, in this order.
            turned = measure_describing_function(records, "motor.velocity", "motor.position", dwells)
            measured = replace(
                turned.without(control.tf([1.0], [1.0, 0.0])),
                amplitude=turned.amplitude / (2.0 * np.pi * turned.frequency),
                source_distortion=_integrated(speed),
            )
        elements.append(_compared(name, unit, element, measured))
    half = drive_by_sine(FrictionBacklash(GAP), GAP, FREQUENCY).gain
    progress(0.4, "limit cycles")
    cycles = check_cycles(loops, lambda share, text: progress(0.4 + 0.6 * share, text))
    return DescribingFunctions(tuple(elements), printed_backlash(0.5), half, cycles)


def _integrated(speed: MeasuredDescribingFunction) -> Array:
    """Distortion of a position whose speed was measured: each harmonic loses as many times as its order."""
    position = speed.harmonics / np.arange(2, 2 + speed.harmonics.shape[1])
    return np.asarray(np.sqrt(np.nansum(position**2, axis=1)))


def _compared(name: str, unit: str, element: ClosedForm, measured: MeasuredDescribingFunction) -> Element:
    from idloop.estimation.describing_functions import describing_function

    # Amplitudes that do not reach past the threshold pass nothing, which no ratio can be taken to.
    past = measured.amplitude > 1.02 * element.threshold if name != "saturation" else measured.amplitude > 0.0
    amplitude = measured.amplitude[past]
    simulated = describing_function(element, amplitude, numerical=True)
    return Element(
        name=name,
        unit=unit,
        amplitude=amplitude,
        theory=element.gain(amplitude),
        simulated=simulated.gain,
        measured=measured.gain[past],
        radius=measured.radius[past],
        source_distortion=measured.source_distortion[past],
        distortion=simulated.distortion,
    )


def _sines(plant: Model, levels: Array, seed: int) -> tuple[list[Record], list[Sequence[Dwell]]]:
    """Sines of every amplitude sent into the machine: one record each, and where they are settled."""
    from idloop.diagnosis.design.experiment import Experiment
    from idloop.estimation.describing_functions import dwells_of

    records: list[Record] = []
    dwells: list[Sequence[Dwell]] = []
    for index, level in enumerate(levels):
        signal = {
            "name": "stepped_sine",
            "sample_time": STEP,
            "amplitude": float(level),
            "frequencies": [FREQUENCY],
            "periods": PERIODS,
            "settle_periods": SETTLE,
        }
        experiment = Experiment(signal)
        records.append(experiment.run(plant, noise=True, seed=seed + index, name=f"sine {level:.3g} V"))
        dwells.append(dwells_of(experiment.built))
    return records, dwells
