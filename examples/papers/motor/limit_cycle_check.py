"""Limit cycles of the motor's loop: predicted by describing functions, and in two simulations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from papers import Progress
from papers.claim import near, stated
from papers.motor import lehigh_motor
from papers.reproduction import Cell, Line

if TYPE_CHECKING:
    from idloop.estimation.describing_functions import ClosedForm, LimitCycle, LimitCycles, LoopSimulation

Array = NDArray[np.float64]

# Sample time of the controller [s], length of the run and the part of it that is looked at [s].
STEP, SECONDS, LOOKED_AT = 0.001, 60.0, 20.0
KICK = 1.0
GAP, SATURATION, LAG = 0.2, 0.3, 0.1
_ACCURACY = 0.05
# The prediction rests on a sine at the element: with more harmonics there than this, nothing is claimed.
_HARMONICS = 0.02
# An oscillation below this share of the kick counts as none.
_SILENT = 1e-2


@dataclass(frozen=True)
class Loop:
    """A P controller around the motor and one nonlinearity.

    Attributes
    ----------
    name : str
    element : str
        "backlash", "dead zone" or "saturation".
    gain : float
        Of the controller [V/rad].
    lag : float
        Time constant of the drive [s].
    """

    name: str
    element: str
    gain: float
    lag: float = 0.0


# The thesis's loop turns volts of the potentiometer into radians with another scale than it has: section 6.2.1.
_THESIS_GAIN = lehigh_motor.CONTROLLER_GAIN * lehigh_motor.CORRECTION / lehigh_motor.POTENTIOMETER

LOOPS = (
    Loop("backlash, the thesis's P", "backlash", _THESIS_GAIN),
    Loop("dead zone, the thesis's P", "dead zone", _THESIS_GAIN),
    Loop("backlash, P 5", "backlash", 5.0),
    Loop("backlash, P 10", "backlash", 10.0),
    Loop("backlash, P 20", "backlash", 20.0),
    Loop("saturation, P 5, drive lag 0.1 s", "saturation", 5.0, LAG),
    Loop("saturation, P 30, drive lag 0.1 s", "saturation", 30.0, LAG),
)


@dataclass(frozen=True, eq=False)
class CycleCheck:
    """One loop.

    Attributes
    ----------
    name, unit : str
        Unit of the element's input.
    found : LimitCycles
        All meetings of -1/N with G.
    predicted : LimitCycle or None
        The stable one.
    loop : LoopSimulation or None
        Element and linear part alone, started on the prediction.
    machine_amplitude, machine_frequency : float
        First harmonic at the element's input of the whole machine under its sampled controller, after a kick [unit,
        Hz]; 0 and NaN where it comes to rest.
    """

    HEADER: ClassVar[tuple[str, ...]] = (
        "loop", "predicted A", "f [Hz]", "element simulated A", "f [Hz]", "machine A", "f [Hz]", "harmonics %",
    )  # fmt: skip

    name: str
    unit: str
    found: LimitCycles
    predicted: LimitCycle | None
    loop: LoopSimulation | None
    machine_amplitude: float
    machine_frequency: float

    @property
    def words(self) -> str:
        """Where the harmonic assumption ends, and other meetings of the curves, in words."""
        others = [cycle for cycle in self.found.cycles if not cycle.stable]
        if self.predicted is not None and self.predicted.harmonics >= _HARMONICS:
            share = 100.0 * self.predicted.harmonics
            return f"{self.name}: {share:.1f} % of harmonics reach the element, so the prediction is rough."
        if not others:
            return ""
        listed = ", ".join(f"{c.amplitude:.3g} {self.unit} at {c.frequency:.3g} Hz" for c in others)
        return f"{self.name}: an unstable meeting as well ({listed}), below which the loop comes to rest."

    def lines(self) -> list[Line]:
        """Prediction beside the machine."""
        source = "chapter 3"
        if self.predicted is None:
            rests = self.machine_amplitude == 0.0
            said = "comes to rest" if rests else f"oscillates, {self.machine_amplitude:.3g} {self.unit}"
            quantity = f"{self.name}: no limit cycle predicted; the machine"
            return [Line(quantity, said, None, "", source, stated("rests", rests))]
        errors = (
            ("amplitude", self.machine_amplitude / self.predicted.amplitude - 1.0),
            ("frequency", self.machine_frequency / self.predicted.frequency - 1.0),
        )
        sine = self.predicted.harmonics < _HARMONICS
        return [
            Line(f"{self.name}: {what} of the machine's limit cycle off the prediction by", 100.0 * error, None, "%",
                 source, near(0.0, 100.0 * _ACCURACY) if sine else None)
            for what, error in errors
        ]  # fmt: skip

    def cells(self) -> tuple[Cell, ...]:
        """One line of a table."""
        p, loop = self.predicted, self.loop
        machine = (self.machine_amplitude, self.machine_frequency)
        if p is None or loop is None:
            return (self.name, "none", None, None, None, *machine, None)
        return (self.name, p.amplitude, p.frequency, loop.amplitude, loop.frequency, *machine, 100.0 * p.harmonics)

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            "name": self.name,
            "unit": self.unit,
            "predicted": [cycle.to_dict() for cycle in self.found.cycles],
            "element_simulated": None if self.loop is None else self.loop.to_dict(),
            "machine": {"amplitude": self.machine_amplitude, "frequency": self.machine_frequency},
        }


def check_cycles(names: Sequence[str] | None, progress: Progress) -> tuple[CycleCheck, ...]:
    """Predict and simulate the loops.

    Parameters
    ----------
    names : sequence of str, optional
        Of `LOOPS`; all by default.
    progress : callable
    """
    chosen = [loop for loop in LOOPS if names is None or loop.name in names]
    found = []
    for index, loop in enumerate(chosen):
        progress(index / len(chosen), loop.name)
        found.append(_checked(loop))
    return tuple(found)


def _checked(loop: Loop) -> CycleCheck:
    import control
    from idloop.estimation.describing_functions import limit_cycles, simulate_loop

    element, unit, _ = _element(loop)
    linear = control.tf([loop.gain * lehigh_motor.B], [1.0, lehigh_motor.A, 0.0])
    if loop.lag > 0.0:
        linear *= control.tf([1.0], [loop.lag, 1.0])
    # The sampled controller holds its command: on the average it is half a sample late.
    late = 0.5 * STEP
    found = limit_cycles(linear, element, delay=late, unit=unit)
    predicted = found.stable[0] if found.stable else None
    alone = None if predicted is None else simulate_loop(linear, element, predicted, delay=late)
    amplitude, frequency = _machine(loop)
    return CycleCheck(loop.name, unit, found, predicted, alone, amplitude, frequency)


def _element(loop: Loop) -> tuple[ClosedForm, str, str]:
    """Closed form, unit of its input, and the effect of the model."""
    from idloop.estimation.describing_functions import DeadZone, FrictionBacklash, Saturation

    width = lehigh_motor.DEAD_ZONE
    known: dict[str, tuple[ClosedForm, str, str]] = {
        "backlash": (FrictionBacklash(GAP), "rad", f"backlash@position[motor](gap={GAP})"),
        "dead zone": (DeadZone(width), "V", f"dead_zone@input(width={width})"),
        "saturation": (Saturation(SATURATION), "V", f"saturation@input(limit={SATURATION})"),
    }
    return known[loop.element]


def _machine(loop: Loop) -> tuple[float, float]:
    """Amplitude at the element's input and frequency [Hz] of the machine, long after a step of its reference."""
    from idloop.diagnosis.design.experiment import Experiment

    _, unit, effect = _element(loop)
    lag = [f"actuator_lag@input(time_constant={loop.lag})"] if loop.lag > 0.0 else []
    plant = lehigh_motor.motor(effects=[effect, *lag])
    experiment = Experiment(
        {"name": "step", "sample_time": STEP, "amplitude": KICK, "duration": SECONDS},
        adds_to="reference",
        controller={"type": "p", "output": "motor.position", "kp": loop.gain, "sample_time": STEP},
    )
    record = experiment.run(plant)
    # The tachometer sits before the coupling: integrated it is what goes into the backlash.
    signal = record.output[:, 1] if unit == "rad" else record.input_at(record.time)
    size, frequency = _oscillation(record.time, signal, loop.gain * KICK if unit == "V" else KICK)
    return (size / (2.0 * np.pi * frequency) if unit == "rad" and size else size), frequency


def _oscillation(time: Array, signal: Array, scale: float) -> tuple[float, float]:
    """First harmonic of the last part of a run, and its frequency [Hz]; 0 and NaN where it is at rest."""
    from idloop.estimation.describing_functions.sine_fit import refine_frequency, sine_fit

    last = time >= time[-1] - LOOKED_AT
    t, x = time[last], signal[last] - signal[last].mean()
    if float(np.ptp(x)) < _SILENT * scale:
        return 0.0, float("nan")
    spectrum = np.abs(np.fft.rfft(x * np.hanning(x.size)))
    guess = float(np.argmax(spectrum[1:]) + 1) / (x.size * float(t[1] - t[0]))
    frequency = refine_frequency(t, x, guess)
    return abs(sine_fit(t, x, frequency, 5).phasors[0]), frequency
