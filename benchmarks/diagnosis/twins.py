"""Effects that are one and the same equation: naming either is right.

Each rule says why. What is merely alike (a tie in the data) is no twin: that is what sets are for.
Names are brought to a common form, a set of elementary pieces, and pieces are compared.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from case import Case

# Each holds those before it.
_DRY = ("coulomb_friction", "stribeck_friction", "presliding_friction")


def pieces(case: Case, model: Any, name: str) -> frozenset[str]:
    """Elementary pieces of an effect in this case.

    Parameters
    ----------
    case : Case
    model : Model
        For its bodies and outputs.
    name : str
        ``effect@site``.
    """
    effect, _, at = name.partition("@")
    first = model.bodies[0]
    # a saturation stands before the offset, a lag leaves a constant alone
    nonlinear_behind = any(h.effect in ("dead_zone", "speed_limit_voltage") for h in case.hidden)
    if effect == "asymmetric_friction":
        # level (1 + ratio sign w) sign w = level sign w + level ratio, at rest too: friction and a constant
        return frozenset({f"coulomb_friction@{at}", f"load_torque@{at}"})
    if effect == "input_offset" and not nonlinear_behind:
        # gain (u + offset) = gain u + constant: a constant force on the driven body, behind a linear drive
        return frozenset({f"load_torque@{first}"})
    if effect == "sensor_delay" and len(model.outputs) == 1:
        # everything between command and sensor is time invariant, so with one sensor the order does not matter
        return frozenset({"input_delay@input"})
    if effect == "sensor_offset" and at.startswith("position") and _no_place_counts(case, model):
        # no force depends on the position and no other sensor shows it: the origin is a convention
        return frozenset()
    if case.nuisances is not None and effect in _DRY:
        # all dry friction falls a little with the speed and builds up over a reach: the richer effect holds the plainer
        return frozenset(f"{each}@{at}" for each in _DRY[: _DRY.index(effect) + 1])
    if effect == "viscous_friction" and f"{at}.viscous_friction" in model.free:
        # the start model has this drag and estimates it
        return frozenset()
    return frozenset({name})


def _no_place_counts(case: Case, model: Any) -> bool:
    placed = ("gravity", "imbalance", "cogging", "cable_spring", "sensor_ripple")
    sensors = [o for o in model.outputs if o.field == "position"]
    return len(sensors) == 1 and not any(h.effect in placed for h in case.hidden)


def all_pieces(case: Case, model: Any, names: Iterable[str]) -> frozenset[str]:
    """Pieces of several effects."""
    found: frozenset[str] = frozenset()
    for name in names:
        found |= pieces(case, model, name)
    return found


def same(case: Case, model: Any, names: Iterable[str], given: frozenset[str] = frozenset()) -> bool:
    """Whether all effects of a set are one equation, beside the pieces that the model has already."""
    return len({pieces(case, model, name) - given for name in names}) <= 1
