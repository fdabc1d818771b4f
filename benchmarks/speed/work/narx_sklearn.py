"""The same network by scikit-learn: MLPRegressor by L-BFGS, until it is as good as it is told to be."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from sklearn.neural_network import MLPRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from speed.duffing import lagged

warnings.filterwarnings("ignore")


def work(data: dict[str, Any], settings: dict[str, Any]) -> Callable[[], dict[str, Any]]:
    """So many iterations as told: the section looks for the fewest that reach the goal."""
    rows, following = lagged(data["u"], data["y"])
    other, after = lagged(data["test_u"], data["test_y"])
    spread = float(np.std(following))

    def act() -> dict[str, Any]:
        network = MLPRegressor(
            hidden_layer_sizes=(10,), activation="tanh", solver="lbfgs", alpha=0.0, tol=0.0,
            max_iter=settings["iterations"], max_fun=10**9, random_state=settings["seed"],
        )  # fmt: skip
        found = make_pipeline(StandardScaler(), network).fit(rows, following / spread)
        train = np.sqrt(np.mean((found.predict(rows) * spread - following) ** 2))
        fresh = np.sqrt(np.mean((found.predict(other) * spread - after) ** 2))
        return {"train": train, "fresh": fresh, "iterations": network.n_iter_}

    return act
