"""Result of a fit: fitted model, uncertainty and residuals."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from idloop.arrays import Array
from idloop.estimation.statistics.interval_text import interval_text

if TYPE_CHECKING:
    import control
    from idloop.physics import Model


@dataclass(frozen=True)
class RecordResidual:
    """Residuals of a fitted model on one record."""

    name: str  # record
    time: Array  # shape (n,): instants [s]
    value: Array  # shape (n, p): innovations, simulation errors or unexplained forces; NaN where not measured
    names: tuple[str, ...]  # columns


@dataclass(frozen=True)
class Ratio:
    """Ratio of two parameters that the data determine, although they determine neither of them."""

    name: str  # ``first / second``
    value: float
    stderr: float
    unit: str

    @property
    def interval(self) -> tuple[float, float]:
        """95 % confidence interval."""
        return _interval(self.value, self.stderr)


@dataclass(frozen=True)
class FitResult:
    """A fitted model with its uncertainty."""

    model: Model  # the model with fitted values and standard errors
    names: tuple[str, ...]  # free parameters
    # shape (k,): estimates and standard errors; NaN where not determined
    values: Array
    stderr: Array
    # shape (k, k): valid under coloured residuals: HAC sandwich, widened to inverse Hessian and block jackknife
    covariance: Array
    # Determinant of the residual covariance and Akaike's final prediction error
    loss: float
    fpe: float
    # The minimised criterion, and the reason for it
    criterion: str
    why: str
    disturbance_intensity: float | None  # intensity of the disturbance force's random walk [force²/s] (prediction only)
    output_noise: Array  # shape (p,): standard deviation of each output's measurement noise
    command_shift: float | None  # time from stamp to action of the command beyond its hold [s] (force only)
    residuals: tuple[RecordResidual, ...]  # one per record
    at_bound: tuple[str, ...]  # parameters that ended on a bound
    warnings: tuple[str, ...]  # one line each
    samples: int
    iterations: int
    converged: bool
    orders: tuple[int, ...] = field(default=())  # orders of the autoregressions that whiten the errors
    ratios: tuple[Ratio, ...] = ()  # ratios of parameters that are determined only up to a common factor
    # Unexplained force over that of the drive: of the fit, and of each half under the parameters of the other (force
    # only)
    force_error: float | None = None
    force_error_unseen: float | None = None

    @property
    def correlation(self) -> Array:
        """Correlation matrix of the estimates, shape (k, k)."""
        size = np.sqrt(np.maximum(np.diag(self.covariance), 1e-300))
        return np.asarray(self.covariance / np.outer(size, size))

    @property
    def system(self) -> control.StateSpace:
        """Linear part of the fitted model as a python-control system, from the command to the outputs."""
        import control
        from idloop.estimation.black_box.labels import control_names
        from idloop.physics import Engine

        linear = Engine(self.model).linearise()
        names = control_names(self.model.output_names)
        return control.ss(
            linear.A, linear.B.reshape(-1, 1), linear.C, np.zeros((len(names), 1)),
            inputs=control_names([self.model.input.name]), outputs=names, remove_useless_states=False,
        )  # fmt: skip

    def interval(self, name: str) -> tuple[float, float]:
        """95 % confidence interval of one parameter.

        Parameters
        ----------
        name : str
            One of `names`.
        """
        index = self.names.index(name)
        return _interval(float(self.values[index]), float(self.stderr[index]))

    def summary(self) -> str:
        """Return the result as a text table."""
        units = {p.name: p.unit for p in self.model.parameters}
        width = max(len(n) for n in ("parameter", *self.names, *(ratio.name for ratio in self.ratios)))
        lines = [
            f"{self.model.name}: {self.criterion} criterion ({self.why})",
            f"{'parameter':<{width}}  {'value':>12}  {'std. error':>10}  {'95 % interval':>25}  unit",
        ]
        for name, value, stderr in zip(self.names, self.values, self.stderr, strict=True):
            low, high = self.interval(name)
            span = interval_text(low, high)
            mark = "  at bound" if name in self.at_bound else ""
            error = f"{stderr:.2g}" if np.isfinite(stderr) else "-"
            lines.append(f"{name:<{width}}  {value:>12.6g}  {error:>10}  {span:>25}  {units[name]}{mark}")
        for ratio in self.ratios:
            span = interval_text(*ratio.interval)
            lines.append(
                f"{ratio.name:<{width}}  {ratio.value:>12.6g}  {ratio.stderr:>10.2g}  {span:>25}  {ratio.unit}"
            )
        lines.append(f"loss {self.loss:.6g}, FPE {self.fpe:.6g}, {self.samples} samples")
        lines += [f"warning: {text}" for text in self.warnings]
        return "\n".join(lines)

    def to_dict(self) -> dict[str, Any]:
        """Return the result as plain numbers for JSON; ``None`` where not determined."""
        units = {p.name: p.unit for p in self.model.parameters}

        def number(value: float) -> float | None:
            return float(value) if np.isfinite(value) else None

        parameters = {}
        for name, value, stderr in zip(self.names, self.values, self.stderr, strict=True):
            low, high = self.interval(name)
            parameters[name] = {
                "value": number(value),
                "stderr": number(stderr),
                "interval": [number(low), number(high)],
                "unit": units[name],
                "at_bound": name in self.at_bound,
            }
        return {
            "model": self.model.name,
            "criterion": self.criterion,
            "why": self.why,
            "parameters": parameters,
            "ratios": {
                ratio.name: {
                    "value": number(ratio.value),
                    "stderr": number(ratio.stderr),
                    "interval": [number(end) for end in ratio.interval],
                    "unit": ratio.unit,
                }
                for ratio in self.ratios
            },
            "correlation": [[number(v) for v in row] for row in self.correlation],
            "loss": number(self.loss),
            "fpe": number(self.fpe),
            "disturbance_intensity": self.disturbance_intensity,
            "output_noise": [number(v) for v in self.output_noise],
            "command_shift": self.command_shift,
            "samples": self.samples,
            "iterations": self.iterations,
            "converged": self.converged,
            "warnings": list(self.warnings),
        }


def _interval(value: float, stderr: float) -> tuple[float, float]:
    """95 % confidence interval of a normal estimate."""
    reach = 1.959963984540054 * stderr
    return float(value - reach), float(value + reach)
