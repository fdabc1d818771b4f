"""NARX network of ten units by Levenberg-Marquardt, by idloop."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from idloop.estimation.black_box.sampled import SampledData
from idloop.estimation.networks import Division, TrainingRules, narx_neural


def work(data: dict[str, Any], settings: dict[str, Any]) -> Callable[[], dict[str, Any]]:
    """All samples train; it stops after so many epochs as told, or where nothing is left to gain."""
    record = SampledData("duffing", data["u"][:, None], data["y"][:, None], 0.01)
    test = SampledData("duffing", data["test_u"][:, None], data["test_y"][:, None], 0.01)
    rules = TrainingRules(epochs=settings["iterations"])

    def act() -> dict[str, Any]:
        model = narx_neural(record, hidden=10, division=Division(1.0, 0.0, 0.0), rules=rules, seed=settings["seed"])
        train, fresh = (float(np.sqrt(np.mean(model.innovations(one)[2:] ** 2))) for one in (record, test))
        return {"train": train, "fresh": fresh}

    return act
