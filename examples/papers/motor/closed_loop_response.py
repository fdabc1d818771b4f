"""Row A8: amplitude against frequency of the closed loop, by theory and by a simulated experiment."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from papers import Progress
from papers.claim import below
from papers.log_ticks import plain_ticks
from papers.motor import lehigh_motor
from papers.reproduction import Cell, Line, Reproduction, Table

if TYPE_CHECKING:
    from idloop.physics import Model

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

# Frequencies between the thesis's ends, periods settled and measured, sample time of loop and record [s].
FREQUENCIES, SETTLE, PERIODS, STEP = 12, 3, 4, 0.01
# What the potentiometer's radians become on their way to the comparison: volts, then the correction constant.
FEEDBACK = lehigh_motor.CORRECTION / lehigh_motor.POTENTIOMETER
# Range of section 6.2.1, and end of figure 7.8's axis [V].
RANGE_VOLTS, AXIS_VOLTS = 10.0, 14.0
# A gap beside that of row A5 [rad], to show what lost motion does to the loop.
WIDE_GAP = 1.0
_ACCURACY, _SINE = 0.05, 0.05


@dataclass(frozen=True)
class LoopCase:
    """A motor in the loop.

    Attributes
    ----------
    name : str
    b, a : float
        Of b / (s² + a s).
    width : float
        Dead zone [V]; 0 for none.
    gap : float
        Backlash before the potentiometer [rad]; 0 for none.
    """

    name: str
    b: float
    a: float
    width: float = 0.0
    gap: float = 0.0

    def machine(self) -> Model:
        """The motor to simulate."""
        effects = [f"dead_zone@input(width={self.width})"] if self.width > 0.0 else []
        effects += [f"backlash@position[motor](gap={self.gap})"] if self.gap > 0.0 else []
        return lehigh_motor.motor(self.b, self.a, effects)


@dataclass(frozen=True, eq=False)
class LoopResponse:
    """Response of one loop.

    Attributes
    ----------
    case : LoopCase
    omega : ndarray, shape (k,)
        [rad/s]
    theory, measured : ndarray of complex, shape (k,)
        First harmonic of the potentiometer's voltage [V], against the sine of the reference.
    radius : ndarray, shape (k,)
        Of the circle about `measured` that holds the true one with 95 % [V].
    distortion : ndarray, shape (k,)
        Largest total harmonic distortion of what goes into the nonlinear elements.
    curve : tuple of two ndarray
        More frequencies [rad/s] and the amplitude by theory at them [V], to draw.
    """

    case: LoopCase
    omega: Array
    theory: Complex
    measured: Complex
    radius: Array
    distortion: Array
    curve: tuple[Array, Array]

    @property
    def error(self) -> Array:
        """Amplitude of the experiment over that of theory, less 1; NaN where theory lets nothing pass."""
        size = np.abs(self.theory)
        return np.asarray(np.abs(self.measured) / np.where(size > 0.0, size, np.nan) - 1.0)

    @property
    def counts(self) -> NDArray[np.bool_]:
        """Where the elements are driven by sines, something passes, and the noise lets it be seen."""
        clear = self.radius <= _ACCURACY * np.abs(self.theory)
        return np.asarray((self.distortion <= _SINE) & clear & (np.abs(self.theory) > 0.0))

    def words(self) -> str:
        """Where theory is not to be relied on; empty where it is everywhere."""
        bad = self.distortion > _SINE
        if not np.any(bad):
            return ""
        listed = ", ".join(f"{w:.3g}" for w in self.omega[bad])
        off = self.error[bad & np.isfinite(self.error)]
        worst = f"up to {100.0 * float(np.max(np.abs(off))):.0f} % off" if off.size else "silent"
        return (
            f"{self.case.name}: at {listed} rad/s what goes into an element is no sine (distortion up to"
            f" {100.0 * float(np.max(self.distortion[bad])):.0f} %) and describing functions are {worst}."
        )

    def table(self) -> Table:
        """Amplitude against frequency."""
        header = ("ω [rad/s]", "theory [V]", "experiment [V]", "off by %", "input distortion %", "counts")
        rows: list[Sequence[Cell]] = [
            (
                float(self.omega[k]),
                float(abs(self.theory[k])),
                float(abs(self.measured[k])),
                100.0 * float(self.error[k]),
                100.0 * float(self.distortion[k]),
                "yes" if self.counts[k] else "no sine" if self.distortion[k] > _SINE else "noise",
            )
            for k in range(self.omega.size)
        ]
        return Table(f"{self.case.name}: amplitude of the potentiometer's voltage", header, rows)

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            "name": self.case.name,
            "b": self.case.b,
            "a": self.case.a,
            "dead_zone": self.case.width,
            "gap": self.case.gap,
            "frequency": self.omega,
            "theory": {"real": self.theory.real, "imag": self.theory.imag},
            "measured": {"real": self.measured.real, "imag": self.measured.imag},
            "radius": self.radius,
            "distortion": self.distortion,
            "counts": self.counts,
        }


@dataclass(frozen=True, eq=False)
class ClosedLoopResponse(Reproduction):
    """The thesis's closed-loop test on several motors.

    Attributes
    ----------
    responses : tuple of LoopResponse
        The linear motor first.
    in_radians : float
        Amplitude at the lowest frequency if the angle itself were multiplied by the correction constant [rad].
    """

    responses: tuple[LoopResponse, ...]
    in_radians: float

    def rows(self) -> tuple[Line, ...]:
        """Agreement of theory and experiment in every loop, and the sizes."""
        linear = self.responses[0]
        low, high = linear.omega[0], linear.omega[-1]
        most = float(np.max(np.abs(linear.measured)))
        lines = [
            Line("linear: largest amplitude", most, f"within {RANGE_VOLTS:g}", "V", "section 6.2.1",
                 below(RANGE_VOLTS)),
            Line(f"linear: amplitude at {low:.4g} rad/s", float(abs(linear.measured[0])), "figure 7.8", "V"),
            Line(f"linear: amplitude at {high:.4g} rad/s", float(abs(linear.measured[-1])), "figure 7.8", "V"),
        ]  # fmt: skip
        for response in self.responses:
            counts = response.counts
            worst = float(np.max(np.abs(response.error[counts]))) if np.any(counts) else float("nan")
            said = f"experiment off theory by at most, {int(counts.sum())} of {counts.size} frequencies"
            name = response.case.name
            lines.append(Line(f"{name}: {said}", 100.0 * worst, "they look similar", "%", "figures 7.8, 7.9",
                              below(100.0 * _ACCURACY)))  # fmt: skip
        for response in self.responses[1:]:
            top = int(np.argmax(np.abs(response.measured)))
            lines.append(Line(f"{response.case.name}: largest amplitude, at {response.omega[top]:.3g} rad/s",
                              float(abs(response.measured[top])), f"axis up to {AXIS_VOLTS:g}", "V", "figure 7.8",
                              below(AXIS_VOLTS)))  # fmt: skip
        return tuple(lines)

    def tables(self) -> tuple[Table, ...]:
        """Amplitude against frequency of every loop."""
        return tuple(response.table() for response in self.responses)

    def notes(self) -> tuple[str, ...]:
        """How the thesis's loop is read, and where theory ends."""
        end = np.radians(lehigh_motor.POTENTIOMETER_DEGREES)
        return (
            (
                "The correction constant turns the potentiometer's volts into radians (section 6.2.1), so the loop"
                f" feeds back {FEEDBACK:.4f} of the angle, and the result is the voltage. Were the angle itself"
                f" multiplied by it, the sine of {lehigh_motor.SINE_AMPLITUDE:g} V would swing the shaft by"
                f" {self.in_radians:.2f} rad at the lowest frequency; the potentiometer ends at {end:.2f} rad."
            ),
            (
                "The loop of eq. 7.1 has no hump. The motor with the coupling on it is less damped and has one, and"
                " lost motion before the potentiometer, which figure 6.6 has in the loop, raises it. Figures 7.8 and"
                " 7.9 are drawn, without numbers."
            ),
            *(text for text in (response.words() for response in self.responses) if text),
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            **super().to_dict(),
            "feedback": FEEDBACK,
            "responses": [response.to_dict() for response in self.responses],
            "in_radians": self.in_radians,
        }

    def plot(self, axes: Any = None) -> Any:
        """Draw amplitude against frequency on linear and on logarithmic axes; returns the two matplotlib axes."""
        import matplotlib.pyplot as plt

        from idloop import drawing

        with drawing.styled():
            if axes is None:
                _, axes = plt.subplots(1, 2, figsize=(10.0, 4.5), layout="constrained")
            for ax in axes:
                for index, r in enumerate(self.responses):
                    colour = drawing.MODELS[index]
                    ax.plot(*r.curve, color=colour, label=f"{r.case.name}, theory")
                    for mask, fill in ((r.counts, colour), (~r.counts, "none")):
                        ax.plot(r.omega[mask], np.abs(r.measured[mask]), "o", color=colour, markerfacecolor=fill,
                                markersize=4)  # fmt: skip
                ax.set_xlabel(drawing.label("frequency", "rad/s"))
                ax.set_ylabel(drawing.label("amplitude of the potentiometer", "V"))
            axes[1].set(xscale="log", yscale="log")
            plain_ticks(axes[1].xaxis, axes[1].yaxis)
            least = min(float(np.min(np.abs(r.measured))) for r in self.responses)
            axes[1].set_ylim(bottom=max(0.5 * least, 0.05))
            for fill, label in (("full", "simulated experiment"), ("none", "the same, harmonics or noise too large")):
                axes[0].plot([], [], "o", color=drawing.COMMAND, fillstyle=fill, markersize=4, label=label)
            axes[0].legend(fontsize=6)
        return axes


def reproduce(seed: int, progress: Progress, frequencies: int = FREQUENCIES) -> ClosedLoopResponse:
    """Run the closed-loop test in simulation, and solve the loop by harmonic balance.

    Parameters
    ----------
    seed : int
        Of the measurement noise.
    progress : callable
    frequencies : int
        2 or more, between the thesis's ends.
    """
    from papers.motor.dead_zone_and_backlash import chosen_gap

    omega = np.geomspace(lehigh_motor.SINE_FROM, lehigh_motor.SINE_TO, frequencies)
    fine = np.geomspace(omega[0], omega[-1], 4 * frequencies)
    progress(0.0, "gap of row A5")
    gap, (b, a) = chosen_gap(seed), lehigh_motor.coupled_plant()
    cases = (
        LoopCase("linear", lehigh_motor.B, lehigh_motor.A),
        LoopCase("linear, motor of row A5", b, a),
        LoopCase(f"backlash {gap:.2g} rad", b, a, gap=gap),
        LoopCase(f"backlash {WIDE_GAP:g} rad", b, a, gap=WIDE_GAP),
        LoopCase(f"dead zone, backlash {gap:.2g} rad", b, a, lehigh_motor.DEAD_ZONE, gap),
    )
    responses = []
    for index, case in enumerate(cases):
        progress(0.3 + 0.7 * index / len(cases), case.name)
        theory = harmonic_balance(case, omega)
        measured, radius, distortion = _experiment(case, omega, seed + 1 + index)
        drawn = (fine, np.abs(harmonic_balance(case, fine)))
        responses.append(LoopResponse(case, omega, theory, measured, radius, distortion, drawn))
    radians = harmonic_balance(cases[0], omega[:1], lehigh_motor.CORRECTION) * lehigh_motor.POTENTIOMETER
    return ClosedLoopResponse(tuple(responses), float(abs(radians[0])))


def harmonic_balance(case: LoopCase, omega: Array, feedback: float = FEEDBACK) -> Complex:
    """First harmonic of the potentiometer's voltage by describing functions of dead zone and backlash.

    Parameters
    ----------
    case : LoopCase
    omega : ndarray, shape (k,)
        [rad/s], growing.
    feedback : float
        From the angle to the comparison [V/rad].

    Returns
    -------
    ndarray of complex, shape (k,)
        [V]

    Notes
    -----
    The position x before the backlash solves x = G N_d(|u|) u with u = P (r - c N_b(|x|) x). Each frequency starts
    from the solution of the next higher one, where the linear motor alone is a good start.
    """
    from scipy.optimize import root

    from idloop.errors import IdloopError
    from idloop.estimation.describing_functions import DeadZone, FrictionBacklash

    dead_zone = DeadZone(case.width) if case.width > 0.0 else None
    backlash = FrictionBacklash(case.gap) if case.gap > 0.0 else None
    gain, reference = lehigh_motor.CONTROLLER_GAIN, lehigh_motor.SINE_AMPLITUDE

    def passed(element: DeadZone | FrictionBacklash | None, value: complex) -> complex:
        return value if element is None or value == 0.0 else value * complex(element.gain(abs(value)))

    found = np.zeros(omega.size, dtype=complex)
    before: complex | None = None
    for k in range(omega.size - 1, -1, -1):
        s = 1j * omega[k]
        # The sampled controller holds its command: on the average it is half a sample late.
        plant = complex(case.b / (s * (s + case.a)) * np.exp(-0.5 * s * STEP))

        def left(parts: Array, plant: complex = plant) -> list[float]:
            x = complex(parts[0], parts[1])
            command = gain * (reference - feedback * passed(backlash, x))
            miss = x - plant * passed(dead_zone, command)
            return [miss.real, miss.imag]

        linear = plant * gain * reference / (1.0 + plant * gain * feedback)
        for start in (linear if before is None else before, linear, 0.5 * linear, 2.0 * linear):
            solved = root(left, [start.real, start.imag], tol=1e-10)
            if solved.success:
                break
        else:
            raise IdloopError(f"{case.name}: no harmonic balance at {omega[k]:.4g} rad/s")
        before = complex(*solved.x)
        found[k] = passed(backlash, before)
    return np.asarray(found / lehigh_motor.POTENTIOMETER)


def _experiment(case: LoopCase, omega: Array, seed: int) -> tuple[Complex, Array, Array]:
    """First harmonic of the potentiometer [V], radius of its circle [V], and distortion at the elements."""
    from idloop.diagnosis.design.experiment import Experiment
    from idloop.estimation.describing_functions import dwells_of, measure_describing_function

    signal = {
        "name": "stepped_sine",
        "sample_time": STEP,
        "amplitude": lehigh_motor.SINE_AMPLITUDE,
        "frequencies": [float(w / (2.0 * np.pi)) for w in omega],
        "periods": PERIODS,
        "settle_periods": SETTLE,
    }
    controller = {
        "type": "p",
        "output": "motor.position",
        "kp": lehigh_motor.CONTROLLER_GAIN,
        "feedback_gain": FEEDBACK,
        "sample_time": STEP,
    }
    experiment = Experiment(signal, adds_to="reference", controller=controller)
    record = experiment.run(case.machine(), noise=True, seed=seed, name=case.name)
    dwells = dwells_of(experiment.built)

    def between(source: str | None, target: str) -> Any:
        return measure_describing_function(record, source, target, dwells)

    response = between("reference.position", "motor.position")
    volts = lehigh_motor.SINE_AMPLITUDE / lehigh_motor.POTENTIOMETER
    distortion = np.zeros(omega.size)
    if case.width > 0.0:
        distortion = between(None, "motor.velocity").source_distortion
    if case.gap > 0.0:
        # The tachometer sits before the coupling; integrated, each harmonic loses as many times as its order.
        speed = between("reference.position", "motor.velocity").harmonics
        position = speed / np.arange(2, 2 + speed.shape[1])
        distortion = np.maximum(distortion, np.sqrt(np.nansum(position**2, axis=1)))
    return response.gain * volts, response.radius * volts, distortion
