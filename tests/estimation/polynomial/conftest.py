"""Systems with known polynomials."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from idloop.estimation.black_box.sampled import SampledData

TRUE = {"a": [1.0, -1.5, 0.7], "b": [0.0, 1.0, 0.5], "c": [1.0], "d": [1.0], "f": [1.0]}


@pytest.fixture(scope="session")
def made() -> Callable[..., SampledData]:
    """Factory of records of A y = B / F u + C / D e under a random binary command."""

    def make(samples: int = 1000, seed: int = 0, noise: float = 0.5, discard: int = 200, **parts: Any) -> SampledData:
        p = TRUE | parts
        rng = np.random.default_rng(seed)
        u = rng.choice([-1.0, 1.0], samples + discard)
        e = noise * rng.normal(size=samples + discard)
        y = lfilter([1.0], p["a"], lfilter(p["b"], p["f"], u) + lfilter(p["c"], p["d"], e))
        # The past before the record is unknown to the estimators, as in a real experiment.
        return SampledData(
            f"made-{seed}", u[discard:, None], y[discard:, None], 0.1, ("u",), ("V",), ("y",), ("rad",)
        )  # fmt: skip

    return make


@pytest.fixture(scope="session")
def looped() -> Callable[..., SampledData]:
    """Factory of records of y = 0.8 y(t-1) + u(t-1) + C e under proportional feedback with a dither."""

    def make(samples: int, seed: int, c: tuple[float, float] = (1.0, 0.7), pole: float = 0.8) -> SampledData:
        rng = np.random.default_rng(seed)
        dither, e = rng.choice([-0.5, 0.5], samples), rng.normal(size=samples)
        y, u = np.zeros(samples), np.zeros(samples)
        for t in range(samples):
            if t:
                y[t] = pole * y[t - 1] + u[t - 1] + c[1] * e[t - 1]
            y[t] += c[0] * e[t]
            u[t] = dither[t] - 0.6 * y[t]
        return SampledData(
            f"loop-{seed}", u[:, None], y[:, None], 0.1, ("u",), ("V",), ("y",), ("rad",), reference=dither
        )

    return make
