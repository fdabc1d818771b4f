"""A measured frequency response with its uncertainty: what every estimator in the frequency domain returns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from idloop.arrays import Array, Complex, Mask
from idloop.errors import InputError
from idloop.estimation.black_box.labels import control_names

if TYPE_CHECKING:
    import control
    from idloop.estimation.nonparametric.distortion import Distortion


@dataclass(frozen=True, eq=False)
class FrequencyResponse:
    """Frequency response at a set of frequencies, without a model between them."""

    method: str  # as "spa" or "welch"
    frequency: Array  # shape (f,): [Hz], increasing; lines that no input excites are left out
    response: Complex  # shape (f, p, m): from the inputs to the outputs [output unit / input unit]
    stderr: Array  # shape (f, p, m): root mean square of the complex error of `response`; NaN where it is unknown
    degrees: Array  # shape (f,): degrees of freedom of `stderr`
    sample_time: float  # period of the data [s]
    input_names: tuple[str, ...]
    input_units: tuple[str, ...]
    output_names: tuple[str, ...]
    output_units: tuple[str, ...]
    samples: int  # that the estimate rests on
    coherence: Array | None = None  # shape (f, p): share of each output's power that all inputs together explain
    # shape (f, p): one-sided power density of what the inputs do not explain, and its standard error [unit² / Hz]
    disturbance: Array | None = None
    disturbance_stderr: Array | None = None
    distortion: Distortion | None = None  # noise and nonlinear distortion of a best linear approximation
    # Width of what is averaged over, at half its height [Hz]: a narrower peak comes out too low and too wide, which
    # `stderr` does not include. None where every line is its own.
    resolution: float | None = None
    notes: tuple[str, ...] = ()  # remarks for the user

    @property
    def resolved(self) -> Mask:
        """Which lines lie at or above the resolution, shape (f,): below it an average reaches over 0 Hz.

        All of them where none does.
        """
        # Rounding must not put a line below the resolution.
        found = self.frequency >= (self.resolution or 0.0) * (1.0 - 1e-9)
        return np.asarray(found if np.any(found) else ~found)

    def radius(self, share: float = 0.95) -> Array:
        """Radius of the circle about each estimate that holds the true response with probability `share`.

        For errors that are circular complex normal, the squared distance over the estimated variance is
        F-distributed with 2 and `degrees` degrees of freedom.

        Returns shape (f, p, m). Raises InputError: a share that is no probability.
        """
        from scipy.stats import f

        if not 0 < share < 1:
            raise InputError(f"band with probability {share:g}; give a share between 0 and 1")
        known = np.isfinite(self.degrees) & (self.degrees > 0)
        factor = np.full(self.degrees.shape, np.nan)
        factor[known] = np.sqrt(f.ppf(share, 2.0, self.degrees[known]))
        return np.asarray(factor[:, None, None] * self.stderr)

    @property
    def system(self) -> control.FrequencyResponseData:
        """As python-control's frequency response data: plots, margins, series and feedback connections."""
        import control

        return control.FrequencyResponseData(
            np.moveaxis(self.response, 0, -1),
            2 * np.pi * self.frequency,
            dt=self.sample_time,
            inputs=control_names(self.input_names),
            outputs=control_names(self.output_names),
            name=self.method,
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        names = (
            "method", "frequency", "stderr", "degrees", "sample_time", "samples", "resolution", "coherence",
            "disturbance", "disturbance_stderr", "notes",
        )  # fmt: skip
        found = {name: getattr(self, name) for name in names}
        found |= {"inputs": self.input_names, "outputs": self.output_names, "distortion": None}
        found["response"] = {"real": self.response.real, "imag": self.response.imag}
        if self.distortion is not None:
            shares = self.distortion.shares(self.response[:, :, 0])
            found["distortion"] = self.distortion.to_dict() | {"shares": shares}
        return found

    def plot(self, axes: Any = None, share: float = 0.95) -> Any:
        """Draw the Bode diagram with its bands, and the coherence where it is known, from the resolution upwards.

        `axes`: for magnitude, phase and, where given, coherence; `share`: probability of the bands.
        """
        from idloop import drawing
        from idloop.estimation.black_box.labels import draw_bode, new_axes

        kept, radius = self.resolved, self.radius(share)
        with drawing.styled():
            rows = 2 if self.coherence is None else 3
            axes = new_axes(axes, rows, 2.5 * rows)
            if self.distortion is not None:
                self.distortion.draw_levels(axes[0])
            fine = "" if self.resolution is None else f", resolution {self.resolution:.3g} Hz"
            bands = f", bands of {100 * share:g} %" if np.any(np.isfinite(radius)) else ""
            title = f"{self.method}{bands}{fine}"
            draw_bode(axes[:2], self, self.frequency[kept], self.response[kept], title, radius[kept])
            if self.coherence is not None and len(axes) > 2:
                for index, name in enumerate(self.output_names):
                    look = drawing.model_look(index)
                    drawing.line(axes[2], self.frequency[kept], self.coherence[kept, index], label=name, **look)
                axes[2].set(ylim=(0.0, 1.05), ylabel=drawing.label("coherence", "-"))
            axes[-1].set_xlabel(drawing.label("frequency", "Hz"))
        return axes
