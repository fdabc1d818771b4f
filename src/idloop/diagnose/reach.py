"""How large an effect can be on a machine: beyond its travel, its command or its bounds no size is worth naming."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from idloop.physics.effect import OUTPUT

if TYPE_CHECKING:
    from idloop.diagnose.detection import DetectionLimit
    from idloop.diagnose.proposals import Proposal
    from idloop.physics.model import Model
    from idloop.physics.trial import Scales

# How near to its bound a value is at it, as a part of the way there from nothing.
_AT_BOUND = 1e-3


@dataclass(frozen=True)
class Reach:
    """The largest size that an effect can have in an experiment.

    Attributes
    ----------
    most : float
        Infinite where nothing bounds it.
    text : str
        What bounds it, such as "the whole travel of 0.128 m".
    """

    most: float = math.inf
    text: str = ""

    def within(self, limit: DetectionLimit) -> DetectionLimit:
        """The detection limit without the sizes that are out of reach."""
        if limit.at_most:
            return limit
        least, sure = (value if value <= self.most else math.inf for value in (limit.least, limit.sure))
        return replace(limit, least=least, sure=sure)


def reach_of(proposal: Proposal, limit: DetectionLimit, model: Model, scales: Scales) -> Reach:
    """Tell how large an effect can be.

    Parameters
    ----------
    proposal : Proposal
    limit : DetectionLimit
        Names the parameter that tells its size.
    model : Model
    scales : Scales
        At the effect's site.

    Returns
    -------
    Reach
    """
    spec = proposal.effect.spec(limit.parameter)
    found = [Reach()]
    bound = max(spec.max - spec.neutral, spec.neutral - spec.min)
    if math.isfinite(bound):
        found.append(Reach(bound, f"it can be, {bound:.3g} {limit.unit}".rstrip(" -")))
    travel, speed = "the whole travel", "the largest speed"
    sizes = {"{position}": (travel, scales.span), "{input}": ("the largest command", scales.command_most)}
    if proposal.effect.site == OUTPUT:
        output = next(one for one in model.outputs if one.site == proposal.at)
        what, size = (travel, scales.span) if output.field == "position" else (speed, scales.speed_most)
        sizes["{output}"] = (what, size * abs(output.scale))
    if spec.unit in sizes:
        what, size = sizes[spec.unit]
        found.append(Reach(size, f"{what} of {size:.3g} {limit.unit}"))
    return min(found, key=lambda one: one.most)


def at_its_bound(model: Model, proposal: Proposal) -> str:
    """Say that the strength of a fitted effect ended where no larger one makes sense; empty where it did not.

    Nothing but the bound kept it from growing: it stands in for something, or for the scale of all forces, which
    friction that takes a share of the drive's force imitates while the axis is only driven. Of an effect that takes a
    plainer one's place, what makes it more than that is its strength.

    Parameters
    ----------
    model : Model
        Fitted, with the effect.
    proposal : Proposal
    """
    sought = {proposal.effect.strength} if proposal.replaces is None else proposal.beyond
    for spec in proposal.effect.parameters:
        key = f"{proposal.name}.{spec.name}"
        # What may go another parameter's way is a share, and all of it is one.
        if spec.name not in sought or spec.optional or key not in model.free:
            continue
        for bound in (spec.min, spec.max):
            way = abs(bound - spec.neutral)
            if math.isfinite(way) and way > 0.0 and abs(model.values[key] - bound) <= _AT_BOUND * way:
                return f"its {spec.name} ended at the bound of what makes sense, {bound:g}"
    return ""
