"""Outputs that measure position and velocity of the bodies."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from idloop.physics import Model


def body_sensors(model: Model) -> list[tuple[int | None, int | None]]:
    """Indices of the outputs that measure position and velocity of every body of the model; None without a sensor."""
    found: dict[str, list[int | None]] = {body: [None, None] for body in model.bodies}
    for row, output in enumerate(model.outputs):
        kind = 0 if output.field == "position" else 1
        if output.field in ("position", "velocity") and found[output.body][kind] is None:
            found[output.body][kind] = row
    return [(pair[0], pair[1]) for pair in found.values()]


def lagging_sensors(model: Model) -> set[int]:
    """Indices of the outputs with a delay or lag in the model."""
    sites = {active.at for active in model.effects if active.effect.site == "output" and active.effect.lags}
    return {row for row, output in enumerate(model.outputs) if output.site in sites}
