"""Names of signals as python-control takes them."""

from __future__ import annotations

from collections.abc import Sequence


def control_names(names: Sequence[str]) -> list[str]:
    """Signal names without dots, which python-control keeps for its own use: ``motor.effort`` is ``motor_effort``."""
    return [name.replace(".", "_") for name in names]
