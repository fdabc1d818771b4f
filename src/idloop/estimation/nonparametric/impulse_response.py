"""The impulse response sample by sample, from the whitened input."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from idloop.arrays import Array, Integers
from idloop.errors import InputError
from idloop.estimation.black_box.labels import new_axes
from idloop.estimation.black_box.sampled import SampledData, together
from idloop.estimation.nonparametric.spectral import Trend, covariances, without_trend

if TYPE_CHECKING:
    import control

_REACH = 4  # times the lags: as far as a held command smears a response to negative lags
_COLOURED = 0.1  # correlation that prewhitening may leave in the input before the weights smear into each other


@dataclass(frozen=True, eq=False)
class ImpulseResponse:
    """Weights g of y(k) = Σ g(lag) u(k - lag)."""

    method: str
    lag: Integers  # shape (l,): [samples]; at negative lags only feedback shows
    response: Array  # shape (l, p): from the input to the outputs [output unit / input unit]
    stderr: Array  # shape (l, p): standard error of each weight
    null_stderr: Array  # shape (p,): standard deviation of the estimate at a lag that carries no response
    sample_time: float  # [s]
    input_name: str
    input_unit: str
    output_names: tuple[str, ...]
    output_units: tuple[str, ...]
    samples: int
    # shape (p,): p-value of the negative lags under an open loop: small where the input answers to the output
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
        from idloop.estimation.black_box.labels import control_names

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
        names = (
            "method", "lag", "time", "response", "stderr", "null_stderr", "sample_time", "samples", "feedback_p",
            "notes",
        )  # fmt: skip
        return {**{name: getattr(self, name) for name in names}, "input": self.input_name, "outputs": self.output_names}

    def plot(self, axes: Any = None, share: float = 0.99) -> Any:
        """Draw the weights with their bands; returns the matplotlib axes, one for each output."""
        from idloop import drawing

        count = len(self.output_names)
        with drawing.styled():
            axes = new_axes(axes, count, 3 * count)
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


def cra(
    data: SampledData | Sequence[SampledData], lags: int = 20, prewhitening: int = 10, *, trend: Trend = "constant"
) -> ImpulseResponse:
    """Correlation analysis with prewhitening (Ljung, 2nd ed., section 6.1, eq. 6.7 to 6.12).

    An autoregression fitted to the input makes it white; the same filter on the outputs leaves the response
    between them as it is. The weights are then the covariances of output and input over the input's variance,
    with variances after Bartlett (Box and Jenkins, eq. 12.1.10) that allow for the response at all other lags.

    `data`: one input; `lags`: largest lag [samples]; `prewhitening`: order of the autoregression; 0 takes the input as
    it is; `trend`: what is taken off each signal before ("constant", "linear", "none"). Returns: at the lags from
    −`lags` to `lags`. Raises InputError: more than one input, one that does not move, or too few samples.
    """
    from scipy.signal import lfilter

    several = together(data)
    first = several[0]
    if first.input.shape[1] != 1:
        raise InputError(f"{first.name}: {first.input.shape[1]} inputs; correlation analysis takes one, use spa")
    shortest = min(len(one) for one in several)
    if lags < 1 or prewhitening < 0 or shortest < 4 * lags + 2 * prewhitening:
        raise InputError(
            f"{first.name}: {shortest} samples for {lags} lags and a whitening filter of order {prewhitening};"
            f" at least {4 * max(lags, 1) + 2 * max(prewhitening, 0)} are needed"
        )
    flat = [without_trend(np.hstack([one.output, one.input]), trend) for one in several]
    whitener = _whitener([values[:, -1] for values in flat], prewhitening, first)
    white = [lfilter(whitener, [1.0], values, axis=0)[prewhitening:] for values in flat]
    total = sum(len(values) for values in white)
    covariance = np.sum([covariances(values, 2 * lags) for values in white], axis=0) / total
    zero, p = 2 * lags, first.output.shape[1]
    power = float(covariance[zero, p, p])
    across = covariance[:, :p, p] / power
    lag = np.arange(-lags, lags + 1)
    response = across[zero - lags : zero + lags + 1]
    output = np.diagonal(covariance[zero])[:p] / power
    ahead = np.arange(1, lags + 1)
    # The same sample correlation of the input carries the response of both neighbours of a lag into it.
    mirrored = np.array([2.0 * np.sum(across[zero + one + ahead] * across[zero + one - ahead], axis=0) for one in lag])
    alone = np.maximum(output - response**2, 4 * np.finfo(float).eps * output)
    variance = np.maximum(alone + mirrored, 0.01 * alone) / total
    null = np.sqrt(output / total)
    before = response[lag < 0]
    feedback = np.array([_pooled(before[:, i], covariance[zero : zero + lags, i, i] / power / total) for i in range(p)])
    follows = bool(np.any(feedback < 1e-3))
    notes = []
    # What is left at a lag beyond those of the response matters only where it has reached the negative lags.
    left = _left(white, min(_REACH * lags if follows else lags, shortest - prewhitening - 1))
    if left > max(_COLOURED, 5.0 / np.sqrt(total)):
        notes.append(
            f"the whitened input still has a correlation of {left:.2g} with its past, which smears the"
            " weights, to negative lags as well: they do not show whether the loop is closed; excite with a signal"
            " that is not held, or take spa"
        )
    elif follows:
        notes.append("the input follows the output (weights at negative lags): the loop is closed")
    return ImpulseResponse(
        "correlation analysis", lag, response, np.sqrt(variance), null, first.sample_time, first.input_names[0],
        first.input_units[0], first.output_names, first.output_units, total, feedback, tuple(notes),
    )  # fmt: skip


def _whitener(inputs: Sequence[Array], order: int, first: SampledData) -> Array:
    """Coefficients 1, a1, ... of the prediction-error filter of the input, by least squares over all experiments."""
    size = max(float(np.max(np.abs(u))) for u in inputs)
    if not size > 0:
        raise InputError(f"{first.name}: {first.input_names[0]} does not move; a response needs an input that moves")
    if order == 0:
        return np.ones(1)
    rows = [np.lib.stride_tricks.sliding_window_view(u / size, order + 1) for u in inputs]
    past = np.concatenate([row[:, -2::-1] for row in rows])
    now = np.concatenate([row[:, -1] for row in rows])
    coefficients = np.linalg.lstsq(past, now, rcond=1e-10)[0]
    whitener = np.concatenate([[1.0], -coefficients])
    left = now - past @ coefficients
    if float(left @ left) <= 1e-20 * float(now @ now):
        raise InputError(
            f"{first.name}: {first.input_names[0]} is predicted exactly by its own past, as a sine is; it holds too"
            " few frequencies for an impulse response"
        )
    return whitener


def _left(white: Sequence[Array], lags: int) -> float:
    """Largest correlation of the whitened input, the last column, with its past."""
    covariance = np.sum([covariances(values[:, -1:], lags)[lags:, 0, 0] for values in white], axis=0)
    return float(np.max(np.abs(covariance[1:] / covariance[0])))


def _pooled(weights: Array, covariance: Array) -> float:
    """p-value of weights that should be zero: with a white input they are as correlated as the output is."""
    from scipy.linalg import toeplitz
    from scipy.stats import chi2

    values, vectors = np.linalg.eigh(toeplitz(covariance))
    kept = values > 1e-3 * values[-1]
    return float(chi2.sf(np.sum((vectors[:, kept].T @ weights) ** 2 / values[kept]), int(np.sum(kept))))
