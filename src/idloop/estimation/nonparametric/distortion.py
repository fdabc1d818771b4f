"""Noise and nonlinear distortion of a measured response, separated."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from idloop.arrays import Array, Complex
from idloop.estimation.black_box.labels import new_axes

_ROUNDING = 1e-9  # of a signal: rounding that counts as noise in noise-free records


@dataclass(frozen=True, eq=False)
class LineLevels:
    """What the outputs show at one kind of lines."""

    frequency: Array  # shape (g,): [Hz]
    level: Array  # shape (g, p): peak amplitude of the line, averaged over the periods [output unit]
    noise: Array  # shape (g, p): what noise alone leaves of it, root mean square [output unit]
    p_values: Array  # shape (p,): probability of lines this far above the noise under noise alone

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        return {"frequency": self.frequency, "level": self.level, "noise": self.noise}


@dataclass(frozen=True, eq=False)
class Distortion:
    """Where the uncertainty of a best linear approximation comes from."""

    frequency: Array  # shape (f,): excited lines [Hz]
    noise: Array  # shape (f, p): standard error of the response from noise alone [output unit / input unit]
    # shape (f, p): standard error from noise and stochastic nonlinear distortion [output unit / input unit]
    total: Array
    # shape (f, p): root mean square of the stochastic nonlinear distortion in a single realisation [output unit / input
    # unit]
    stochastic: Array
    # shape (f, p): noise in a single realisation, averaged over its periods [output unit / input unit]
    single_noise: Array
    # shape (f, p): unbiased estimate of the distortion's variance in a single realisation, negative by chance:
    # `stochastic` before it is cut at 0 [(output unit / input unit)²]
    excess: Array
    p_values: Array  # shape (p,): probability that noise alone makes so much of it
    # Experiments, and periods averaged in the shortest of them
    realisations: int
    periods: int
    output_names: tuple[str, ...]
    output_units: tuple[str, ...]
    # The outputs at the excited lines and at those that are left empty, where odd and even nonlinearity show (odd
    # random harmonic grid)
    excited: LineLevels | None = None
    odd: LineLevels | None = None
    even: LineLevels | None = None

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        names = ("frequency", "noise", "total", "stochastic", "single_noise", "realisations", "periods")
        lines = {"odd": self.odd, "even": self.even}
        probabilities = {name: None if one is None else one.p_values for name, one in lines.items()}
        levels = {
            name: None if one is None else one.to_dict() for name, one in (lines | {"excited": self.excited}).items()
        }
        found = {name: getattr(self, name) for name in names}
        return found | levels | {"p_values": {"stochastic": self.p_values, **probabilities}}

    def shares(self, response: Complex) -> list[dict[str, float]]:
        """Noise and distortion as parts of the linear response, root mean square over the lines.

        `response` (f, p): best linear approximation at the excited lines. Returns: for each output ``noise`` and
        ``stochastic``, both of one experiment, and ``odd`` and ``even`` of the output at the excited lines, where lines
        were left empty; NaN elsewhere. Differences to the noise are averaged over the lines before they are cut at 0;
        ``p_stochastic``, ``p_odd`` and ``p_even`` are the probabilities that noise alone makes so much.
        """

        def rms(values: NDArray[Any]) -> float:
            return float(np.linalg.norm(values)) / float(np.sqrt(values.size)) if values.size else float("nan")

        def above_noise(lines: LineLevels | None, index: int) -> float:
            if lines is None or self.excited is None or not lines.frequency.size:
                return float("nan")
            power = float(np.mean(lines.level[:, index] ** 2 - lines.noise[:, index] ** 2))
            return math.sqrt(max(power, 0.0)) / max(rms(self.excited.level[:, index]), 1e-300)

        found = []
        for index in range(len(self.output_names)):
            size = max(rms(response[:, index]), 1e-300)
            found.append(
                {
                    "noise": rms(self.single_noise[:, index]) / size,
                    "stochastic": math.sqrt(max(float(np.mean(self.excess[:, index])), 0.0)) / size,
                    "odd": above_noise(self.odd, index),
                    "even": above_noise(self.even, index),
                    "p_stochastic": float(self.p_values[index]),
                    "p_odd": math.nan if self.odd is None else float(self.odd.p_values[index]),
                    "p_even": math.nan if self.even is None else float(self.even.p_values[index]),
                }
            )
        return found

    def draw_levels(self, axes: Any, only: int | None = None) -> None:
        """Add the standard errors with and without nonlinear distortion to the magnitudes of a Bode diagram."""
        from idloop import drawing

        for index, name in enumerate(self.output_names):
            if only not in (None, index):
                continue
            look = {"markersize": 3, "linestyle": "none", "rasterized": self.frequency.size > drawing.RASTERISE_FROM}
            of = "" if only == index else f", {name}"
            axes.plot(self.frequency, self.total[:, index], "s", color="#E69F00", label=f"total error{of}", **look)
            axes.plot(self.frequency, self.noise[:, index], "v", color=drawing.BAND, label=f"noise{of}", **look)

    def plot(self, axes: Any = None) -> Any:
        """Draw the output at excited and empty lines, or else the standard errors; returns the matplotlib axes."""
        from idloop import drawing

        with drawing.styled():
            axes = new_axes(axes, 1, 3.5)
            if self.excited is None:
                self.draw_levels(axes)
                axes.set_ylabel(drawing.label("standard error", "output/input"))
            else:
                kinds = (
                    ("excited", self.excited, "o", drawing.MEASURED),
                    ("odd distortion", self.odd, "s", drawing.MODELS[1]),
                    ("even distortion", self.even, "D", drawing.MODELS[0]),
                )
                for text, lines, marker, colour in kinds:
                    if lines is None or lines.frequency.size == 0:
                        continue
                    for index in range(lines.level.shape[1]):
                        shown = {"label": text if index == 0 else None, "markersize": 3, "linestyle": "none"}
                        axes.plot(lines.frequency, lines.level[:, index], marker, color=colour, **shown)
                        shown["label"] = "noise" if index == 0 and lines is self.excited else None
                        axes.plot(lines.frequency, lines.noise[:, index], ".", color=drawing.BAND, **shown)
                axes.set_ylabel(drawing.label(f"amplitude of {self.output_names[0]}", self.output_units[0]))
            axes.set(xscale="log", yscale="log")
            axes.set_xlabel(drawing.label("frequency", "Hz"))
            axes.legend()
        return axes


def combined_p_value(total: Array, noise: Array, degrees: Array, noise_degrees: Array, size: Array) -> Array:
    """Probability of a variance this far above that of the noise under noise alone, all lines together.

    At each line the ratio is F-distributed under linearity, whatever the noise there; the lines' probabilities are
    combined by Fisher's method (-2 ln p of independent ones adds up to a chi-square), so that a few clear lines are not
    lost among noisy ones.

    `total`, `noise` (g, p): variance with the distortion, and of noise alone; `degrees`, `noise_degrees` (g, 1):
    degrees of freedom of each; `size` (g, p) or (1, p): of the signal, for its rounding. Returns shape (p,): NaN where
    there is no line.
    """
    from scipy.stats import chi2, f

    if not len(total):
        return np.full(total.shape[1], np.nan)
    rounding = np.maximum((_ROUNDING * np.max(size, axis=0)) ** 2, 1e-300)
    logarithm = f.logsf((total + rounding) / (noise + rounding), degrees, noise_degrees)
    return np.asarray(chi2.sf(-2.0 * np.sum(logarithm, axis=0), 2 * len(total)))
