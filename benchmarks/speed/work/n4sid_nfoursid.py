"""N4SID by nfoursid."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pandas as pd
from nfoursid.nfoursid import NFourSID


def shorter(data: dict[str, Any]) -> dict[str, Any]:
    """Beginning of the record."""
    return {key: value[:600] for key, value in data.items()}


def work(data: dict[str, Any], settings: dict[str, Any]) -> Callable[[], dict[str, Any]]:
    """Order and horizon as told."""
    outputs = [f"y{k}" for k in range(data["y"].shape[1])]
    frame = pd.DataFrame(data["y"], columns=outputs)
    frame["u"] = data["u"][:, 0]

    def act() -> dict[str, Any]:
        solver = NFourSID(frame, output_columns=outputs, input_columns=["u"], num_block_rows=settings["horizon"])
        solver.subspace_identification()
        found, _ = solver.system_identification(rank=settings["order"])
        return {"a": found.a, "b": found.b, "c": found.c, "d": found.d}

    return act
