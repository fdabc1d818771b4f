"""Systems with known polynomials."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from idloop.estimation.black_box.sampled import SampledData


@pytest.fixture(scope="session")
def made() -> Callable[..., SampledData]:
    """Factory of records of A y = B / F u + C / D e from rest under a random binary command."""

    def make(samples: int = 1000, seed: int = 0, noise: float = 0.5, **parts: Any) -> SampledData:
        p = {"a": [1.0], "b": [0.0, 1.0, 0.5], "c": [1.0], "d": [1.0], "f": [1.0]} | parts
        rng = np.random.default_rng(seed)
        u, e = rng.choice([-1.0, 1.0], samples), noise * rng.normal(size=samples)
        y = lfilter([1.0], p["a"], lfilter(p["b"], p["f"], u) + lfilter(p["c"], p["d"], e))
        return SampledData(f"made-{seed}", u[:, None], y[:, None], 0.1, ("u",), ("V",), ("y",), ("rad",))

    return make
