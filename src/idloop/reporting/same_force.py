"""Tied effects that, as they were fitted, are one force: no motion separates them, a check by hand may."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from idloop.arrays import Array
from idloop.diagnosis.equivalence.equivalent_effects import EquivalentEffects
from idloop.reporting.estimates import NORMAL_95

if TYPE_CHECKING:
    from idloop.diagnosis import Candidate
    from idloop.physics import Model
    from idloop.physics.model import ActiveEffect


# Part of the largest force over a turn by which two forces may differ and be one; the 95 % intervals of their own
# parameters allow more, up to the second.
_SAME, _MOST = 0.02, 0.1
_POSITIONS = np.linspace(-2.0 * math.pi, 2.0 * math.pi, 81)
_VELOCITIES = (0.0, *(sign * 10.0**power for power in range(-3, 4) for sign in (-1.0, 1.0)))
# A weight is one of the causes of a force over the angle.
_CHECK = "tilt the axis until gravity acts along it: a weight stops pulling, a spring, a magnet or a slip ring does not"
_EITHER = "whichever is added, the model is the same"


def same_forces(candidates: Sequence[Candidate], names: Sequence[str]) -> tuple[EquivalentEffects, ...]:
    """Groups of the tied effects `names` that are the same force at every angle and speed, as they were fitted.

    Their equations differ, such as by a phase that was found to be zero. Candidates without a model are passed over.
    """
    groups: list[list[Candidate]] = []
    for one in candidates:
        if one.name in names and one.model is not None:
            group = next((group for group in groups if _alike(group[0], one)), None)
            if group is None:
                groups.append([one])
            else:
                group.append(one)
    return tuple(EquivalentEffects(tuple(c.name for c in g), (_CHECK, _EITHER)) for g in groups if len(g) > 1)


def _alike(one: Candidate, other: Candidate) -> bool:
    if one.at != other.at or one.model is None or other.model is None:
        return False
    first, second = _active(one.model, one.name), _active(other.model, other.name)
    if first is None or second is None:
        return False
    here, there = _force(one.model, first), _force(other.model, second)
    size = np.maximum(np.max(np.abs(here), axis=1), np.max(np.abs(there), axis=1))
    if not np.all(np.isfinite(size)) or not np.any(size > 0.0):
        return False
    spread = np.maximum(_spread(one.model, first, here), _spread(other.model, second, there))
    allowed = np.clip(spread, _SAME * size, _MOST * size)
    return bool(np.all(np.max(np.abs(here - there), axis=1) <= allowed))


def _active(model: Model, name: str) -> ActiveEffect | None:
    """The effect where it is a force over an angle without memory."""
    found = next((one for one in model.effects if one.name == name), None)
    plain = found is not None and found.effect.force is not None and not found.effect.states
    return found if plain and found is not None and found.effect.needs_angle else None


def _spread(model: Model, active: ActiveEffect, force: Array) -> Array:
    """How far the force may be off at each speed, by the 95 % intervals of the effect's parameters."""
    moved = [np.max(np.abs(_force(other, active) - force), axis=1) for other in _ends(model, active)]
    return np.max(moved, axis=0) if moved else np.zeros(len(_VELOCITIES))


def _ends(model: Model, active: ActiveEffect) -> Iterator[Model]:
    for spec in active.effect.parameters:
        one = model.parameter(f"{active.name}.{spec.name}")
        if one.free and one.stderr is not None and math.isfinite(one.stderr):
            yield model.with_values({one.name: float(np.clip(one.value + NORMAL_95 * one.stderr, one.min, one.max))})


def _force(model: Model, active: ActiveEffect) -> Array:
    """Force at each speed (rows) and angle (columns)."""
    equation = active.effect.force
    assert equation is not None  # noqa: S101  (asked before)
    values = [model.values[f"{active.name}.{spec.name}"] for spec in active.effect.parameters]
    return np.array([[equation(q, v, 1.0, 0.0, (), values) for q in _POSITIONS] for v in _VELOCITIES])
