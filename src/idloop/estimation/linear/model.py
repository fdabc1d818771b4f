"""A linear model in innovation form: x(k+1) = A x + B u + K e, y = C x + D u + e."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from idloop.arrays import Array, Complex
from idloop.errors import InputError
from idloop.estimation.black_box.labels import control_names
from idloop.estimation.black_box.sampled import SampledData, check_fits
from idloop.estimation.linear.propagate import ahead, initial_state, respond
from idloop.estimation.statistics.information_criteria import Information

if TYPE_CHECKING:
    import control

# The estimate of an integrator lies slightly inside or outside of the unit circle.
_UNSTABLE = 1.001
Focus = Literal["prediction", "simulation"]


@dataclass(frozen=True)
class Coefficient:
    """One estimated number."""

    name: str  # as in ``"a1"`` or ``"motor.inertia"``
    # Estimate and its standard error; NaN where none is known
    value: float
    stderr: float = float("nan")


@dataclass(frozen=True, eq=False)
class LinearModel:
    """A discrete-time linear model with its noise, as an estimator leaves it."""

    method: str  # as "n4sid" or "oe"
    # State-space matrices, shapes (n, n), (n, m), (p, n), (p, m)
    a: Array
    b: Array
    c: Array
    d: Array
    gain: Array  # shape (n, p): Kalman gain K; zero for an output-error model
    covariance: Array  # shape (p, p): of the innovations e [output units squared]
    sample_time: float  # period [s]
    input_names: tuple[str, ...]
    input_units: tuple[str, ...]
    output_names: tuple[str, ...]
    output_units: tuple[str, ...]
    samples: int  # that the estimate rests on
    free: int  # numbers that were estimated, noise covariance not counted
    # The estimated numbers where they have a meaning of their own (polynomials, a chosen structure)
    coefficients: tuple[Coefficient, ...] = ()
    coefficient_covariance: Array | None = None  # shape (k, k)
    singular_values: Array | None = None  # of the weighted projection (subspace methods): a gap shows the order
    notes: tuple[str, ...] = ()  # remarks for the user
    start: str = ""  # method of the model that a search began from (`prediction_error`); empty elsewhere

    @property
    def order(self) -> int:
        """Number of states."""
        return int(self.a.shape[0])

    @property
    def poles(self) -> Complex:
        """Eigenvalues of A."""
        values: Complex = np.linalg.eigvals(self.a).astype(complex)
        return values

    @property
    def stable(self) -> bool:
        """Whether all poles lie inside the unit circle."""
        return bool(np.all(np.abs(self.poles) < 1.0))

    @property
    def loss(self) -> float:
        """Determinant of the covariance of the innovations, the loss function V of the toolbox's tables."""
        return float(np.linalg.det(np.atleast_2d(self.covariance)))

    @property
    def information(self) -> Information:
        """Loss, numbers estimated and samples: what the criteria are made of."""
        return Information(self.loss, self.free, self.samples)

    @property
    def fpe(self) -> float:
        """Akaike's final prediction error (`Information.fpe`)."""
        return self.information.fpe

    @property
    def aic(self) -> float:
        """Akaike's information criterion (`Information.aic`)."""
        return self.information.aic

    @property
    def bic(self) -> float:
        """Bayesian information criterion (`Information.bic`)."""
        return self.information.bic

    @cached_property
    def system(self) -> control.StateSpace:
        """From the commands to the outputs, as a python-control system: Bode, poles, margins, design."""
        import control

        names = {"inputs": control_names(self.input_names), "outputs": control_names(self.output_names)}
        return control.ss(self.a, self.b, self.c, self.d, self.sample_time, **names, name=self.method)

    @cached_property
    def noise_system(self) -> control.StateSpace:
        """From the innovations to the outputs: H = I + C (zI - A)^-1 K."""
        import control

        outputs = control_names(self.output_names)
        names = {"inputs": [f"e[{name}]" for name in outputs], "outputs": outputs}
        through = np.eye(len(outputs))
        return control.ss(self.a, self.gain, self.c, through, self.sample_time, **names, name=f"{self.method} noise")

    def response(self, frequency: Array) -> Complex:
        """Frequency response at `frequency` [Hz], shape (f, p, m)."""
        z = np.exp(2j * np.pi * np.asarray(frequency, dtype=float) * self.sample_time)
        eye = np.eye(self.order)
        states = np.linalg.solve(z[:, None, None] * eye - self.a, np.broadcast_to(self.b, (z.size, *self.b.shape)))
        return np.asarray(self.c @ states + self.d, dtype=complex)

    def simulate(self, data: SampledData, initial: Array | Literal["estimate", "zero"] = "estimate") -> Array:
        """Free run: the outputs from the commands alone.

        `initial` (n,): state at the first sample; the one that fits the measurements best by default ("estimate" or
        "zero"). Returns shape (N, p): [output units]. Raises InputError: other signals or another sample time than the
        model's.
        """
        self._check(data)
        state = np.zeros(self.order)
        inputs = np.ascontiguousarray(data.input)
        outputs: Array = respond(self.a, self.b, self.c, self.d, state, inputs)
        if isinstance(initial, str) and initial == "zero":
            return outputs
        state = initial_state(self.a, self.c, data.output - outputs) if isinstance(initial, str) else initial
        free: Array = respond(self.a, self.b, self.c, self.d, np.asarray(state, dtype=float), inputs)
        return free

    def predict(self, data: SampledData, steps: int = 1) -> Array:
        """Prediction `steps` samples ahead from past commands and measurements, shape (N, p).

        Raises InputError: other signals or another sample time than the model's, or fewer than one step.
        """
        self._check(data)
        if steps < 1:
            raise InputError(f"prediction {steps} steps ahead; give at least 1, or simulate")
        inputs, outputs = np.ascontiguousarray(data.input), np.ascontiguousarray(data.output)
        # The one-step predictor is linear in its first state: its response from rest leaves what the state explains.
        closed, driven = self.a - self.gain @ self.c, np.hstack([self.b - self.gain @ self.d, self.gain])
        straight = np.hstack([self.d, np.zeros((self.d.shape[0], outputs.shape[1]))])
        both = np.hstack([inputs, outputs])
        rest = respond(closed, driven, self.c, straight, np.zeros(self.order), both)
        state = initial_state(closed, self.c, outputs - rest)
        matrices = (self.a, self.b, self.c, self.d, self.gain)
        predicted: Array = (
            respond(closed, driven, self.c, straight, state, both)
            if steps == 1
            else ahead(*map(np.ascontiguousarray, matrices), state, inputs, outputs, steps)
        )
        return predicted

    def innovations(self, data: SampledData) -> Array:
        """One-step prediction errors, shape (N, p)."""
        return data.output - self.predict(data)

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        names = (
            "method", "order", "sample_time", "a", "b", "c", "d", "stable", "loss", "fpe", "aic", "bic", "samples",
            "singular_values", "notes",
        )  # fmt: skip
        return {
            **{name: getattr(self, name) for name in names},
            "start": self.start or None,
            "kalman_gain": self.gain,
            "innovation_covariance": self.covariance,
            "poles": [{"real": float(p.real), "imag": float(p.imag)} for p in self.poles],
            "coefficients": {c.name: {"value": c.value, "stderr": c.stderr} for c in self.coefficients},
        }

    def plot(self, axes: Any = None) -> Any:
        """Draw the Bode diagram, magnitude over phase; returns the two matplotlib axes."""
        from idloop import drawing
        from idloop.estimation.black_box.labels import draw_bode, new_axes

        frequency = np.geomspace(1e-3, 0.5, 400) / self.sample_time
        with drawing.styled():
            axes = new_axes(axes, 2, 5)
            draw_bode(axes, self, frequency, self.response(frequency), f"{self.method}, order {self.order}")
            axes[1].set_xlabel(drawing.label("frequency", "Hz"))
        return axes

    def _check(self, data: SampledData) -> None:
        check_fits(data, self.method, self.b.shape[1], self.c.shape[0], self.sample_time)


def instability_notes(a: Array) -> tuple[str, ...]:
    """One note where the free run grows, none otherwise."""
    if not np.all(np.isfinite(a)):
        return ()
    radius = float(np.max(np.abs(np.linalg.eigvals(a)), initial=0.0))
    if radius <= _UNSTABLE:
        return ()
    return (f"unstable: its free run grows by a factor of {radius:.4g} per sample; correct for an unstable plant only",)


def error_covariance(model: LinearModel, experiments: Sequence[SampledData], focus: Focus = "prediction") -> Array:
    """Mean product of the errors, the first state of each experiment estimated.

    `focus`: errors one step ahead or of the free run. Returns shape (p, p): [output units squared]; infinite where the
    errors overflow.
    """
    p = model.c.shape[0]
    total, count = np.zeros((p, p)), 0
    for one in experiments:
        errors = model.innovations(one) if focus == "prediction" else one.output - model.simulate(one)
        with np.errstate(all="ignore"):
            total += errors.T @ errors
        count += len(errors)
    return np.where(np.isfinite(total), total / count, np.inf)
