"""What the first fit of a log is worth, beside what the inspection of its records says."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from idloop.records.inspection.grade import EVERYTHING, NOT_USABLE
from idloop.reporting.text.blocks import Block
from idloop.reporting.text.comparison import worst_output
from idloop.spelling import joined_names, listed
from idloop.validation.words import fit_text, force_text

if TYPE_CHECKING:
    from idloop.physics import Model
    from idloop.records.inspection.inspection import Inspection
    from idloop.validation import Comparison

_GAIN, _LOOP_GAIN = "drive.gain", "drive.proportional"
_FORCE = 0.1  # force error above which a model lacks something, however well its free run follows


def verdict(inspections: Sequence[Inspection], rows: Sequence[tuple[str, Comparison]]) -> str:
    """One sentence that weighs the fit and the faults of what was fitted.

    Parameters
    ----------
    inspections : sequence of Inspection
    rows : sequence of (str, Comparison)
        As `measures_of` takes them.
    """
    worst = worst_output(rows)
    if worst is None:
        model = "no free run could be judged"
    elif worst.good and (forces := [force for _, one in rows if (force := _force_left(one)) > _FORCE]):
        model = (
            f"the free run follows the motion (FIT {fit_text(worst.fit, 4, ' %')} or more), but the force error is"
            f" up to {force_text(max(forces), 3, ' %')}: a diagnosis looks for the physical effect that the model lacks"
        )
    elif worst.good:
        model = f"the model describes what was recorded (FIT of the free run {fit_text(worst.fit, 4, ' %')} or more)"
    else:
        model = f"{worst.text}: a diagnosis looks for the physical effect that the model lacks"
    return f"{model}; {_recordings(inspections)}"


def _force_left(one: Comparison) -> float:
    """Force error of a record that sensor noise does not explain; 0 where there is none."""
    return one.force.relative if one.force is not None and one.force.trusted else 0.0


def _recordings(inspections: Sequence[Inspection]) -> str:
    # What one record does not show another may.
    spoilt = [{name: None for fault in one.faults for name in fault.spoils} for one in inspections]
    everywhere = [name for name in spoilt[0] if all(name in one for one in spoilt)]
    said = []
    if everywhere:
        which = "the recording is not" if len(inspections) == 1 else "no recording is"
        said.append(f"{which} usable for {joined_names(everywhere)}, whatever FIT and intervals say")
    if alone := [one.path.name for one in inspections if one.grade == f"{NOT_USABLE} {EVERYTHING}"]:
        said.append(f"{listed(alone, 3)} can be used beside others only")
    if said:
        return "; ".join(said)
    return "mind the warnings above" if any(one.faults for one in inspections) else "the recording shows no fault"


def referred_load(model: Model) -> Iterator[Block]:
    """Yield how far a load moves beside the axis that drives it, and that its values are those that the axis feels."""
    first = model.bodies[0]
    for output in model.outputs:
        body = output.body
        if body != first and output.field == "position" and output.scale != 1.0:
            yield (
                f"{output.joint}.position moves {output.scale:.6g} times as far as {first}, which the data show:"
                f" inertia, friction and stiffness at {body} are those that {first} feels; divide them by"
                f" {output.scale**2:.6g} for those at {body} itself"
            )


def held_inertia(model: Model) -> Iterator[Block]:
    """Yield that the inertia is not known, where the command is no force and only ratios to it show."""
    if model.loop is not None and _LOOP_GAIN in model.free:
        command = "the gain of the loop in the drive is not known, and a set-point"
    elif _GAIN in model.free:
        command = "a command without a unit" if model.input.unit == "-" else f"a command in {model.input.unit}"
    else:
        return
    # A time does not depend on the scale of forces.
    scaled = [name for name in model.free if model.parameter(name).unit != "s"]
    free = joined_names(scaled)
    for name in (f"{body}.inertia" for body in model.bodies):
        one = model.parameter(name)
        if name not in model.free:
            yield (
                f"{name} is held at {one.value:g} {one.unit}: {command} is no force, so the data show"
                f" only ratios to the inertia. If it is larger by a factor, {free}"
                f" {'is' if len(scaled) == 1 else 'are'} larger by the same factor"
            )
    if model.loop is not None:
        yield (
            "gains of the drive that are known tell friction, delay and lag apart: write them into model.yaml"
            " (`drive: {proportional: ..., derivative: ...}`), and let the inertia be estimated"
        )
