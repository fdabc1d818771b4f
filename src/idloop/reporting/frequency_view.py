"""Frequency responses of measurement and model by one estimator from one command, and poles of the linear part."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from idloop.errors import IdloopError
from idloop.validation.words import short

if TYPE_CHECKING:
    from idloop.estimation.nonparametric import FrequencyResponse
    from idloop.validation import Comparison

# Part of the largest pole below which a pole, or its imaginary part, is the rounding error of an eigenvalue solver.
_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class FrequencyView:
    """A model beside a record over frequency.

    Attributes
    ----------
    measured, model : FrequencyResponse
        Of the measured outputs and of the free run, at the same lines.
    poles : array of complex
        Of the linear part of the model [1/s].
    """

    measured: FrequencyResponse
    model: FrequencyResponse
    poles: NDArray[np.complex128]

    @property
    def pole_texts(self) -> list[str]:
        """Each real pole by its value, each pair by its natural frequency and damping ratio, slow ones first."""
        texts = []
        # What an eigenvalue solver leaves of zero.
        nothing = _ROUNDING * float(np.max(np.abs(self.poles), initial=0.0))
        for pole in sorted(self.poles, key=abs):
            size = float(abs(pole))
            if abs(pole.imag) <= _ROUNDING * size:
                texts.append("0 (integrator)" if size <= nothing else f"{short(pole.real)} 1/s")
            elif pole.imag > 0.0:
                texts.append(f"{short(size / (2 * np.pi))} Hz, damping ratio {short(-pole.real / size)}")
        return texts


def frequency_view(comparison: Comparison) -> FrequencyView | None:
    """Estimate both responses by Welch's method; None where the record or the free run allows none.

    The free run goes through the same estimator, so that leakage and nonlinear effects show in both alike.
    """
    from idloop.estimation.black_box.sampled import sampled
    from idloop.estimation.nonparametric import welch
    from idloop.physics.engine import Engine

    record = comparison.record
    try:
        measured, model = (welch(sampled(one)) for one in (record, replace(record, output=comparison.simulated)))
    except IdloopError:
        return None
    if not np.array_equal(measured.frequency, model.frequency):
        return None
    poles = np.linalg.eigvals(Engine(comparison.model).linearise().A).astype(complex)
    return FrequencyView(measured, model, poles)
