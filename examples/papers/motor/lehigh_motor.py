"""The DC motor of Rungroungdouyboon (Lehigh 1999): what the thesis publishes of it, and its simulated twin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from idloop.estimation.black_box.sampled import SampledData
    from idloop.estimation.linear import LinearModel
    from idloop.physics import Model
    from idloop.records import Record

Array = NDArray[np.float64]

# Eq. 7.1 and 7.2, position [rad] over command [V]: b / (s^2 + a s).
B, A = 8.2550, 2.3060
# Appendix B.2.1, present(): standard deviations, loss function, Akaike's FPE, innovation variances [rad^2, rad^2/s^2].
B_STDERR, A_STDERR = 0.0513, 0.0158
LOSS, FPE = 5.607e-6, 5.6445e-6
VARIANCES = (0.0011, 0.0053)
FREE = 2
# Section 6.1.2: square wave of 0.25 V and 0.5 Hz, read every 0.1 s.
SQUARE_AMPLITUDE, SQUARE_FREQUENCY, SAMPLE_TIME = 0.25, 0.5, 0.1
# Figure 6.4 and the text above it: dead zone of the motor [V].
DEAD_ZONE = 0.12
# Chapter 5: scales of potentiometer [rad/V] and tachometer [rad/s/V], and the sensors that they come from.
POTENTIOMETER, TACHOMETER = 0.1787, 1.1636
POTENTIOMETER_DEGREES, POTENTIOMETER_VOLTS, SUPPLY_VOLTS = 150.0, 14.65, 15.0
TACHOMETER_VOLTS_PER_KRPM, GEAR_RATIO = 3.0, 30.0
# Section 6.2: closed loop with a P controller, the correction of the potentiometer's voltage, and its sine.
CONTROLLER_GAIN, CORRECTION = 0.1684, 0.1745
SINE_AMPLITUDE, SINE_FROM, SINE_TO = 1.5, 0.2992, 3.1416


@dataclass(frozen=True)
class BacklashFit:
    """A linear fit of the thesis with the backlash coupling in place (appendix B.3).

    Attributes
    ----------
    b, a : float
        Eq. 7.3 to 7.10.
    position, velocity : float
        Variances of what the fit leaves over [rad^2, rad^2/s^2].
    """

    b: float
    a: float
    position: float
    velocity: float


# By amplitude of the square wave [V].
WITH_BACKLASH = {
    0.23: BacklashFit(8.4290, 1.6747, 0.00666860514538, 0.00597476364941),
    0.30: BacklashFit(9.2629, 1.5843, 0.01023120561703, 0.00296180083760),
    0.35: BacklashFit(9.8497, 1.5252, 0.01205077163123, 0.00199827894082),
    0.40: BacklashFit(10.1907, 1.4421, 0.01340543573467, 0.00235837499325),
}


def samples() -> int:
    """Length of the thesis's record, which it does not tell: FPE / loss = (1 + d/N) / (1 - d/N) with d = 2 does."""
    return round(FREE * (FPE + LOSS) / (FPE - LOSS))


def coupled_plant() -> tuple[float, float]:
    """Parameters b and a of the motor with the coupling on it, once the dead zone is a part of the model.

    The thesis's linear fits take the dead zone for a smaller gain: b / a = K (1 - width / u). K and a are the means
    of what its four fits say.
    """
    gains = [fit.b / fit.a / (1.0 - DEAD_ZONE / amplitude) for amplitude, fit in WITH_BACKLASH.items()]
    a = float(np.mean([fit.a for fit in WITH_BACKLASH.values()]))
    return float(np.mean(gains)) * a, a


def motor(b: float = B, a: float = A, effects: Sequence[str] = ()) -> Model:
    """The preset with the thesis's noise and other numbers where asked, without a controller.

    Parameters
    ----------
    b, a : float
        Of b / (s^2 + a s).
    effects : sequence of str
        As ``"dead_zone@input(width=0.12)"``.
    """
    from idloop.physics import load_model

    preset = load_model("dc_motor")
    noisy = tuple(replace(o, noise=float(v) ** 0.5) for o, v in zip(preset.outputs, VARIANCES, strict=True))
    bare = replace(preset, outputs=noisy, controller=None)
    return bare.with_values({"drive.gain": b, "motor.viscous_friction": a}).with_effects(effects)


def square_wave(model: Model, amplitude: float, count: int, seed: int) -> Record:
    """The thesis's experiment: a square wave from rest, `count` samples of both sensors with noise.

    Parameters
    ----------
    model : Model
    amplitude : float
        [V]
    count, seed : int
    """
    from idloop.diagnosis.design.experiment import Experiment

    signal = {
        "name": "square",
        "sample_time": SAMPLE_TIME,
        "duration": (count - 1) * SAMPLE_TIME,
        "amplitude": amplitude,
        "frequency": SQUARE_FREQUENCY,
    }
    return Experiment(signal).run(model, noise=True, seed=seed, name=f"square {amplitude:g} V")


def toolbox_fit(data: Sequence[SampledData]) -> LinearModel:
    """Fit b and a as the thesis's program does (appendix B.1): both outputs, no Kalman gain, at rest at first."""
    from idloop.estimation.linear import fit_structure

    def structure(a: float, b: float) -> tuple[list[list[float]], list[list[float]], Array, Array]:
        return [[0.0, 1.0], [0.0, -a]], [[0.0], [b]], np.eye(2), np.zeros((2, 1))

    # The start is the program's th_guess.
    return fit_structure(data, structure, {"a": 1.0, "b": 0.28}, continuous=True, initial=False)


def values(model: LinearModel) -> dict[str, tuple[float, float]]:
    """Estimate and standard error by name."""
    return {c.name: (c.value, c.stderr) for c in model.coefficients}
