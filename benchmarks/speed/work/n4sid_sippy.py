"""N4SID by SIPPY."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Callable
from typing import Any

from sippy_unipi import system_identification


def shorter(data: dict[str, Any]) -> dict[str, Any]:
    """Beginning of the record."""
    return {key: value[:1500] for key, value in data.items()}


def work(data: dict[str, Any], settings: dict[str, Any]) -> Callable[[], dict[str, Any]]:
    """Order and horizon as told; D zero, as for the others."""

    def act() -> dict[str, Any]:
        with contextlib.redirect_stdout(io.StringIO()):
            found = system_identification(
                data["y"], data["u"], "N4SID", SS_fixed_order=settings["order"],
                SS_f=settings["horizon"], SS_p=settings["horizon"], SS_D_required=False,
            )  # fmt: skip
        return {"a": found.A, "b": found.B, "c": found.C, "d": found.D}

    return act
