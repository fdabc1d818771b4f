"""Row A1: the DC motor as a model, its transfer functions and its sampled matrices."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from papers import Progress
from papers.claim import near, within
from papers.motor import lehigh_motor
from papers.reproduction import Line, Reproduction

if TYPE_CHECKING:
    import control
    from idloop.physics import Model

Array = NDArray[np.float64]

# Published numbers have four or five digits.
_DIGITS = 1e-4


@dataclass(frozen=True, eq=False)
class PlantModel(Reproduction):
    """The preset ``dc_motor`` beside the thesis's model.

    Attributes
    ----------
    model : Model
    position, velocity : control.TransferFunction
        From the command [V] to each output.
    poles : ndarray of complex, shape (2,)
        [rad/s]
    transition : ndarray, shape (2, 2)
        State after one sample from unit states, by the simulator.
    entry : ndarray, shape (2,)
        State after one sample of 1 V from rest, by the simulator.
    """

    model: Model
    position: control.TransferFunction
    velocity: control.TransferFunction
    poles: NDArray[np.complex128]
    transition: Array
    entry: Array

    def rows(self) -> tuple[Line, ...]:
        """Numbers of the model, its sampled matrices, its sensors."""
        b, a = float(self.position.num[0][0][-1]), float(self.position.den[0][0][1])
        slow, fast = sorted(float(p.real) for p in self.poles)[::-1]
        lines = [
            _line("numerator of position over command", b, lehigh_motor.B, "rad/s²/V", "eq. 7.1"),
            _line("denominator s² + a s: a", a, lehigh_motor.A, "1/s", "eq. 7.1"),
            Line("first pole", slow, 0.0, "rad/s", "eq. 7.1", near(0.0, 1e-9)),
            _line("second pole", fast, -lehigh_motor.A, "rad/s", "eq. 7.1"),
            _line("gain from command to speed", b / a, lehigh_motor.B / lehigh_motor.A, "rad/s/V", "eq. 7.2"),
        ]
        for name, ours, paper in zip(_SAMPLED, self._sampled(), published_samples(), strict=True):
            lines.append(_line(f"sampled every {lehigh_motor.SAMPLE_TIME:g} s: {name}", ours, paper, "", "eq. 2.21"))
        for output, variance in zip(self.model.outputs, lehigh_motor.VARIANCES, strict=True):
            found, unit = (output.noise or 0.0) ** 2, f"({output.unit})²" if "/" in output.unit else f"{output.unit}²"
            # Two digits are published.
            lines.append(
                Line(
                    f"noise variance of the {output.field}", found, variance, unit, "appendix B.2.1",
                    near(variance, 0.5e-4),
                )
            )  # fmt: skip
        degrees = math.radians(lehigh_motor.POTENTIOMETER_DEGREES)
        per_volt = 60.0 / 1000.0 / (2.0 * math.pi) * lehigh_motor.TACHOMETER_VOLTS_PER_KRPM * lehigh_motor.GEAR_RATIO
        return (
            *lines,
            _line("scale of the potentiometer, 150° at 14.65 V", degrees / lehigh_motor.POTENTIOMETER_VOLTS,
                  lehigh_motor.POTENTIOMETER, "rad/V", "chapter 5"),
            _line("scale of the tachometer, 3 V/krpm before 30:1", 1.0 / per_volt, lehigh_motor.TACHOMETER,
                  "rad/s/V", "chapter 5"),
            _line("correction constant, 150° at the 15 V of its supply", degrees / lehigh_motor.SUPPLY_VOLTS,
                  lehigh_motor.CORRECTION, "rad/V", "section 6.2.1", 5e-4),
        )  # fmt: skip

    def _sampled(self) -> tuple[float, ...]:
        return (float(self.transition[0, 1]), float(self.transition[1, 1]), float(self.entry[0]), float(self.entry[1]))

    def notes(self) -> tuple[str, ...]:
        """Where the two scales of the potentiometer come from."""
        return (
            "The sampled matrices are ours by the simulator, the paper's by the formula below its eq. 2.21.",
            (
                "The thesis has two scales of its potentiometer: 0.1787 rad/V where it identifies, 0.1745 rad/V in"
                " the loop. They are 150° over 14.65 V and over the 15 V of the supply."
            ),
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            **super().to_dict(),
            "position": {"numerator": self.position.num[0][0], "denominator": self.position.den[0][0]},
            "velocity": {"numerator": self.velocity.num[0][0], "denominator": self.velocity.den[0][0]},
            "poles": [{"real": float(p.real), "imag": float(p.imag)} for p in self.poles],
            "transition": self.transition,
            "entry": self.entry,
        }

    def plot(self, axes: Any = None) -> Any:
        """Draw the Bode diagram of both outputs, ours and the thesis's; returns the two matplotlib axes."""
        import matplotlib.pyplot as plt

        from idloop import drawing

        omega = np.geomspace(0.1, 30.0, 200)
        point = 1j * omega
        published = lehigh_motor.B / (point**2 + lehigh_motor.A * point)
        with drawing.styled():
            if axes is None:
                _, axes = plt.subplots(2, 1, sharex=True, figsize=(8, 5), layout="constrained")
            pairs = (("position", self.position, published), ("velocity", self.velocity, point * published))
            for index, (name, system, theirs) in enumerate(pairs):
                ours = system(point)
                colour = drawing.MODELS[index]
                axes[0].loglog(omega, np.abs(ours), color=colour, label=f"{name}, preset dc_motor")
                axes[1].semilogx(omega, np.degrees(np.angle(ours)), color=colour)
                look = {"color": drawing.MEASURED, "linestyle": ":", "linewidth": 2.0}
                axes[0].loglog(omega, np.abs(theirs), **look, label=f"{name}, eq. 7.{index + 1}")
                axes[1].semilogx(omega, np.degrees(np.angle(theirs)), **look)
            axes[0].set_ylabel(drawing.label("magnitude", "rad/V, rad/s/V"))
            axes[0].legend()
            axes[1].set_ylabel(drawing.label("phase", "deg"))
            axes[1].set_xlabel(drawing.label("frequency", "rad/s"))
        return axes


_SAMPLED = ("position after a speed of 1", "speed after a speed of 1", "position after 1 V", "speed after 1 V")


def published_samples() -> tuple[float, ...]:
    """The thesis's sampled matrices A_T and B_T (below eq. 2.21), at its parameters and sample time."""
    constant, interval = 1.0 / lehigh_motor.A, lehigh_motor.SAMPLE_TIME
    left = math.exp(-interval / constant)
    rise = constant * (1.0 - left)
    return rise, left, lehigh_motor.B * constant * (interval - rise), lehigh_motor.B * rise


def _line(quantity: str, ours: float, paper: float, unit: str, source: str, share: float = _DIGITS) -> Line:
    return Line(quantity, ours, paper, unit, source, within(paper, share))


def reproduce(seed: int, progress: Progress) -> PlantModel:
    """Read the preset, linearise it and step its simulator.

    Parameters
    ----------
    seed : int
        Nothing here is random.
    progress : callable
    """
    import control
    from idloop.physics import Engine, load_model, simulate

    progress(0.0, "linear part")
    model = load_model("dc_motor")
    linear = Engine(model).linearise(None)
    systems = [control.ss2tf(control.ss(linear.A, linear.B[:, None], row[None, :], 0.0)) for row in linear.C]
    progress(0.5, "one sample")
    instants = np.array([0.0, lehigh_motor.SAMPLE_TIME])

    def after(command: float, position: float, velocity: float) -> Array:
        return np.array(simulate(model, [0.0], [command], instants, [position], [velocity]).output[-1])

    return PlantModel(
        model=model,
        position=systems[0],
        velocity=control.minreal(systems[1], verbose=False),
        poles=np.linalg.eigvals(linear.A).astype(complex),
        transition=np.column_stack([after(0.0, 1.0, 0.0), after(0.0, 0.0, 1.0)]),
        entry=after(1.0, 0.0, 0.0),
    )
