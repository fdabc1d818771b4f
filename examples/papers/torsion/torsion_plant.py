"""Row B1: the plant of the torsion thesis, its matrices against eq. 2.4, and the misprint in it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from papers import Progress
from papers.claim import below, beyond, equals, near, within
from papers.reproduction import Line, Reproduction, Table
from papers.torsion import torsion_thesis as thesis

Array = NDArray[np.float64]

_EXACT = 1e-9
# Published sensitivities have three digits.
_DIGITS = 2e-3


@dataclass(frozen=True, eq=False)
class TorsionPlant(Reproduction):
    """The preset ``torsion`` beside the thesis's state-space model.

    Attributes
    ----------
    a, b, c : ndarray, shapes (8, 8), (8,), (4, 8)
        Of the preset, linearised; states are the four angles, then the four speeds.
    printed, mended : ndarray, shape (8, 8)
        A of eq. 2.4 as it is printed, and with k/Jm in row 5, column 2.
    undamped : ndarray, shape (8, 8)
        A of the preset without friction and damping.
    step_error : float
        Largest difference of the simulated step response from the matrix exponential's [rad].
    frequency : ndarray, shape (f,)
        [Hz]
    response : ndarray of complex, shape (f, 4)
        From the current to the angles [rad/A].
    """

    a: Array
    b: Array
    c: Array
    printed: Array
    mended: Array
    undamped: Array
    step_error: float
    frequency: Array
    response: NDArray[np.complex128]

    @property
    def damping(self) -> Array:
        """Rows 5 to 8, columns 5 to 8 of A: friction and damping [1/s]."""
        return self.a[4:, 4:]

    def rows(self) -> tuple[Line, ...]:
        """Sizes, stiffness and drive entries of A and B, what the misprint does, and the sensors."""
        jm, j, k = thesis.MOTOR_INERTIA, thesis.LOAD_INERTIA, thesis.STIFFNESS
        inputs = self.b.size // len(self.a)
        lines = [
            Line("states", float(len(self.a)), 8.0, "", "eq. 2.2", equals(8)),
            Line("inputs, outputs", f"{inputs}, {len(self.c)}", "1, 4", "", "eq. 2.4", equals("1, 4")),
        ]
        for name, ours, paper in (
            ("A[5,1] = -k/Jm", self.a[4, 0], -k / jm),
            ("A[5,2] = k/Jm, printed k/(Jm + k)", self.a[4, 1], k / jm),
            ("A[6,1] = k/J1", self.a[5, 0], k / j),
            ("A[6,2] = -2k/J1", self.a[5, 1], -2.0 * k / j),
            ("A[7,3] = -2k/J2", self.a[6, 2], -2.0 * k / j),
            ("A[8,4] = -k/J3", self.a[7, 3], -k / j),
        ):
            lines.append(Line(name, float(ours), paper, "1/s²", "eq. 2.4", within(paper, _EXACT)))
        drive = thesis.TORQUE_CONSTANT / jm
        lines.append(Line("B[5] = Kt/Jm", float(self.b[4]), drive, "rad/s²/A", "eq. 2.4",
                          within(drive, _EXACT)))  # fmt: skip
        rest = float(np.max(np.abs(self.undamped - self.mended)) / np.max(np.abs(self.mended)))
        lines.append(Line("all of A without friction: largest difference, as a share", rest, 0.0, "", "eq. 2.4",
                          below(_EXACT)))  # fmt: skip
        right, wrong = np.ones(4), np.ones(4)
        right, wrong = self.mended[4, :4] @ right, self.printed[4, :4] @ wrong
        lines += [
            Line("all angles alike: torque on the motor over its inertia", float(right), 0.0, "rad/s²", "eq. 2.1c",
                 near(0.0, 1e-6)),
            Line("the same as printed: it would spring back to zero", float(wrong), 0.0, "rad/s²", "eq. 2.4",
                 beyond(1.0)),
            Line("pole of the free turn", float(np.min(np.abs(np.linalg.eigvals(self.a)))), 0.0, "rad/s",
                 "section 3.1", below(1e-6)),
            Line("largest real part of the other poles", _largest_rest(self.a), "negative", "rad/s", "section 3.1",
                 below(0.0)),
            Line("step response: simulator against matrix exponential", self.step_error, 0.0, "rad", "eq. 2.3",
                 below(1e-6)),
            _sensor("motor encoder: radians a count", thesis.MOTOR_COUNTS, thesis.MOTOR_SENSITIVITY),
            _sensor("load encoder: radians a count", thesis.LOAD_COUNTS, thesis.LOAD_SENSITIVITY),
        ]  # fmt: skip
        return tuple(lines)

    def tables(self) -> tuple[Table, ...]:
        """Resonances of the plant."""
        poles = np.linalg.eigvals(self.a)
        kept = sorted((p for p in poles if p.imag > 1e-6), key=lambda p: p.imag)
        rows = [
            (float(abs(p) / (2.0 * np.pi)), float(-p.real / abs(p))) for p in kept
        ]  # fmt: skip
        return (Table("Resonances of the preset", ("frequency [Hz]", "damping ratio [-]"), rows),)

    def notes(self) -> tuple[str, ...]:
        """What the thesis does not give."""
        return (
            (
                "Eq. 2.4 prints A[5,2] = k/(Jm + k): a brace that slipped. With k/Jm the motor feels no torque when all"
                " angles are alike, as eq. 2.1c wants; as printed the whole machine would hang on a spring."
            ),
            (
                "The thesis gives no viscous friction and no damping of the couplings; the preset's are ours, and A is"
                " compared without them. Appendix C moves the masses outwards and gives no inertia: only the estimated"
                " model."
            ),
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {**super().to_dict(), "a": self.a, "b": self.b, "c": self.c}

    def plot(self, axes: Any = None) -> Any:
        """Draw the frequency responses from the current to the four angles; returns the two matplotlib axes."""
        import matplotlib.pyplot as plt

        from idloop import drawing

        with drawing.styled():
            if axes is None:
                _, axes = plt.subplots(2, 1, sharex=True, figsize=(8, 5), layout="constrained")
            for index, name in enumerate(("motor", "load 1", "load 2", "load 3")):
                look = drawing.model_look(index)
                axes[0].loglog(self.frequency, np.abs(self.response[:, index]), label=name, **look)
                phase = np.degrees(np.unwrap(np.angle(self.response[:, index])))
                axes[1].semilogx(self.frequency, phase, **look)
            axes[0].set_ylabel(drawing.label("magnitude", "rad/A"))
            axes[0].legend()
            axes[1].set_ylabel(drawing.label("phase", "deg"))
            axes[1].set_xlabel(drawing.label("frequency", "Hz"))
        return axes


def _largest_rest(a: Array) -> float:
    poles = np.linalg.eigvals(a)
    return float(np.max(np.delete(poles, np.argmin(np.abs(poles))).real))


def _sensor(name: str, counts: int, published: float) -> Line:
    step = 2.0 * np.pi / counts
    return Line(name, step, published, "rad", "table A.1", within(published, _DIGITS))


def printed_matrix(mended: bool) -> Array:
    """A of eq. 2.4 without friction, as printed or with k/Jm in row 5, column 2."""
    jm, j, k = thesis.MOTOR_INERTIA, thesis.LOAD_INERTIA, thesis.STIFFNESS
    stiffness = np.array(
        [
            [-k / jm, k / jm if mended else k / (jm + k), 0.0, 0.0],
            [k / j, -2.0 * k / j, k / j, 0.0],
            [0.0, k / j, -2.0 * k / j, k / j],
            [0.0, 0.0, k / j, -k / j],
        ]
    )
    return np.block([[np.zeros((4, 4)), np.eye(4)], [stiffness, np.zeros((4, 4))]])


def reproduce(seed: int, progress: Progress) -> TorsionPlant:
    """Linearise the preset and step its simulator.

    Parameters
    ----------
    seed : int
        Nothing here is random.
    progress : callable
    """
    from scipy.linalg import expm

    from idloop.physics import Engine, simulate

    progress(0.0, "matrices")
    model = thesis.quanser()
    linear = Engine(model).linearise(None)
    losses = {name: 0.0 for name in model.values if name.endswith(("viscous_friction", "damping"))}
    undamped = Engine(model.with_values(losses)).linearise(None)
    progress(0.5, "step response")
    time = np.arange(0.0, 1.0, 0.01)
    stepped = simulate(model, [0.0], [1.0], time).output
    joint = np.zeros((9, 9))
    joint[:8, :8], joint[:8, 8] = linear.A, linear.B
    exact = np.array([linear.C @ expm(joint * t)[:8, 8] for t in time])
    frequency = np.geomspace(0.1, 60.0, 500)
    response = np.array(
        [linear.C @ np.linalg.solve(2j * np.pi * f * np.eye(8) - linear.A, linear.B) for f in frequency]
    )
    return TorsionPlant(
        a=linear.A,
        b=linear.B,
        c=linear.C,
        printed=printed_matrix(mended=False),
        mended=printed_matrix(mended=True),
        undamped=undamped.A,
        step_error=float(np.max(np.abs(stepped - exact))),
        frequency=frequency,
        response=response,
    )
