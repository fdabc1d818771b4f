"""A model: bodies, couplings, drive, effects and the signals that it connects to."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from idloop.arrays import Array
from idloop.errors import InputError
from idloop.physics.drive_loop import LoopGains, loop_gains
from idloop.physics.effect import BODY, COUPLING, INPUT, OUTPUT, Effect, find_effect
from idloop.physics.effect_text import parse_effect
from idloop.physics.parameter import Parameter
from idloop.physics.schema import Value, read_value, reason
from idloop.physics.trust import allowed
from idloop.physics.units import Units
from idloop.spelling import did_you_mean_or_known


@dataclass(frozen=True)
class InputSignal:
    """The command: topic, joint, field and unit, and whether it is held until the next or a measured signal."""

    topic: str
    joint: str
    field: str
    unit: str
    kind: str = "held"

    @property
    def name(self) -> str:
        """Name of the signal, such as ``motor.effort``."""
        return f"{self.joint}.{self.field}"


@dataclass(frozen=True)
class OutputSignal:
    """A measured signal: topic, joint, field, unit, body, scale and noise (standard deviation)."""

    topic: str
    joint: str
    field: str
    unit: str
    body: str
    scale: float
    noise: float | None

    @property
    def name(self) -> str:
        """Name of the signal, such as ``motor.position``."""
        return f"{self.joint}.{self.field}"

    @property
    def site(self) -> str:
        """Site of effects of this sensor, such as ``position[motor]``."""
        return f"{self.field}[{self.joint}]"


@dataclass(frozen=True)
class ConditionSource:
    """Where a measured condition is found in a bag: topic, joint and field of the number, unit, scale and offset."""

    name: str
    topic: str
    joint: str
    field: str
    unit: str
    scale: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class ActiveEffect:
    """An effect of the catalogue at a site of this model, with a number where it may act there several times."""

    effect: Effect
    at: str
    number: int = 1

    @property
    def name(self) -> str:
        """Name in this model, such as ``dead_zone@input``, ``cogging#2@motor`` for the second one."""
        return effect_name(self.effect.name, self.at, self.number)


def effect_name(effect: str, at: str, number: int = 1) -> str:
    """Name of an effect in a model, such as ``dead_zone@input``, ``cogging#2@motor`` for the second one."""
    return f"{effect}@{at}" if number == 1 else f"{effect}#{number}@{at}"


def effect_and_site(name: str) -> tuple[str, str]:
    """Effect and site of a name as `effect_name` writes it."""
    effect, _, at = name.partition("@")
    return effect.partition("#")[0], at


@dataclass(frozen=True)
class DriveLoop(ActiveEffect):
    """The loop inside a drive, whose parameters are those of the drive."""

    at: str = "drive"

    @property
    def name(self) -> str:
        """``drive``, as its parameters are called in the model."""
        return self.at


def values_of(active: ActiveEffect, values: Mapping[str, float]) -> dict[str, float]:
    """Parameters of one effect by their own names; one that is left out has the value of its default, or none."""
    own: dict[str, float] = {}
    for spec in active.effect.parameters:
        name = f"{active.name}.{spec.name}"
        own[spec.name] = values[name] if name in values else own[spec.optional] if spec.optional else spec.neutral
    return own


@dataclass(frozen=True)
class Model:
    """An axis: a chain of bodies with a drive, its effects and its signals.

    Immutable: every method returns a new model.

    Attributes
    ----------
    name, description : str
        For the user.
    input : InputSignal
        The command.
    outputs : tuple of OutputSignal
        Measured signals.
    bodies : tuple of str
        Names along the chain; the drive acts on the first.
    parameters : tuple of Parameter
        Every parameter, in a fixed order.
    effects : tuple of ActiveEffect
        Effects beyond inertia, viscous friction and springs.
    controller : dict or None
        The controller during the recording, as in the file.
    conditions : tuple of ConditionSource
        Conditions measured beside the axis, such as a temperature, on their own topics.
    disturbance : float or None
        Intensity of the disturbance force from a fit, in force unit per root second.
    folder : Path or None
        Folder of the file; its folder ``effects`` may contain the user's own effects.
    loop : DriveLoop or None
        Loop of the drive, which receives a position or a velocity; without one the drive makes a force of the command.
    """

    name: str
    description: str
    input: InputSignal
    outputs: tuple[OutputSignal, ...]
    bodies: tuple[str, ...]
    parameters: tuple[Parameter, ...]
    effects: tuple[ActiveEffect, ...]
    units: Units
    controller: dict[str, Any] | None = None
    disturbance: float | None = None
    conditions: tuple[ConditionSource, ...] = ()
    folder: Path | None = field(default=None, compare=False)
    loop: DriveLoop | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle as text, since compiled equations cannot be pickled."""
        from idloop.physics.model_file import from_text

        return from_text, (self.to_yaml(), self.folder, allowed(self.effect_folders))

    # -- parameters ---------------------------------------------------------------------

    @cached_property
    def values(self) -> dict[str, float]:
        """Value of every parameter by name."""
        return {parameter.name: parameter.value for parameter in self.parameters}

    @cached_property
    def free(self) -> tuple[str, ...]:
        """Names of the parameters to estimate."""
        return tuple(parameter.name for parameter in self.parameters if parameter.free)

    @cached_property
    def theta(self) -> Array:
        """Values of the free parameters, in the order of `free`."""
        return np.array([parameter.value for parameter in self.parameters if parameter.free], dtype=float)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds of the free parameters."""
        free = [parameter for parameter in self.parameters if parameter.free]
        return np.array([p.min for p in free], dtype=float), np.array([p.max for p in free], dtype=float)

    @property
    def output_names(self) -> tuple[str, ...]:
        """Names of the outputs, such as ``motor.position``."""
        return tuple(output.name for output in self.outputs)

    @property
    def effect_names(self) -> tuple[str, ...]:
        """Names of the active effects, such as ``dead_zone@input``."""
        return tuple(active.name for active in self.effects)

    @property
    def couplings(self) -> tuple[str, ...]:
        """Names of the couplings, such as ``motor-load``."""
        return tuple(f"{a}-{b}" for a, b in zip(self.bodies[:-1], self.bodies[1:], strict=True))

    def far_half(self, body: str) -> str:
        """Name of the far half of a body that an effect splits in two, such as ``load_far``."""
        name = f"{body}_far"
        while name in self.bodies:
            name += "_far"
        return name

    def inside(self, body: str) -> str:
        """Name of the coupling between the two halves of a body that an effect splits, such as ``load-load_far``."""
        return f"{body}-{self.far_half(body)}"

    @property
    def inner_couplings(self) -> dict[str, ActiveEffect]:
        """Couplings inside bodies that an effect splits in two, with this effect."""
        return {self.inside(active.at): active for active in self.effects if active.effect.splits}

    @property
    def acting(self) -> tuple[ActiveEffect, ...]:
        """The loop of the drive and all effects, in the order in which they act."""
        effects = sorted(self.effects, key=lambda active: active.effect.order)
        return (self.loop, *effects) if self.loop is not None else tuple(effects)

    def loop_gains(self, values: Mapping[str, float]) -> LoopGains:
        """Output of the drive to first order, per unit of command, position and velocity of the first body."""
        if self.loop is None:
            return LoopGains(1.0, 0.0, 0.0)
        return loop_gains(self.loop.effect.name, values_of(self.loop, values))

    @property
    def integrates(self) -> bool:
        """Whether the loop of the drive has an integral, whose value at the start of a record is not measured."""
        name = "drive.integral"
        return self.loop is not None and (name in self.free or self.values.get(name, 0.0) != 0.0)

    @property
    def loop_scale_is_free(self) -> bool:
        """Whether the loop of the drive has an unknown proportional gain, with which the force of the drive grows."""
        return self.loop is not None and "drive.proportional" in self.free

    def parameter(self, name: str) -> Parameter:
        """Return a parameter by name.

        Raises
        ------
        InputError
            The model has no such parameter.
        """
        for parameter in self.parameters:
            if parameter.name == name:
                return parameter
        raise InputError(f"model {self.name} has no parameter '{name}'{did_you_mean_or_known(name, self.values)}")

    def equivalent_parameters(self, name: str) -> tuple[str, ...]:
        """Names of a parameter of a body or a coupling and of equivalent parameters of the effects there."""
        same = (a for a in self.effects if f"{a.at}.{a.effect.site_parameter}" == name)
        return (name, *(f"{active.name}.{active.effect.strength}" for active in same))

    def with_values(self, values: Mapping[str, float], stderr: Mapping[str, float | None] | None = None) -> Model:
        """Return the model with other values, and standard errors where given.

        Parameters
        ----------
        values : mapping
            Value by parameter name.
        stderr : mapping, optional
            Standard error by parameter name, None where there is none.

        Raises
        ------
        InputError
            Unknown name, or a value outside the parameter's bounds.
        """
        errors = stderr or {}
        for name, value in values.items():
            known = self.parameter(name)
            if not known.min <= value <= known.max:
                raise InputError(f"{name}: {value:g} is outside {known.min:g} .. {known.max:g} {known.unit}")
        changed = tuple(
            replace(p, value=float(values.get(p.name, p.value)), stderr=errors.get(p.name, p.stderr))
            for p in self.parameters
        )
        return replace(self, parameters=changed)

    def with_theta(self, theta: Sequence[float] | Array) -> Model:
        """Return the model with other values of its free parameters, in the order of `free`."""
        return self.with_values(dict(zip(self.free, (float(v) for v in theta), strict=True)))

    def with_free(self, names: Iterable[str]) -> Model:
        """Return the model with exactly these parameters free."""
        chosen = set(names)
        for name in chosen:
            self.parameter(name)
        return replace(self, parameters=tuple(replace(p, free=p.name in chosen) for p in self.parameters))

    # -- effects ------------------------------------------------------------------------

    @property
    def effect_folders(self) -> tuple[Path, ...]:
        """Folders beside the model file with the user's own effects."""
        return (self.folder / "effects",) if self.folder is not None else ()

    def site_kind(self, at: str) -> str:
        """Kind of a site of this model; of the coupling inside a body also before an effect splits that body.

        Raises
        ------
        InputError
            The model has no such site.
        """
        if at == "input":
            return INPUT
        if at in self.bodies:
            return BODY
        if at in self.couplings or at in map(self.inside, self.bodies):
            return COUPLING
        if at in self.sites(OUTPUT):
            return OUTPUT
        known = [site for kind in (INPUT, BODY, COUPLING, OUTPUT) for site in self.sites(kind)]
        raise InputError(f"model {self.name} has no site '{at}'{did_you_mean_or_known(at, known)}")

    def sites(self, kind: str) -> tuple[str, ...]:
        """Names of all sites of one kind."""
        if kind == INPUT:
            return ("input",)
        if kind == BODY:
            return self.bodies
        if kind == COUPLING:
            return (*self.couplings, *self.inner_couplings)
        return tuple(output.site for output in self.outputs)

    def with_effect(self, name: str, at: str, **values: float | Mapping[str, Any] | Value) -> Model:
        """Return the model with one more effect.

        Parameters
        ----------
        name, at : str
            Effect and site.
        **values : float or mapping
            Start values of its parameters (to be estimated), or mappings as in a model file.

        Raises
        ------
        InputError
            Unknown effect, site or parameter, an effect that is there already, or one of angles along a length.
        """
        as_values = {
            key: Value(value=float(value)) if isinstance(value, int | float) else value for key, value in values.items()
        }
        return self.with_entry(name, at, as_values)

    def with_entry(self, name: str, at: str, values: Mapping[str, Any], number: int | None = None) -> Model:
        """Return the model with one more effect as a model file writes it: a bare number is known.

        Parameters
        ----------
        name, at : str
        values : mapping
            Of its parameters.
        number : int, optional
            Number of an effect that may act several times at a site; the first free one when left out.

        Raises
        ------
        InputError
            As `with_effect`; a number for an effect that acts once.
        """
        kind = self.site_kind(at)
        effect = find_effect(name, kind, *self.effect_folders)
        if number is not None and not effect.several:
            raise InputError(f"effect {name} acts once at a site: leave its number out")
        active = ActiveEffect(effect, at, self.next_number(effect, at) if number is None else number)
        if active.name in self.effect_names:
            raise InputError(f"model {self.name} has the effect {active.name} already: name it once")
        output = next((o for o in self.outputs if o.site == at), None)
        if output is not None and output.field not in effect.outputs:
            fields = " or ".join(effect.outputs)
            raise InputError(f"effect {name} does not act on a {output.field}: it acts on {fields}")
        if effect.needs_angle and self.units.position != "rad":
            has = f"model {self.name} has positions in {self.units.position}"
            raise InputError(f"effect {name} needs an angle, and {has}")
        added = self._effect_parameters(active, values, output.unit if output else "")
        return replace(self, effects=(*self.effects, active), parameters=(*self.parameters, *added))

    def next_number(self, effect: Effect, at: str) -> int:
        """Number of one more effect at a site: 1, or the first free number where it may act several times."""
        taken = {a.number for a in self.effects if (a.effect.name, a.at) == (effect.name, at)}
        return next(n for n in count(1) if n not in taken or not effect.several)

    def _effect_parameters(self, active: ActiveEffect, values: Mapping[str, Any], unit: str) -> list[Parameter]:
        effect = active.effect
        given: dict[str, Value] = {}
        for key, raw in values.items():
            spec = effect.spec(key)
            try:
                given[key] = read_value(raw)
            except ValueError as error:
                raise InputError(f"{active.name}.{key}: {reason(error)}") from error
            if not spec.min <= given[key].value <= spec.max:
                raise InputError(
                    f"{active.name}.{key}: {given[key].value:g} is outside {spec.min:g} .. {spec.max:g} "
                    f"{self.units.fill(spec.unit, unit)}"
                )
        added = []
        for spec in effect.parameters:
            if spec.optional and spec.name not in given:
                continue
            value = given.get(spec.name, Value(value=spec.start, free=spec.estimated))
            if spec.integer and value.value != round(value.value):
                raise InputError(f"{active.name}.{spec.name}: {value.value:g} is not a whole number")
            low = spec.min if value.min is None else max(value.min, spec.min)
            high = spec.max if value.max is None else min(value.max, spec.max)
            free, written = value.free and spec.estimated, self.units.fill(spec.unit, unit)
            name, stated = f"{active.name}.{spec.name}", (value.min, value.max)
            added.append(Parameter(name, value.value, low, high, free, value.stderr, written, stated))
        return added

    def without_effect(self, name: str, *, making_room: bool = False) -> Model:
        """Return the model without an effect, as `without_effects`."""
        return self.without_effects([name], making_room=making_room)

    def without_effects(self, names: Iterable[str], *, making_room: bool = False) -> Model:
        """Return the model without some of its effects, and without those inside bodies that these split.

        Parameters
        ----------
        names : iterable of str
            As in `effect_names`. The others keep their names.
        making_room : bool
            Others replace them: effects inside the bodies stay.

        Raises
        ------
        InputError
            The model has no such effect.
        """
        gone = {self._effect(name).name for name in names}
        inside = {at for at, active in self.inner_couplings.items() if active.name in gone and not making_room}
        gone |= {active.name for active in self.effects if active.at in inside}
        return replace(
            self,
            effects=tuple(active for active in self.effects if active.name not in gone),
            parameters=tuple(p for p in self.parameters if p.name.rpartition(".")[0] not in gone),
        )

    def _effect(self, name: str) -> ActiveEffect:
        for active in self.effects:
            if active.name == name:
                return active
        if not self.effects:
            raise InputError(f"model {self.name} has no effects")
        cure = did_you_mean_or_known(name, list(self.effect_names))
        raise InputError(f"model {self.name} has no effect '{name}'{cure}")

    def with_effects(self, texts: Iterable[str]) -> Model:
        """Return the model with effects given as text, see `parse_effect`."""
        model = self
        for text in texts:
            name, at, values = parse_effect(text)
            model = model.with_effect(name, at, **values)
        return model.checked()

    def checked(self) -> Model:
        """Return the model after checking that each of its effects has a site.

        Raises
        ------
        InputError
            An effect acts inside a body that no effect splits in two, or depends on a set-point that no drive has.
        """
        inside = {self.inside(body): body for body in self.bodies}
        for active in self.effects:
            if active.effect.set_point and self.loop is None:
                raise InputError(
                    f"effect {active.name} follows the set-point of a loop in the drive: add `kind:` to `drive:`"
                )
            if active.at in inside and active.at not in self.sites(COUPLING):
                raise InputError(
                    f"effect {active.name} acts between two halves of {inside[active.at]}, which is one body: "
                    f"add compliance@{inside[active.at]}"
                )
        return self

    # -- file ---------------------------------------------------------------------------

    def to_yaml(self) -> str:
        """Return the model as the text of a model file."""
        from idloop.physics.model_file import to_yaml

        return to_yaml(self)

    def save(self, path: str | Path) -> None:
        """Write the model file; a file that is there is replaced."""
        Path(path).write_text(self.to_yaml(), encoding="utf-8")
