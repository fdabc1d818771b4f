"""Physical effects: equations at a site, parameters, and facts for the diagnosis.

An effect is one file that assigns ``EFFECT = Effect(...)``. The built-in ones are in
``idloop/physics/effects``; the user's own are in a folder ``effects`` beside the model file, which
the user trusts once (`idloop trust`), or in the folders of the environment variable
``IDLOOP_EFFECTS``. Both are treated alike.

Arguments ``(a, b, c, elapsed, state, parameters)`` of the equations, by place:

=============  ==========================  =========================  ======================
place          a                           b                          c
=============  ==========================  =========================  ======================
``command``    command so far              velocity of body 0         position of body 0
``force``      position                    velocity                   inertia
``friction``   direction (+1 or -1)        speed (0: breakaway)       transmitted torque
``coupling``   torque so far               twist                      stiffness
``reading``    reading so far              position                   velocity
``undo``       wanted command              velocity of body 0         smooth sign of it
=============  ==========================  =========================  ======================

``undo`` is the inverse of ``command``, for a compensator. Its third argument is the sign of the first one, but smooth
near zero, from which an inverse with a step takes its step. A ``force`` or ``friction`` needs no inverse: a
compensator adds the force of the equation along the reference.

The first state of an effect that depends on a measured condition, such as a temperature, is the deviation of the
condition from its reference; 0 where it was not measured.

An effect with memory also has ``settle``: called with the same arguments after each step, it
updates the state for the next step.
"""

from __future__ import annotations

import hashlib
import importlib.util
import math
import os
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from types import ModuleType

from idloop.errors import InputError
from idloop.physics.hooks import Hook
from idloop.physics.trial import FurtherTrials, Trials
from idloop.physics.trust import EffectFiles, check_trusted, kept_copy, read_effect_files
from idloop.spelling import did_you_mean_or_known

INPUT, BODY, COUPLING, OUTPUT = "input", "body", "coupling", "output"


@dataclass(frozen=True)
class EffectParameter:
    """A parameter of an effect."""

    name: str  # name in model files
    unit: str  # unit; ``{input}``, ``{force}``, ``{position}``, ``{output}`` are replaced by those of the model
    start: float = 0.0  # default value, and start value of a fit
    neutral: float = 0.0  # value at which the effect has no influence
    # Physical bounds
    min: float = -float("inf")
    max: float = float("inf")
    integer: bool = False  # an integer, chosen and not estimated
    optional: str = ""  # name of the parameter whose value is taken when this one is not given
    held: bool = False  # kept at its start value in a screening
    chosen: bool = False  # a reference of another parameter, such as a reference temperature: never estimated

    @property
    def estimated(self) -> bool:
        """Whether a fit estimates it."""
        return not (self.integer or self.chosen)


@dataclass(frozen=True)
class EffectEquation:
    """Equation of an effect in LaTeX.

    ``@q``, ``@v`` and ``@F`` are position, velocity and force in the symbols of the axis (theta, omega, T or x, v, F),
    ``@u`` and ``@y`` the incoming command and reading, ``@s`` the site, and ``@i`` the body where there are several.
    """

    # Symbol in the force balance, the command or the reading, with its sign; empty where the equation is complete
    term: str
    text: str  # the equation
    symbols: Mapping[str, str] = field(default_factory=dict)  # symbol of each parameter


def _always(values: Mapping[str, float]) -> bool:
    return True


def _no_rate(values: Mapping[str, float], inertia: float, stiffness: float) -> float:
    return 0.0


@dataclass(frozen=True)
class Effect:
    """A physical effect of the catalogue."""

    name: str  # name in model files; an interface that does not change
    site: str  # one of "input", "body", "coupling", "output"; where the effect acts
    text: str  # one sentence about the physics
    parameters: tuple[EffectParameter, ...]  # in the order in which the equations index them
    # The equations, see the module's table
    command: Hook | None = None
    force: Hook | None = None
    friction: Hook | None = None
    coupling: Hook | None = None
    reading: Hook | None = None
    settle: Hook | None = None  # update of the effect's state
    # Of a coupling, the twist of either sign at which its equation is discontinuous, from the same arguments: the
    # simulator finds the instant and keeps the side in the effect's first state
    edge: Hook | None = None
    states: int = 0  # number of states; the first is the deviation of a condition that it depends on
    # Measured condition that the effect depends on, such as ``temperature`` or ``supply``: a candidate only where it
    # was recorded
    condition: str = ""
    reference: str = ""  # parameter with the condition at which the effect has no influence
    order: int = 50  # place in the chain of effects at one site, small first
    final: bool = False  # an output effect that acts after the measurement noise (quantisation); noise to an estimate
    # Fields of the outputs that it acts on: ``position``, ``velocity``
    outputs: tuple[str, ...] = ("position", "velocity")
    also_called: tuple[str, ...] = ()  # everyday words for it, with which a message points to its name
    looks_like: tuple[str, ...] = ()  # effects that are often confounded with this one
    linear: bool = False  # linear in the motion: part of the linear model for the observer design
    proportional: bool = False  # of a force or friction without memory: proportional to its first parameter
    # ``(values, inertia, stiffness)`` to the fastest rate that the effect adds, in rad/s and in rad per unit of
    # position, for the integration step. At the input the inertia is divided by the drive's gain.
    rate: Callable[[Mapping[str, float], float, float], float] = field(default=_no_rate)
    spatial_rate: Callable[[Mapping[str, float], float, float], float] = field(default=_no_rate)
    # The change along the position is that of a memory in closed form: it is over where it would be far faster than
    # `rate`, and needs no steps there
    relaxes: bool = False
    delay: str = ""  # parameter that is a pure delay of the input or output, implemented by the simulator
    splits: bool = False  # the effect splits its body in two, in the layout of the model
    # From `Scales` to alternatives of start values for a screening; from the units of the parameters when left out
    trials: Trials | None = None
    # From `Scales` and the values of the plain form, without optional and held parameters, to alternatives of these in
    # a screening of the full form
    further: FurtherTrials | None = None
    # Nested effects, this one with some parameters at their neutral values: ``{effect: {its parameter: parameter of
    # this one}}``
    contains: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    separable: bool = False  # still an effect without its nested effect
    degenerates_to: tuple[str, ...] = ()  # effects that are limiting cases of this one
    # Effects of the same site that together are equivalent to this one for any motion. A constant at the input may name
    # one of the driven body (where the effects after it pass constants), and a delay of a sensor one of the input (with
    # one sensor).
    same_as: tuple[str, ...] = ()
    # Manual check that separates equivalent effects: ``{effect: check}``
    by_hand: Mapping[str, str] = field(default_factory=dict)
    # Of an effect at the input: a constant added to its input adds a constant to its output
    passes_constants: bool = False
    # Of an effect at the input: odd and without memory, so that it is a gain for a command of one amplitude
    odd: bool = False
    # Common to all servo axes: data in which it is not identifiable cannot show that a model is adequate
    everyday: bool = False
    suggest_order: int = 100  # priority among the effects that the next experiment is designed for, small first
    whole_turn: bool = False  # confounded with an offset or a spring while the motion covers less than a turn
    hidden_by_start: bool = False  # confounded with the unknown initial state, so that no experiment is designed for it
    # Parameter that is the resolution of the readings, found from their quantisation without a refit
    resolution: str = ""
    # Parameter of the body or the coupling that is equivalent to this effect's first one, such as ``viscous_friction``;
    # where it is free the effect is no candidate
    site_parameter: str = ""
    dry_level: str = ""  # parameter that is the level of dry friction in motion
    command_limit: str = ""  # parameter that is the largest command with an effect on an axis at rest
    slow: bool = False  # a force that a slow disturbance may explain, so that only a refit shows it
    anywhere: bool = False  # a slow force whose body does not matter
    weight: bool = False  # what an axis may hold throughout a record
    needs_angle: bool = False  # defined for angles only
    any_period: bool = False  # along an angle a candidate only where a force repeats between two harmonics of the turn
    of_loop: bool = False  # of a drive with a loop of its own: no candidate for another one
    # Of an effect at the input that depends on the set-point: by loop of the drive, an equation with the arguments of
    # ``command`` that is called with the set-point before the loop, notes it in the effect's states, and returns it.
    # ``settle`` is then called with the set-point as well.
    set_point: Mapping[str, Hook] = field(default_factory=dict)
    several: bool = False  # may act several times at one site, such as several harmonics
    equation: EffectEquation | None = None  # equation for documents; a generic function when left out
    # Condition between the parameters, beyond the bounds of each
    valid: Callable[[Mapping[str, float]], bool] = field(default=_always)
    undo: Hook | None = None  # inverse of ``command``, for a compensator
    lost_motion: str = ""  # parameter that is the lost motion at a reversal, for a compensator
    not_cancelled: str = ""  # reason why a compensator cannot cancel the effect; empty where it can

    def __post_init__(self) -> None:
        """Check the parameters that are named by facts."""
        shared = [mine for parameters in self.contains.values() for mine in parameters.values()]
        facts = (self.delay, self.lost_motion, self.resolution, self.dry_level, self.command_limit, self.reference)
        for name in (*facts, *shared):
            if name:
                self.spec(name)
        if bool(self.condition) != bool(self.reference) or (self.condition and not self.states):
            raise InputError(f"effect {self.name}: a condition needs its reference and a first state for its deviation")

    @property
    def condition_unit(self) -> str:
        """Unit of the measured condition that it depends on; empty without one."""
        return self.spec(self.reference).unit if self.reference else ""

    @property
    def lags(self) -> bool:
        """Whether the output follows past inputs: a delay, a filter, a play."""
        return bool(self.delay) or (self.settle is not None and not self.set_point)

    @property
    def from_a_level(self) -> str:
        """Threshold parameter, which is infinite without the effect; empty without one."""
        if self.splits or not self.parameters:
            return ""
        return "" if math.isfinite(self.parameters[0].neutral) else self.parameters[0].name

    @property
    def strength(self) -> str:
        """Parameter that scales the effect from its neutral value on; empty without one."""
        if self.splits or not self.parameters:
            return ""
        first = self.parameters[0]
        return first.name if not first.integer and math.isfinite(first.neutral) else ""

    def spec(self, name: str) -> EffectParameter:
        """Return a parameter's specification. Raises InputError: the effect has no such parameter."""
        for spec in self.parameters:
            if spec.name == name:
                return spec
        known = [spec.name for spec in self.parameters]
        raise InputError(f"effect {self.name} has no parameter '{name}'{did_you_mean_or_known(name, known)}")


def _load_file(files: EffectFiles, name: str) -> ModuleType:
    """Run one effect file as it was read, under a unique module name."""
    path = files.folder / name
    digest = hashlib.sha256(f"{path} {files.checksum}".encode("utf-8", "surrogateescape")).hexdigest()[:12]
    title = f"idloop_effect_{path.stem}_{digest}"
    if title in sys.modules:
        return sys.modules[title]
    # Machine code is cached beside the copy, in a folder that only the user can write.
    spec = importlib.util.spec_from_file_location(title, kept_copy(files, name))
    if spec is None or spec.loader is None:
        raise InputError(f"{path}: cannot be read as an effect file")
    module = importlib.util.module_from_spec(spec)
    # Data files of the effect are beside the original.
    module.__file__ = str(path)
    sys.modules[title] = module
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        del sys.modules[title]
        raise InputError(f"{path}: the effect file fails: {error}") from error
    return module


def _effects_of(module: ModuleType, where: str) -> tuple[Effect, ...]:
    """Read ``EFFECT`` of a file: one effect, or one per site for an effect that fits several."""
    assigned = getattr(module, "EFFECT", None)
    several = assigned if isinstance(assigned, tuple) else (assigned,)
    if not several or not all(isinstance(effect, Effect) for effect in several):
        raise InputError(f"{where}: assigns no EFFECT = Effect(...)")
    return several


def _effects_in(files: EffectFiles) -> dict[str, tuple[Effect, ...]]:
    found: dict[str, tuple[Effect, ...]] = {}
    for name in files.effects:
        several = _effects_of(_load_file(files, name), str(files.folder / name))
        found[several[0].name] = several
    return found


@lru_cache(maxsize=1)
def built_in() -> dict[str, tuple[Effect, ...]]:
    """The effects of the catalogue, by name; one for each site that a name fits."""
    from idloop.physics import effects

    return {
        name: _effects_of(importlib.import_module(f"idloop.physics.effects.{name}"), name) for name in effects.NAMES
    }


def catalogue(*folders: Path) -> dict[str, tuple[Effect, ...]]:
    """All known effects by name: built in, from ``IDLOOP_EFFECTS``, and from folders.

    `*folders`: further folders of effect files, such as the one beside a model file. Their files run when they are
    trusted, see `idloop.physics.trust`; folders in ``IDLOOP_EFFECTS`` are set by the user and need no trust. Raises
    InputError: a folder is not trusted; an effect file fails or takes the name of a built-in effect.
    """
    known = dict(built_in())
    named = [read_effect_files(Path(item)) for item in os.environ.get("IDLOOP_EFFECTS", "").split(os.pathsep) if item]
    beside = [read_effect_files(folder) for folder in folders]
    for files in beside:
        check_trusted(files)
    for files in (*named, *beside):
        for name, several in _effects_in(files).items():
            if name in built_in():
                raise InputError(f"{files.folder}: effect '{name}' has the name of a built-in one: choose another name")
            known[name] = several
    for files in (*named, *beside):
        for several in _effects_in(files).values():
            for effect in several:
                _check_names(effect, known, files.folder)
    return known


def _check_names(effect: Effect, known: Mapping[str, tuple[Effect, ...]], folder: Path) -> None:
    """Refuse an effect that names an unknown one as equivalent or nested."""
    for name in (*effect.contains, *effect.same_as):
        if name not in known:
            cure = did_you_mean_or_known(name, list(known))
            raise InputError(f"{folder}: effect {effect.name} refers to the unknown effect '{name}'{cure}")


def unknown_effect(name: str, known: Mapping[str, Sequence[Effect]]) -> InputError:
    """The error of a name that is in no catalogue; of an everyday word it says the catalogue's name."""
    word = re.sub(r"[\s\-]+", "_", name.strip().lower())
    meant = [other for other, several in known.items() if word in several[0].also_called]
    cure = f" (here: {' or '.join(map(repr, meant))})" if meant else did_you_mean_or_known(name, list(known))
    return InputError(f"unknown effect '{name}'{cure}")


def find_effect(name: str, site: str, *folders: Path) -> Effect:
    """Look an effect up by name and kind of site.

    Raises InputError: unknown effect, or one that does not act at such a site.
    """
    known = catalogue(*folders)
    if name not in known:
        raise unknown_effect(name, known)
    for effect in known[name]:
        if effect.site == site:
            return effect
    fits = " or ".join(effect.site for effect in known[name])
    raise InputError(f"effect {name} does not act at the site kind '{site}': it acts at {fits}")


def parameter_as(effect: Effect, fact: Callable[[Effect], str], *folders: Path) -> str:
    """Parameter that a fact names, such as the level of dry friction, of an effect or of one nested in it.

    `fact`: such as ``lambda effect: effect.dry_level``.
    `*folders`: as in `catalogue`.
    Returns: empty where the effect does not have the fact.
    """
    own = fact(effect)
    if own or not effect.contains:
        return own
    for name, shared in effect.contains.items():
        inner = fact(find_effect(name, effect.site, *folders))
        if inner in shared:
            return shared[inner]
    return ""
