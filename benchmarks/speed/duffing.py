"""The oscillator that the networks learn, and how a network is judged."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

sys.path.append(str(Path(__file__).resolve().parents[1]))

from estimators import duffing, lagged

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


def records(samples: int) -> dict[str, NDArray[np.float64]]:
    """Training and test record."""
    train, test = duffing(samples, 1), duffing(2000, 2)
    return {"u": train["u"], "y": train["y"], "test_u": test["u"], "test_y": test["y"]}


__all__ = ["lagged", "records"]
