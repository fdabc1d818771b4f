"""N4SID by idloop."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from idloop.estimation.black_box.sampled import SampledData
from idloop.estimation.subspace import n4sid

NAMES, UNITS = ("motor", "load1", "load2", "load3"), ("rad",) * 4


def shorter(data: dict[str, Any]) -> dict[str, Any]:
    """Beginning of the record: to have everything compiled."""
    return {key: value[:3000] for key, value in data.items()}


def work(data: dict[str, Any], settings: dict[str, Any]) -> Callable[[], dict[str, Any]]:
    """Order and horizon as told; nothing else is set."""
    wide = data["y"].shape[1]
    record = SampledData("torsion", data["u"], data["y"], 0.01, ("current",), ("A",), NAMES[:wide], UNITS[:wide])

    def act() -> dict[str, Any]:
        found = n4sid(record, settings["order"], horizon=settings["horizon"], **settings.get("options", {}))
        return {"a": found.a, "b": found.b, "c": found.c, "d": found.d}

    return act
