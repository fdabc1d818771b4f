"""What of a fitted model a controller cancels, how, and what it leaves alone and why."""

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
    FORCE: "the force that it takes along the reference, asked of the drive",
    TAKE_UP: "a push across the gap when the reference turns round",
    SHIFT: "a step of the reference by the gap when it turns round",
}
_IN_THE_SENSOR = "it is in the sensor: it changes what is read, not what the drive has to do"
_NO_MOTION = "the controller follows no reference along which its force could be known"
_NO_POSITION = "its force depends on the position, and the reference is a velocity"
# Where a force is compared to see whether it depends on the position; no common divisor of any period.
_PLACES = (0.0, 0.137, 1.0, 2.71, -0.59)


@dataclass(frozen=True)
class Compensation:
    """What is to be cancelled, and within what.

    Attributes
    ----------
    model : Model
        The machine as a fit has found it.
    effects : tuple of str
        Effects to cancel, as ``name@site`` or ``name`` for all sites; empty: all that can be.
    limit : float or None
        Most that compensation adds to the command, in its unit; None: half of the controller's limit.
    velocity_width : float or None
        Speed of the reference below which dry friction is cancelled in part, in proportion: its force must not jump
        when the motion turns round. None: the speed that it gives the whole machine in two periods.
    command_width : float or None
        Size of a command below which a jump of an inverse is applied in part; None: a quarter of the jump's
        height, more where the noise of the sensors alone gives larger commands.
    crossing_time : float or None
        Time in which a gap is crossed [s]; None: 20 periods, longer where the limit asks for it.
    """

    model: Model
    effects: tuple[str, ...] = ()
    limit: float | None = None
    velocity_width: float | None = None
    command_width: float | None = None
    crossing_time: float | None = None

    def __post_init__(self) -> None:
        for key in ("limit", "velocity_width", "command_width", "crossing_time"):
            value = getattr(self, key)
            if value is not None and not 0.0 < value < float("inf"):
                raise InputError(f"compensation: {key} is {value:g} but must be above 0 and finite")


@dataclass(frozen=True)
class Cancelled:
    """An effect that is cancelled.

    Attributes
    ----------
    active : ActiveEffect
    how : str
        A key of `WORDS`.
    values : dict
        Its parameters by their own names.
    """

    active: ActiveEffect
    how: str
    values: Mapping[str, float]


@dataclass(frozen=True)
class Plan:
    """Every effect of a model: cancelled, or left alone.

    Attributes
    ----------
    cancelled : tuple of Cancelled
        Of the command chain in the order of its inverse: what acts last is undone first.
    left : dict of str to str
        Name of each other effect, and why in one line.
    """

    cancelled: tuple[Cancelled, ...]
    left: Mapping[str, str]

    def of(self, *how: str) -> list[Cancelled]:
        """Effects that are cancelled in one of these ways."""
        return [one for one in self.cancelled if one.how in how]


def plan_compensation(compensation: Compensation, values: Mapping[str, Any]) -> Plan:
    """Decide effect by effect.

    Parameters
    ----------
    compensation : Compensation
    values : mapping
        Controller, from ``check_controller``.

    Raises
    ------
    InputError
        An effect that is asked for is not in the model or cannot be cancelled; the controller reads what is no
        output of the model; or the model has no drive.
    """
    model = compensation.model
    if model.values["drive.gain"] == 0.0:
        raise InputError(f"compensation: the drive gain of model {model.name} is 0: no command moves it")
    followed = followed_output(model, values)
    wanted = _wanted(model, compensation.effects)
    cancelled: list[Cancelled] = []
    left: dict[str, str] = {}
    for active in sorted(model.effects, key=lambda one: -one.effect.order):
        own = values_of(active, model.values)
        how, reason = _way(model, active, own, followed, controller_inputs(values))
        if active.name not in wanted:
            left[active.name] = reason or "not asked for"
        elif how:
            cancelled.append(Cancelled(active, how, own))
        elif compensation.effects:
            raise InputError(f"compensation: {active.name} cannot be cancelled: {reason}")
        else:
            left[active.name] = reason
    return Plan(tuple(cancelled), left)


def followed_output(model: Model, values: Mapping[str, Any]) -> OutputSignal | None:
    """Output that a controller makes follow the reference; None where it has no feedback.

    Parameters
    ----------
    model : Model
    values : mapping
        From ``check_controller``.

    Raises
    ------
    InputError
        The controller reads what is no output of the model.
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
    """Bodies between the drive and the far side of a coupling; of a body that is split, its half before it."""
    inner = model.inner_couplings.get(coupling)
    last = model.couplings.index(coupling) if inner is None else model.bodies.index(inner.at)
    return model.bodies[: last + 1]


def _wanted(model: Model, effects: Sequence[str]) -> set[str]:
    """Names of the effects that are asked for: all, or those named."""
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
    """How an effect is cancelled, or else why it is not."""
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
    """A gap is crossed by a push where the controller reads behind it, else by a step of its reference."""
    if followed is None or followed.field != "position":
        return "", "the controller follows no position that could turn round"
    if active.effect.site == OUTPUT:
        behind = [output.name for output in model.outputs if output.site == active.at and output.name in read]
        return (TAKE_UP, "") if behind else ("", _IN_THE_SENSOR + ", which the controller does not read")
    return (SHIFT if followed.body in bodies_before(model, active.at) else TAKE_UP), ""


def _depends_on_position(force: Hook, active: ActiveEffect, values: Mapping[str, float]) -> bool:
    numbers = [values[spec.name] for spec in active.effect.parameters]
    found = {force(place, 0.3, 1.0, 0.0, [0.0] * active.effect.states, numbers) for place in _PLACES}
    return len(found) > 1
