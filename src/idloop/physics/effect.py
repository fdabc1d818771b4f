"""What a physical effect is: equations at a site, parameters, and words for the user.

An effect is one file that assigns ``EFFECT = Effect(...)``. The built-in ones lie in
``idloop/physics/effects``; a user's own lie in a folder named ``effects`` beside the model
file, which its user trusts once (`idloop trust`), or in the folders of the environment
variable ``IDLOOP_EFFECTS``, and take part in everything like the built-in ones.

Arguments ``(a, b, c, elapsed, state, parameters)`` of the equations, by place:

=============  ==========================  =========================  ======================
place          a                           b                          c
=============  ==========================  =========================  ======================
``command``    command so far              velocity of body 0         command as sent
``force``      position                    velocity                   inertia
``friction``   direction (+1 or -1)        speed (0: breakaway)       torque that arrives
``coupling``   torque so far               twist                      stiffness
``reading``    reading so far              position                   velocity
``undo``       command that must come out  velocity of body 0         its side, -1 to +1
=============  ==========================  =========================  ======================

``undo`` is the inverse of ``command``, for a compensator. Its third argument is the sign of the first one, but goes
smoothly from -1 to +1 near zero: an inverse that jumps takes its jump from it. A ``force`` or ``friction`` needs no
such inverse: a compensator asks the drive for what the equation takes along the reference.

An effect that depends on a measured condition, such as a temperature, finds how far it is from its reference in its
first state; that is 0 where it was not measured.

An effect with memory also has ``settle``: called with the same arguments after each step, it
writes the state that the next step starts from.
"""

from __future__ import annotations

import hashlib
import importlib.util
import math
import os
import sys
from collections.abc import Callable, Mapping
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
class ParameterSpec:
    """A parameter of an effect.

    Attributes
    ----------
    name : str
        Name in model files.
    unit : str
        Unit; ``{input}``, ``{force}``, ``{position}``, ``{output}`` stand for the model's own.
    start : float
        Value when the user gives none; what a fit starts from.
    neutral : float
        Value at which the effect does nothing.
    min, max : float
        Physical bounds.
    integer : bool
        A whole number, chosen and not estimated.
    optional : str
        Name of the parameter whose value is taken when this one is not given.
    held : bool
        Kept at its start value when the effect is only looked for.
    chosen : bool
        Says where another parameter counts from, such as a reference temperature: never estimated.
    """

    name: str
    unit: str
    start: float = 0.0
    neutral: float = 0.0
    min: float = -float("inf")
    max: float = float("inf")
    integer: bool = False
    optional: str = ""
    held: bool = False
    chosen: bool = False

    @property
    def estimated(self) -> bool:
        """Whether a fit may move it."""
        return not (self.integer or self.chosen)


@dataclass(frozen=True)
class EffectEquation:
    """How an effect is written, in LaTeX.

    ``@q``, ``@v`` and ``@F`` stand for position, velocity and force in the letters of the axis (theta, omega, T or
    x, v, F), ``@u`` for the command and ``@y`` for the reading that come in, ``@s`` for the site, and ``@i`` for the
    body where there are several.

    Attributes
    ----------
    term : str
        Its symbol in the balance of forces, the command or the reading, with its sign; empty where the equation
        says all.
    text : str
        The equation.
    symbols : mapping of str to str
        Symbol of each parameter.
    """

    term: str
    text: str
    symbols: Mapping[str, str] = field(default_factory=dict)


def _always(values: Mapping[str, float]) -> bool:
    return True


def _no_rate(values: Mapping[str, float], inertia: float, stiffness: float) -> float:
    return 0.0


@dataclass(frozen=True)
class Effect:
    """A physical effect of the catalogue.

    Attributes
    ----------
    name : str
        Name in model files; an interface that does not change.
    site : {"input", "body", "coupling", "output"}
        Where the effect acts.
    text : str
        One sentence of physics for the user.
    parameters : tuple of ParameterSpec
        In the order in which the equations index them.
    command, force, friction, coupling, reading : Hook, optional
        The equations, see the module's table.
    settle : Hook, optional
        Update of the effect's memory.
    edge : Hook, optional
        Of a coupling, the twist at plus and minus which its equation jumps, from the same arguments: the simulator
        finds the instant and keeps the side in the effect's first state.
    states : int
        How many numbers the effect remembers; the first is the deviation of a condition that it depends on.
    condition : str
        Measured condition that the effect depends on, such as ``temperature`` or ``supply``: it is looked for only
        where that was recorded.
    reference : str
        Parameter that is the condition at which the effect does nothing.
    order : int
        Place in the chain of effects at one site, small first.
    final : bool
        An output effect that acts after the measurement noise (quantisation); an estimate counts what it does as noise.
    outputs : tuple of str
        The outputs it fits: ``position``, ``velocity``.
    looks_like : tuple of str
        Effects that data often cannot tell from this one.
    linear : bool
        Linear in the motion: part of the linear model that observers are designed on.
    proportional : bool
        Of a force or friction without memory: proportional to its first parameter, the others kept.
    rate, spatial_rate : callable
        ``(values, inertia, stiffness)`` to the fastest rate that the effect adds, in rad/s and
        in rad per unit of position: they choose the integration step.
    delay : str
        Parameter that is a pure delay of the input or output, handled by the simulator.
    splits : bool
        The effect splits its body in two; handled when the model is laid out.
    trials : callable, optional
        From `Scales` to alternatives of values to try when the effect is looked for; from the
        parameters' units when left out.
    further : callable, optional
        From `Scales` and the values of the plain form, which leaves optional and held parameters alone, to alternatives
        of these to try when the fuller form is looked for beside it.
    contains : mapping
        Effects that are this one with some parameters at their neutral values:
        ``{effect: {its parameter: parameter of this one}}``.
    separable : bool
        Still an effect when the part of it that is another effect is switched off.
    degenerates_to : tuple of str
        Effects that this one imitates at the edge of its parameters.
    same_as : tuple of str
        Effects of the same site that together are the same equation, so that no motion tells them apart. A constant at
        the input may name one of a body, the driven one (where what acts behind it passes constants), and a delay of
        a sensor one of the input (where there is one sensor).
    by_hand : mapping
        What to do where motion cannot tell: ``{effect of the same equation: check}``.
    passes_constants : bool
        Of an effect at the input: a constant added to what comes in is a constant added to what goes out.
    odd : bool
        Of an effect at the input: the same in both directions and without memory, so that it is a plain gain while the
        command has one size.
    everyday : bool
        Any servo axis may have it: data that cannot show it say too little of the axis to call a model adequate.
    suggest_order : int
        Place among the effects that the next experiment is to show, small first.
    whole_turn : bool
        Looks like an offset or a spring as long as the motion covers less than a turn.
    hidden_by_start : bool
        An unknown start looks the same, so that no experiment is chosen to show it.
    resolution : str
        Parameter that is the step of the readings: the data's own lattice shows it, without a refit.
    site_parameter : str
        Parameter of the body or the coupling itself that does the same as this effect's first one, such as
        ``viscous_friction``; where it is free the effect is not looked for.
    dry_level : str
        Parameter that is the dry friction at speed.
    command_limit : str
        Parameter that is the largest command that acts on an axis at rest.
    slow : bool
        A force that a disturbance with a long memory may stand for, so that only a refit shows it.
    anywhere : bool
        A slow force that looks the same on whatever body of the axis it acts.
    needs_angle : bool
        Makes sense only where positions are angles.
    several : bool
        May act several times at one site, as waves of several harmonics do.
    equation : EffectEquation, optional
        How it is written; as a function of what it depends on when left out.
    valid : callable
        Whether values together make sense, beyond each parameter's own bounds.
    undo : Hook, optional
        Inverse of ``command``, for a compensator.
    lost_motion : str
        Parameter that is the way lost at a reversal, which a compensator takes up.
    not_cancelled : str
        Why a compensator leaves the effect alone, in words; empty where it does not.
    """

    name: str
    site: str
    text: str
    parameters: tuple[ParameterSpec, ...]
    command: Hook | None = None
    force: Hook | None = None
    friction: Hook | None = None
    coupling: Hook | None = None
    reading: Hook | None = None
    settle: Hook | None = None
    edge: Hook | None = None
    states: int = 0
    condition: str = ""
    reference: str = ""
    order: int = 50
    final: bool = False
    outputs: tuple[str, ...] = ("position", "velocity")
    looks_like: tuple[str, ...] = ()
    linear: bool = False
    proportional: bool = False
    rate: Callable[[Mapping[str, float], float, float], float] = field(default=_no_rate)
    spatial_rate: Callable[[Mapping[str, float], float, float], float] = field(default=_no_rate)
    delay: str = ""
    splits: bool = False
    trials: Trials | None = None
    further: FurtherTrials | None = None
    contains: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    separable: bool = False
    degenerates_to: tuple[str, ...] = ()
    same_as: tuple[str, ...] = ()
    by_hand: Mapping[str, str] = field(default_factory=dict)
    passes_constants: bool = False
    odd: bool = False
    everyday: bool = False
    suggest_order: int = 100
    whole_turn: bool = False
    hidden_by_start: bool = False
    resolution: str = ""
    site_parameter: str = ""
    dry_level: str = ""
    command_limit: str = ""
    slow: bool = False
    anywhere: bool = False
    needs_angle: bool = False
    several: bool = False
    equation: EffectEquation | None = None
    valid: Callable[[Mapping[str, float]], bool] = field(default=_always)
    undo: Hook | None = None
    lost_motion: str = ""
    not_cancelled: str = ""

    def __post_init__(self) -> None:
        """Each parameter that a fact names must be there."""
        shared = [mine for parameters in self.contains.values() for mine in parameters.values()]
        facts = (self.delay, self.lost_motion, self.resolution, self.dry_level, self.command_limit, self.reference)
        for name in (*facts, *shared):
            if name:
                self.spec(name)
        if bool(self.condition) != bool(self.reference) or (self.condition and not self.states):
            raise InputError(f"effect {self.name}: a condition needs its reference and a first state for its deviation")

    @property
    def condition_unit(self) -> str:
        """Unit of the measured condition that it depends on, that of its reference; empty where there is none."""
        return self.spec(self.reference).unit if self.reference else ""

    @property
    def lags(self) -> bool:
        """What comes out depends on what went in before: a delay, a filter, a play."""
        return self.settle is not None or bool(self.delay)

    @property
    def from_a_level(self) -> str:
        """Parameter below which nothing happens, infinite without the effect; empty without one."""
        if self.splits or not self.parameters:
            return ""
        return "" if math.isfinite(self.parameters[0].neutral) else self.parameters[0].name

    @property
    def strength(self) -> str:
        """Parameter that the effect grows with, from nothing at its neutral value; empty without one."""
        if self.splits or not self.parameters:
            return ""
        first = self.parameters[0]
        return first.name if not first.integer and math.isfinite(first.neutral) else ""

    def spec(self, name: str) -> ParameterSpec:
        """Return a parameter's specification.

        Raises
        ------
        InputError
            The effect has no such parameter.
        """
        for spec in self.parameters:
            if spec.name == name:
                return spec
        known = [spec.name for spec in self.parameters]
        raise InputError(f"effect {self.name} has no parameter '{name}'{did_you_mean_or_known(name, known)}")


def _load_file(files: EffectFiles, name: str) -> ModuleType:
    """Run one effect file as it was read, under a name of its own."""
    path = files.folder / name
    digest = hashlib.sha256(f"{path} {files.checksum}".encode("utf-8", "surrogateescape")).hexdigest()[:12]
    title = f"idloop_effect_{path.stem}_{digest}"
    if title in sys.modules:
        return sys.modules[title]
    # What is compiled is cached beside the copy, where nobody else can leave anything.
    spec = importlib.util.spec_from_file_location(title, kept_copy(files, name))
    if spec is None or spec.loader is None:
        raise InputError(f"{path}: cannot be read as an effect file")
    module = importlib.util.module_from_spec(spec)
    # Data of its own lie beside the original.
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
    """All effects that are known, by name: built in, from ``IDLOOP_EFFECTS``, and from folders.

    Parameters
    ----------
    *folders : Path
        Further folders of effect files, such as the one beside a model file. Their files run once they are trusted,
        see `idloop.physics.trust`; those of a folder that ``IDLOOP_EFFECTS`` names do, for it is the user who sets it.

    Raises
    ------
    InputError
        A folder is not trusted; an effect file fails or takes the name of a built-in effect.
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
    """Refuse an effect that is said to be, or to contain, one that there is not."""
    for name in (*effect.contains, *effect.same_as):
        if name not in known:
            cure = did_you_mean_or_known(name, list(known))
            raise InputError(f"{folder}: effect {effect.name} is said to be or contain '{name}', which is none{cure}")


def find_effect(name: str, site: str, *folders: Path) -> Effect:
    """Look an effect up by name and kind of site.

    Raises
    ------
    InputError
        There is no such effect, or it does not act at such a site.
    """
    known = catalogue(*folders)
    if name not in known:
        raise InputError(f"unknown effect '{name}'{did_you_mean_or_known(name, list(known))}")
    for effect in known[name]:
        if effect.site == site:
            return effect
    fits = " or ".join(effect.site for effect in known[name])
    raise InputError(f"effect {name} does not act at the site kind '{site}': it acts at {fits}")


def parameter_as(effect: Effect, fact: Callable[[Effect], str], *folders: Path) -> str:
    """Parameter that a fact is about, such as the level of dry friction, of an effect or of one that it contains.

    Parameters
    ----------
    effect : Effect
    fact : callable
        Such as ``lambda effect: effect.dry_level``.
    *folders : Path
        As in `catalogue`.

    Returns
    -------
    str
        Empty where the fact is not one of this effect.
    """
    own = fact(effect)
    if own or not effect.contains:
        return own
    for name, shared in effect.contains.items():
        inner = fact(find_effect(name, effect.site, *folders))
        if inner in shared:
            return shared[inner]
    return ""
