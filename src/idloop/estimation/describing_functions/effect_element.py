"""An effect of the catalogue on its own, as an element with one input and one output."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from idloop.errors import InputError
from idloop.physics.effect import BODY, COUPLING, INPUT, Effect, catalogue, find_effect
from idloop.spelling import did_you_mean_or_known

# An element at work, asked at evenly spaced instants: its answer to an input, the input's time derivative [1/s] and its
# integral over time [s].
Answer = Callable[[float, float, float], float]

COMMAND, POSITION, VELOCITY, TWIST = "command", "position", "velocity", "twist"
_DRIVES = {INPUT: (COMMAND,), BODY: (POSITION, VELOCITY), COUPLING: (TWIST,)}


@dataclass(frozen=True)
class EffectElement:
    """An effect driven alone, with everything around it given.

    ========  =====================  ==================================================
    site      input                  output
    ========  =====================  ==================================================
    input     command as sent        command that arrives
    body      position or velocity   force that resists the motion; of ``compliance``
                                     the motion of the far half
    coupling  twist                  torque through the coupling, its spring included
    output    position or velocity   reading
    ========  =====================  ==================================================
    """

    effect: Effect  # the equations
    values: Mapping[str, float]  # value of each of its parameters
    drive: str  # {"command", "position", "velocity", "twist"}: what the input is
    body_inertia: float = 1.0  # of the body [kg·m² or kg]
    coupling_stiffness: float = 1.0  # of the coupling [N·m/rad or N/m]
    # Torque or force that arrives at the body through the drive train, for friction that grows with it
    transmitted_force: float = 0.0
    # Velocity of the driven body per unit of command, for a limit that depends on it; 0: at standstill
    velocity_per_command: float = 0.0

    @property
    def name(self) -> str:
        """Name with the kind of site, such as ``dead_zone@input``."""
        return f"{self.effect.name}@{self.effect.site}"

    @property
    def needs_frequency(self) -> bool:
        """Whether the answer depends on time and not only on the order of the inputs."""
        effect = self.effect
        # Dry friction depends on sign and size of the velocity alone.
        moved = effect.site == BODY and (effect.force is not None or self.drive == POSITION)
        return bool(effect.delay) or effect.splits or effect.settle is not None or moved

    @property
    def dead_time(self) -> float:
        """How long nothing of the input has arrived yet [s]."""
        return self.values[self.effect.delay] if self.effect.delay else 0.0

    def answer(self, interval: float) -> Answer:
        """A fresh copy of the effect, asked every ``interval`` seconds."""
        if self.effect.delay:
            return _late(self.values[self.effect.delay], interval)
        if self.effect.splits:
            return self._far_half(interval)
        parameters = [self.values[spec.name] for spec in self.effect.parameters]
        state = [0.0] * max(self.effect.states, 1)
        if self.effect.site == INPUT:
            return self._command(interval, state, parameters)
        return self._motion(interval, state, parameters)

    def _command(self, interval: float, state: list[float], parameters: list[float]) -> Answer:
        equation, settle = self.effect.command, self.effect.settle
        ratio = self.velocity_per_command

        def passed_on(value: float, rate: float, total: float) -> float:
            place = (value, ratio * value, value)
            # The command counts as held around the instant: half of the interval is over when it is asked.
            found = value if equation is None else equation(*place, 0.5 * interval, state, parameters)
            if settle is not None:
                settle(*place, interval, state, parameters)
            return found

        return passed_on

    def _motion(self, interval: float, state: list[float], parameters: list[float]) -> Answer:
        effect, moved_by_speed = self.effect, self.drive == VELOCITY
        settle, arriving = effect.settle, self.transmitted_force
        inertia, stiffness = self.body_inertia, self.coupling_stiffness
        elapsed = 0.0

        def answer(value: float, rate: float, total: float) -> float:
            nonlocal elapsed
            position, velocity = (total, value) if moved_by_speed else (value, rate)
            if effect.site == BODY:
                place = (position, velocity, inertia)
            elif effect.site == COUPLING:
                place = (stiffness * value, value, stiffness)
            else:
                place = (value, position, velocity)
            if settle is not None:
                settle(*place, elapsed, state, parameters)
            elapsed = interval
            found = 0.0 if effect.site == BODY else place[0]
            if effect.force is not None:
                found -= effect.force(*place, 0.0, state, parameters)
            if effect.friction is not None and velocity != 0.0:
                direction = math.copysign(1.0, velocity)
                size = effect.friction(direction, abs(velocity), arriving, 0.0, state, parameters)
                found += direction * max(size, 0.0)
            for equation in (effect.coupling, effect.reading):
                if equation is not None:
                    found = equation(*place, 0.0, state, parameters)
            return found

        return answer

    def _far_half(self, interval: float) -> Answer:
        """Motion of the far half of a split body behind the given motion of the near one."""
        stiffness, damping = self.values["stiffness"], self.values["damping"]
        if not np.isfinite(stiffness):
            return lambda value, rate, total: value
        far = self.body_inertia * self.values["split"]
        # Trapezoidal rule: stable and of second order, whatever the resonance.
        system = np.array([[0.0, 1.0], [-stiffness / far, -damping / far]])
        left = np.linalg.inv(np.eye(2) - 0.5 * interval * system)
        (f00, f01), (f10, f11) = (left @ (np.eye(2) + 0.5 * interval * system)).tolist()
        p0, p1 = (0.5 * interval * left[:, 1]).tolist()
        position = velocity = before = math.nan

        def far_half(value: float, rate: float, total: float) -> float:
            nonlocal position, velocity, before
            push = (stiffness * value + damping * rate) / far
            if math.isnan(before):  # both halves start together
                position, velocity, before = value, rate, push
            both = before + push
            moved = f00 * position + f01 * velocity + p0 * both
            velocity = f10 * position + f11 * velocity + p1 * both
            position, before = float(moved), push
            return position

        return far_half


def _late(delay: float, interval: float) -> Answer:
    """The input of a fixed time ago, on a straight line between the instants."""
    whole = math.floor(delay / interval)
    share = delay / interval - whole
    past: deque[float] = deque(maxlen=whole + 2)

    def late(value: float, rate: float, total: float) -> float:
        past.append(value)
        if len(past) < whole + 2:
            return past[0]
        return (1.0 - share) * past[1] + share * past[0]

    return late


def effect_element(
    effect: str,
    site: str | None = None,
    drive: str | None = None,
    *,
    body_inertia: float = 1.0,
    coupling_stiffness: float = 1.0,
    transmitted_force: float = 0.0,
    velocity_per_command: float = 0.0,
    **values: float,
) -> EffectElement:
    """An effect of the catalogue, or a user's own, made ready to be driven alone.

    Parameters
    ----------
    effect : str
        Name in the catalogue.
    site : {"input", "body", "coupling", "output"}, optional
        Kind of site; needed only where the name fits several.
    drive : {"command", "position", "velocity", "twist"}, optional
        What the input is; by default the first that the site has (of an output: that it fits).
    body_inertia, coupling_stiffness, transmitted_force, velocity_per_command : float
        What is around the effect, see `EffectElement`.
    **values : float
        Parameters of the effect in its units; those left out have their start values.

    Raises
    ------
    InputError
        Unknown effect, site, drive or parameter, or a value out of its bounds.

    Examples
    --------
    >>> effect_element("dead_zone", width=0.12).name
    'dead_zone@input'
    """
    if site is None:
        known = catalogue().get(effect, ())
        if len(known) > 1:
            sites = " or ".join(one.site for one in known)
            raise InputError(f"effect {effect} acts at several kinds of site; say which: {sites}")
        site = known[0].site if known else INPUT
    found = find_effect(effect, site)
    drives = _DRIVES.get(site, found.outputs)
    chosen = drives[0] if drive is None else drive
    if chosen not in drives:
        raise InputError(
            f"effect {found.name} at the site kind '{site}' is driven by {' or '.join(drives)}, not {chosen!r}"
        )
    for name, value in (("body_inertia", body_inertia), ("coupling_stiffness", coupling_stiffness)):
        if not (np.isfinite(value) and value > 0.0):
            raise InputError(f"effect {found.name}: {name} is {value:g}; it must be finite and above 0")
    around = (body_inertia, coupling_stiffness, transmitted_force, velocity_per_command)
    return EffectElement(found, _parameters(found, values), chosen, *around)


def _parameters(effect: Effect, values: Mapping[str, float]) -> dict[str, float]:
    """Value of every parameter, checked."""
    names = [spec.name for spec in effect.parameters]
    for name in values:
        if name not in names:
            raise InputError(f"effect {effect.name} has no parameter '{name}'{did_you_mean_or_known(name, names)}")
    filled: dict[str, float] = {}
    for spec in effect.parameters:
        value = float(values.get(spec.name, filled.get(spec.optional, spec.start)))
        if not spec.min <= value <= spec.max:
            raise InputError(f"effect {effect.name}: {spec.name} is {value:g}; it must be {spec.min:g} to {spec.max:g}")
        filled[spec.name] = value
    if not effect.valid(filled):
        raise InputError(f"effect {effect.name}: {filled} do not go together; {effect.text}")
    return filled
