"""The first model of a log, its fit, and whether that fit describes anything."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from idloop.api.data import read_bags
from idloop.api.fit import fit, fit_and_compare, with_command_response
from idloop.api.result import Progress, part
from idloop.diagnosis.screening.command_response import CommandResponse
from idloop.errors import InputError
from idloop.estimation.dataset import FEWEST_SAMPLES
from idloop.estimation.direction import OPPOSITE_DIRECTION, opposite_direction_warning
from idloop.physics.effect import built_in
from idloop.records.gaps import LEFT_OUT
from idloop.records.recognition.model_start import start_model
from idloop.spelling import joined_names
from idloop.validation.measures import HALF_OF_POWER
from idloop.validation.words import force_text

if TYPE_CHECKING:
    from idloop.api.fit import Fit
    from idloop.physics import Model
    from idloop.records import Record
    from idloop.validation import Comparison
    from idloop.validation.drive import ForceError


_NOTHING = 1.0  # FIT of a prediction that is no better than a constant [%]
# Share of the drive force that values which describe something explain, and FIT of a free run that shows that they do
# where the force does not [%]; play, for one, hides the force but not the motion.
_EXPLAINED, _FOLLOWS = 0.1, 20.0
_ASTRAY = -100.0  # FIT of a velocity [%], which does not drift as a position does, that is off by twice its spread
# Force error of values that describe what acts, wherever a free run goes: that of an arm under gravity is unstable.
_BALANCED = 0.3


@dataclass(frozen=True)
class FirstModel:
    """What a first model is made of."""

    name: str
    joint: str
    command_unit: str
    outputs: dict[str, str]  # unit by field
    measured: bool  # the input was measured and is not held
    # Name of the body that the joint drives, and unit of its position, where that was recorded
    load: tuple[str, str] | None = None

    def model(self, records: Sequence[Record] = ()) -> Model:
        """The model, with rough values from records where there are some."""
        options = {"load": self.load, "measured": self.measured, "records": records}
        return start_model(self.name, self.joint, self.command_unit, self.outputs, **options)  # type: ignore[arg-type]


@dataclass(frozen=True)
class FirstFit:
    """What came of the fit."""

    model: Model  # with rough values
    fit: Fit | None = None
    why_not: str = ""  # why there is none
    asked: bool = True  # whether a fit was asked for
    possible: bool = True  # whether nothing stands against one
    reversed: bool = False  # whether the motion follows minus the command
    # Whether there is no fit because the model predicts the motion no better with the command than without
    unmoved: bool = False
    # Whether there is no fit because the model of one body describes nothing, although the motion follows
    incomplete: bool = False
    bags: tuple[Path, ...] = ()  # of those that were given, the ones that are long enough for a fit
    notes: tuple[str, ...] = ()  # what was left out, and where records were cut
    apart: tuple[tuple[Path, ...], ...] = ()  # of those that cannot be fitted together, the ones that can


def first_fit(
    kind: FirstModel, bags: Sequence[Path], *, fitted: bool, refused: str = "", progress: Progress
) -> FirstFit:
    """Fit a first model to bags.

    `fitted`: else only rough values are found.
    `refused`: why these bags are of no use for a fit; empty where they are.
    """
    model = kind.model()
    try:
        long, notes = _long_enough(bags, model)
        model = kind.model(read_bags(long, model, fitted=False))
        try:
            records = read_bags(long, model)  # refuses what no fit can use
        except InputError as error:
            if not (sound := _sound(long, model)):
                raise
            why = f"{error}{left_out(long, sound)}"
            return FirstFit(model, why_not=why, asked=fitted, apart=(sound,), notes=notes)
        notes += tuple(one.text for record in records for one in record.findings if one.kind == LEFT_OUT)
        if not fitted:
            return FirstFit(model, why_not="not asked for", asked=False, possible=not refused, bags=long, notes=notes)
        if refused:
            return FirstFit(model, why_not=refused, bags=long, notes=notes)
        found = fit(model, records, progress=progress)
    except InputError as error:
        return FirstFit(model, why_not=str(error), asked=fitted, possible=False)
    return judged(FirstFit(model, found, bags=long, notes=notes))


def beside_weight(done: FirstFit, *, progress: Progress) -> FirstFit:
    """The fit beside the weight that describes most, where inertia and viscous friction alone describe nothing."""
    if done.fit is not None or not (done.incomplete or done.reversed or done.unmoved):
        return done
    joint = done.model.bodies[0]
    rotary = any(one.field == "position" and one.unit == "rad" for one in done.model.outputs)
    found = []
    weights = [one for several in built_in().values() for one in several if one.weight]
    effects = [one.name for one in weights if rotary or not one.needs_angle]
    for place, effect in enumerate(effects):
        model = done.model.with_effects([f"{effect}@{joint}"])
        own = part(progress, place / len(effects), (place + 1) / len(effects))
        try:
            records = read_bags(done.bags, model)
            fitted = fit_and_compare(model, records, progress=part(own, 0.0, 0.5))
        except InputError:
            continue
        if not _shows(fitted, f"{effect}@{joint}"):
            continue
        note = f"{effect}@{joint} is in the model: without a weight, inertia and viscous friction describe nothing"
        one = judged(FirstFit(model, fitted, bags=done.bags, notes=(*done.notes, note)))
        if one.fit is None or one.reversed:
            continue
        # What is refused anyway needs no test of the command, which takes longest.
        responding = with_command_response(fitted, model, records, progress=part(own, 0.5, 1.0))
        if not responding.unrelated:
            found.append(one)
    # The free run of an arm near its upper rest drifts off whatever the model is; its force balance does not.
    forces = [_force_error(one) for one in found]
    if found and not np.isnan(forces).any():
        return found[int(np.argmin(forces))]
    return max(found, key=_follows, default=done)


def _force_error(done: FirstFit) -> float:
    """Largest force error of a record as a share; NaN where one is not known, or is mostly that of the sensors."""
    compared = () if done.fit is None else done.fit.train
    return max((one.force.relative if one.force and one.force.trusted else np.nan for one in compared), default=np.nan)


def _follows(done: FirstFit) -> float:
    """Smallest FIT of a free run [%]."""
    compared = () if done.fit is None else done.fit.train
    return min((fit for one in compared for fit in one.fit.values() if np.isfinite(fit)), default=-np.inf)


def _shows(found: Fit, effect: str) -> bool:
    """Whether the first value of an effect, its size, is none that its error covers."""
    name = next(name for name in found.intervals if name.startswith(f"{effect}."))
    low, high = found.intervals[name]
    return low > 0.0 or high < 0.0


def left_out(bags: Sequence[Path], sound: Sequence[Path]) -> str:
    """The cure of bags that stand in the way of the sound ones; empty where there are no sound ones."""
    names = [bag.name for bag in bags if bag not in sound]
    return f"; leave {joined_names(names)} out, as the last command below does" if sound else ""


def _sound(bags: Sequence[Path], model: Model) -> tuple[Path, ...]:
    """The bags that can be fitted together without those that are refused alone; none where there are no such bags."""

    def refused(some: Sequence[Path], *, excited: bool = True) -> bool:
        try:
            read_bags(some, model, excited=excited)
        except InputError:
            return True
        return False

    # A command that is held through a bag may be another one in the next.
    sound = tuple(bag for bag in bags if not refused([bag], excited=False))
    return sound if 0 < len(sound) < len(bags) and not refused(sound) else ()


def _long_enough(bags: Sequence[Path], model: Model) -> tuple[tuple[Path, ...], tuple[str, ...]]:
    """The bags that a fit can use beside each other, all of them where it can use none; and what there is to say."""
    read = {bag: read_bags([bag], model, fitted=False) for bag in bags}
    longest = {bag: max(record.time.size for record in records) for bag, records in read.items()}
    long = tuple(bag for bag, count in longest.items() if count >= FEWEST_SAMPLES) or tuple(bags)
    short = [f"{bag.name} ({count} samples)" for bag, count in longest.items() if bag not in long]
    notes = [f"left out of the fit, which needs {FEWEST_SAMPLES} samples: {joined_names(short)}"] if short else []
    # The finding of a cut stands at its first part.
    cut = [records[0] for bag, records in read.items() if bag in long and len(records) > 1]
    notes += [f"{record.name}: {one.text}" for record in cut for one in record.findings if one.where == record.name]
    return long, tuple(dict.fromkeys(notes))


def judged(done: FirstFit) -> FirstFit:
    """Take back a fit whose values describe nothing."""
    found = done.fit
    if found is None:
        return done
    refused = replace(done, fit=None)
    if found.unrelated == CommandResponse.REVERSED.text:
        why = f"{OPPOSITE_DIRECTION}: with the sign of one of the two turned, the model predicts it"
        return replace(refused, why_not=why, reversed=True)
    if found.unrelated:
        why = f"{found.unrelated} Another column may be the command: --command COLUMN"
        return replace(refused, why_not=why, unmoved=True)
    if found.determines_nothing:
        why = (
            f"the data determine none of {joined_names(found.result.names)}: no interval excludes zero; record faster"
            " changes of the velocity, or let a diagnosis find what else moves the axis"
        )
        return replace(refused, why_not=why, incomplete=True)
    # Predictions ahead need an observer, and are asked last.
    why = _describes_nothing(found.train)
    if not why and not _is_predicted(found):
        why = "inertia and viscous friction predict no signal of any record better than a constant does"
    if why:
        return replace(refused, why_not=f"{why}; let a diagnosis find what the model lacks", incomplete=True)
    return replace(done, reversed=bool(opposite_direction_warning(done.model, found.model)))


def _describes_nothing(compared: Sequence[Comparison]) -> str:
    """Why the values say nothing of any record; empty where they say something of one.

    A few samples ahead the newest measurements predict what any model does, so only forces and free runs are asked.
    """
    known = [one.force for one in compared if one.force is not None]
    forces = [one.relative for one in known]
    balanced = any(one.trusted and one.relative < _BALANCED for one in known)
    velocities = [fit for one in compared for fit in _free_runs(one, "velocity")]
    if velocities and max(velocities) < _ASTRAY and not balanced:
        return "the values describe nothing: the free run of the velocity is off by more than twice what it varies by"
    if velocities and max(velocities) < 0.0 and len(forces) == len(compared) and min(forces) > HALF_OF_POWER:
        return (
            "the values describe nothing: the free run of the velocity is worse than a constant, and the force error is"
            f" {_least(known)}"
        )
    # A position is the integral of the velocity and shows less of the values.
    runs = velocities or [fit for one in compared for fit in _free_runs(one, "position")]
    if len(forces) < len(compared) or min(forces) < 1.0 - _EXPLAINED or max(runs, default=-np.inf) > _FOLLOWS:
        return ""
    return (
        f"the values describe nothing: the free run does not follow the motion, and the force error is {_least(known)}"
    )


def _least(known: Sequence[ForceError]) -> str:
    """The least force error in words, and what sensor noise alone makes of it where that is much."""
    least = min(known, key=lambda one: one.relative)
    noise = "" if least.trusted else f", of which sensor noise alone makes {force_text(least.noise, 3, ' %')}"
    return f"{force_text(least.relative, 3, ' %')}{noise}"


def _free_runs(one: Comparison, field: str) -> list[float]:
    """FIT of the free runs of a record [%]; of a position beside a straight line, which any constant speed gives."""
    fits = []
    for index, output in enumerate(one.model.outputs):
        measured, modelled = one.measured[:, index], one.simulated[:, index]
        known = np.isfinite(measured) & np.isfinite(modelled)
        if output.field != field or not known.any():
            continue
        time, value = one.time[known], measured[known]
        course = np.polynomial.Polynomial.fit(time, value, 1 if field == "position" else 0)(time)
        spread = float(np.linalg.norm(value - course))
        if spread > 0.0:
            fits.append(100.0 * (1.0 - float(np.linalg.norm(value - modelled[known])) / spread))
    return fits


def _is_predicted(found: Fit) -> bool:
    """Whether any output of any record is predicted better than by a constant, in a free run or some samples ahead.

    Predictions ahead need an observer, which takes long, and are asked only where no free run says it.
    """
    runs = (value for one in found.train for value in one.fit.values())
    ahead = (value for one in found.train for value in one.fit_ahead.values())
    return any(np.isfinite(value) and value >= _NOTHING for value in itertools.chain(runs, ahead))
