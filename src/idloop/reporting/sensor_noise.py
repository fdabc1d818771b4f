"""Noise of the sensors as the model file states it, held against the data: no reading is quieter than its noise."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from idloop.diagnosis import Ladder
    from idloop.physics import Model
    from idloop.validation import Comparison

# The stated noise is refuted where a model misses less than this part of it, over so many samples at least: with
# fewer, or closer to it, that happens by chance.
REFUTED = 0.7
FEWEST = 100


def refuted_noise(comparisons: Iterable[Comparison]) -> dict[str, float]:
    """Outputs of which a model misses less than the stated noise, and how much that is.

    Returns: least rms of the free-run error, which bounds the noise that the sensor really has, by the name of the
    output.
    """
    least: dict[str, float] = {}
    for one in comparisons:
        if len(one.time) < FEWEST:
            continue
        for output in one.model.outputs:
            missed = one.rmse[output.name]
            if output.noise is not None and missed < REFUTED * output.noise:
                least[output.name] = min(missed, least.get(output.name, np.inf))
    return least


def believed_noise(model: Model, refuted: Iterable[str]) -> dict[str, float]:
    """Standard deviation of the noise of each output: stated by the model file, and not among the refuted ones."""
    wrong = set(refuted)
    return {o.name: o.noise for o in model.outputs if o.noise is not None and o.name not in wrong}


def least_error(ladder: Ladder, name: str) -> float:
    """Least NRMSE of an output on the data that judge, at any step; infinite where none is known.

    A floor well above it is none. Other data have another motion, and so another NRMSE for the same noise.
    """
    every = [(step.validation or step.train).get("nrmse", {}).get(name) for step in ladder.steps]
    return min((float(one) for one in every if one is not None and np.isfinite(one)), default=np.inf)
