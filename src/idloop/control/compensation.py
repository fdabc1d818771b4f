"""Plan of a compensator: which effects of a fitted model it cancels, how, and why not the others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from idloop.errors import InputError
from idloop.physics.controller_section import controller_inputs, joint_and_field
from idloop.physics.effect import COUPLING, INPUT, OUTPUT
from idloop.physics.hooks import Hook
from idloop.physics.model import ActiveEffect, Model, OutputSignal, values_of
from idloop.spelling import did_you_mean_or_known

# How an effect is cancelled.
INVERSE, FORCE, TAKE_UP, SHIFT = "inverse", "force", "take-up", "shift"
WORDS = {
    INVERSE: "the inverse of its equation in front of the drive",
    FORCE: "feedforward of the force that it requires along the reference",
    TAKE_UP: "a feedforward force across the gap at a reversal of the reference",
    SHIFT: "a shift of the reference by the gap at its reversals",
}
_IN_THE_SENSOR = "it acts on the sensor, not on the motion"
_NO_MOTION = "the controller has no reference along which its force could be computed"
_NO_POSITION = "its force depends on the position, and the reference is a velocity"
# Positions at which a force is compared to find whether it depends on the position; without a common period.
_PLACES = (0.0, 0.137, 1.0, 2.71, -0.59)


@dataclass(frozen=True)
class Compensation:
    """Effects to cancel, with limits."""

    model: Model  # the fitted model of the machine
    # Effects to cancel, as ``name@site`` or ``name`` for all sites; empty: all that can be
    effects: tuple[str, ...] = ()
    # Largest command that the compensation adds, in its unit; None: half of the controller's limit
    limit: float | None = None
    # Speed of the reference below which dry friction is cancelled in proportion to the speed, so that the force has no
    # step at a reversal. None: the speed that it gives the whole machine in two periods.
    velocity_width: float | None = None
    # Size of a command below which a step of an inverse is applied in part; None: a quarter of the height of the step,
    # more where sensor noise alone gives larger commands
    command_width: float | None = None
    # Time in which a gap is crossed [s]; None: 20 periods, longer where the limit requires it
    crossing_time: float | None = None

    def __post_init__(self) -> None:
        for key in ("limit", "velocity_width", "command_width", "crossing_time"):
            value = getattr(self, key)
            if value is not None and not 0.0 < value < float("inf"):
                raise InputError(f"compensation: {key} is {value:g} but must be above 0 and finite")


@dataclass(frozen=True)
class Cancelled:
    """An effect that is cancelled."""

    active: ActiveEffect
    how: str  # a key of `WORDS`
    values: Mapping[str, float]  # its parameters by their own names


@dataclass(frozen=True)
class Plan:
    """Every effect of a model: cancelled or not."""

    # In the order of the inverse: the effect that acts last on the command comes first
    cancelled: tuple[Cancelled, ...]
    left: Mapping[str, str]  # reason by name of each other effect, in one line

    def of(self, *how: str) -> list[Cancelled]:
        """Effects that are cancelled in one of these ways."""
        return [one for one in self.cancelled if one.how in how]


def plan_compensation(compensation: Compensation, values: Mapping[str, Any]) -> Plan:
    """Decide effect by effect.

    `values`: controller, from ``check_controller``. Raises InputError: a requested effect is not in the model or cannot
    be cancelled; the controller reads a signal that is no output of the model; or the drive gain is 0.
    """
    model = compensation.model
    if model.values["drive.gain"] == 0.0:
        raise InputError(f"compensation: the drive gain of model {model.name} is 0, so that no command moves it")
    if model.loop is not None:
        what = f"the drive of model {model.name} has a loop of its own"
        raise InputError(f"compensation: {what}: it takes no force that could cancel an effect")
    followed = followed_output(model, values)
    wanted = _wanted(model, compensation.effects)
    cancelled: list[Cancelled] = []
    left: dict[str, str] = {}
    for active in sorted(model.effects, key=lambda one: -one.effect.order):
        own = values_of(active, model.values)
        how, reason = _way(model, active, own, followed, controller_inputs(values))
        if active.name not in wanted:
            left[active.name] = reason or "not requested"
        elif how:
            cancelled.append(Cancelled(active, how, own))
        elif compensation.effects:
            raise InputError(f"compensation: {active.name} cannot be cancelled: {reason}")
        else:
            left[active.name] = reason
    return Plan(tuple(cancelled), left)


def followed_output(model: Model, values: Mapping[str, Any]) -> OutputSignal | None:
    """Controlled output; None without feedback.

    `values`: from ``check_controller``. Raises InputError: the controller reads a signal that is no output of the
    model.
    """
    known = {output.name: output for output in model.outputs}
    for name in controller_inputs(values):
        if name not in known:
            raise InputError(
                f"compensation: the controller reads {name}, which is no output of model {model.name} "
                f"({', '.join(known)})"
            )
    if values["type"] == "none":
        return None
    if values["type"] != "state_feedback":
        return known[values["output"]]
    positions = [name for name in values["states"] if joint_and_field(name, "states", "controller")[1] == "position"]
    return known[positions[0]] if positions else known[controller_inputs(values)[0]]


def bodies_before(model: Model, coupling: str) -> tuple[str, ...]:
    """Bodies before a coupling; of a body that is split, its first half."""
    inner = model.inner_couplings.get(coupling)
    last = model.couplings.index(coupling) if inner is None else model.bodies.index(inner.at)
    return model.bodies[: last + 1]


def _wanted(model: Model, effects: Sequence[str]) -> set[str]:
    """Names of the requested effects: all, or those named."""
    if not effects:
        return set(model.effect_names)
    found: set[str] = set()
    for text in effects:
        same = {active.name for active in model.effects if text in (active.name, active.effect.name)}
        if not same:
            known = list(model.effect_names)
            has = did_you_mean_or_known(text, known) if known else ", it has none"
            raise InputError(f"compensation: model {model.name} has no effect '{text}'{has}")
        found |= same
    return found


def _way(
    model: Model,
    active: ActiveEffect,
    values: Mapping[str, float],
    followed: OutputSignal | None,
    read: Sequence[str],
) -> tuple[str, str]:
    """How an effect is cancelled, or why it is not."""
    effect = active.effect
    if effect.not_cancelled:
        return "", effect.not_cancelled
    if effect.site == INPUT:
        return (INVERSE, "") if effect.undo is not None else ("", "its file gives no inverse (undo)")
    if effect.lost_motion:
        return _gap(model, active, followed, read)
    if effect.site == OUTPUT:
        return "", _IN_THE_SENSOR
    if effect.site == COUPLING:
        return "", "it acts between the bodies, where there is no drive"
    if followed is None or followed.field not in ("position", "velocity"):
        return "", _NO_MOTION
    if followed.field == "velocity" and effect.force is not None and _depends_on_position(effect.force, active, values):
        return "", _NO_POSITION
    return (FORCE, "") if effect.force is not None or effect.friction is not None else ("", "it has no force")


def _gap(model: Model, active: ActiveEffect, followed: OutputSignal | None, read: Sequence[str]) -> tuple[str, str]:
    """A gap is crossed by a force where the controller measures behind it, otherwise by a shift of the reference."""
    if followed is None or followed.field != "position":
        return "", "the controller does not control a position"
    if active.effect.site == OUTPUT:
        behind = [output.name for output in model.outputs if output.site == active.at and output.name in read]
        return (TAKE_UP, "") if behind else ("", _IN_THE_SENSOR + ", which the controller does not read")
    return (SHIFT if followed.body in bodies_before(model, active.at) else TAKE_UP), ""


def _depends_on_position(force: Hook, active: ActiveEffect, values: Mapping[str, float]) -> bool:
    numbers = [values[spec.name] for spec in active.effect.parameters]
    found = {force(place, 0.3, 1.0, 0.0, [0.0] * active.effect.states, numbers) for place in _PLACES}
    return len(found) > 1
