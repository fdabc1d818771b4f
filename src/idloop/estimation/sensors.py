"""Which output measures what of which body."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from idloop.physics import Model


def body_sensors(model: Model) -> list[tuple[int | None, int | None]]:
    """For every body the output that measures its position and its velocity.

    Returns
    -------
    list of (int or None, int or None)
        Indices into the model's outputs, in the order of ``model.bodies``.
    """
    found: dict[str, list[int | None]] = {body: [None, None] for body in model.bodies}
    for row, output in enumerate(model.outputs):
        kind = 0 if output.field == "position" else 1
        if output.field in ("position", "velocity") and found[output.body][kind] is None:
            found[output.body][kind] = row
    return [(pair[0], pair[1]) for pair in found.values()]


def lagging_sensors(model: Model) -> set[int]:
    """Outputs that, as the model has it, show another motion than that of the moment.

    Returns
    -------
    set of int
        Indices into the model's outputs.
    """
    sites = {active.at for active in model.effects if active.effect.site == "output" and active.effect.lags}
    return {row for row, output in enumerate(model.outputs) if output.site in sites}
