"""An impulse response sample by sample, with its bands."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from idloop.errors import InputError

if TYPE_CHECKING:
    import control

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ImpulseResponse:
    """Weights g of y(k) = Σ g(lag) u(k - lag).

    Attributes
    ----------
    lag : ndarray of int, shape (l,)
        [samples]; at negative lags only feedback shows.
    response : ndarray, shape (l, p)
        From the input to the outputs [output unit / input unit].
    stderr : ndarray, shape (l, p)
        Standard error of each weight.
    null_stderr : ndarray, shape (p,)
        Standard deviation of the estimate at a lag that carries no response.
    sample_time : float
        [s].
    feedback_p : ndarray, shape (p,)
        p-value of the negative lags under an open loop: small where the input answers to the output.
    """

    method: str
    lag: NDArray[np.int64]
    response: Array
    stderr: Array
    null_stderr: Array
    sample_time: float
    input_name: str
    input_unit: str
    output_names: tuple[str, ...]
    output_units: tuple[str, ...]
    samples: int
    feedback_p: Array
    notes: tuple[str, ...] = ()

    @property
    def time(self) -> Array:
        """Lags in seconds, shape (l,)."""
        return np.asarray(self.lag * self.sample_time)

    @property
    def step(self) -> Array:
        """Step response at the lags from 0 on, shape (l0, p)."""
        return np.asarray(np.cumsum(self.response[self.lag >= 0], axis=0))

    @property
    def system(self) -> control.StateSpace:
        """The weights at the lags from 0 on as a python-control system: a chain of delays."""
        import control
        from idloop.estimation.black_box.control_names import control_names

        weights = self.response[self.lag >= 0]
        length = len(weights) - 1
        into = np.zeros((length, 1))
        into[:1] = 1.0
        return control.ss(
            np.eye(length, k=-1), into, weights[1:].T, weights[:1].T, self.sample_time,
            inputs=control_names([self.input_name]), outputs=control_names(self.output_names),
            remove_useless_states=False,
        )  # fmt: skip

    def band(self, share: float = 0.99) -> Array:
        """Half width of the band that holds each true weight with probability `share`, shape (l, p)."""
        return _quantile(share) * self.stderr

    def null_band(self, share: float = 0.99) -> Array:
        """Half width of the band that holds the estimate at a lag without response, shape (p,)."""
        return _quantile(share) * self.null_stderr

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        return {
            "method": self.method,
            "lag": self.lag,
            "time": self.time,
            "response": self.response,
            "stderr": self.stderr,
            "null_stderr": self.null_stderr,
            "sample_time": self.sample_time,
            "input": self.input_name,
            "outputs": list(self.output_names),
            "samples": self.samples,
            "feedback_p": self.feedback_p,
            "notes": list(self.notes),
        }

    def plot(self, axes: Any = None, share: float = 0.99) -> Any:
        """Draw the weights with their bands; returns the matplotlib axes, one for each output."""
        import matplotlib.pyplot as plt

        from idloop import drawing

        count = len(self.output_names)
        with drawing.styled():
            if axes is None:
                _, axes = plt.subplots(count, 1, sharex=True, figsize=(8, 3 * count), layout="constrained")
            several = np.atleast_1d(axes)
            null, band = self.null_band(share), self.band(share)
            for index, each in enumerate(several):
                each.axhspan(-null[index], null[index], color=drawing.BAND, alpha=0.3, linewidth=0, label="no response")
                each.errorbar(
                    self.time, self.response[:, index], band[:, index],
                    fmt=".", color=drawing.MODELS[0], markersize=4, linewidth=0.6, label=f"{100 * share:g} % bands",
                )  # fmt: skip
                each.axhline(0.0, color=drawing.COMMAND, linewidth=0.6)
                each.set_title(f"{self.input_name} → {self.output_names[index]}, {self.method}")
                each.set_ylabel(drawing.label("weight", f"{self.output_units[index]}/{self.input_unit}"))
                each.legend()
            several[-1].set_xlabel(drawing.label("lag", "s"))
        return axes


def _quantile(share: float) -> float:
    from scipy.special import ndtri

    if not 0 < share < 1:
        raise InputError(f"band with probability {share:g}; give a share between 0 and 1")
    return float(ndtri(0.5 * (1.0 + share)))
