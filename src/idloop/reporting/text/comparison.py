"""A model beside records in words: measures, residual tests, where it fails, and what a first fit is worth."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from idloop.estimation.statistics.undetermined import proportional_to_force
from idloop.records.inspection.grade import EVERYTHING, NOT_USABLE
from idloop.reporting.residual_findings import residual_findings, residual_line
from idloop.reporting.text.blocks import Block, Table, number
from idloop.spelling import joined_names, listed
from idloop.validation.words import fit_text, force_text

if TYPE_CHECKING:
    from idloop.validation import Comparison
    from idloop.validation.where import ErrorMap

    Rows = Sequence[tuple[str, Comparison]]
    from idloop.physics import Model
    from idloop.records.inspection.inspection import Inspection


# Of what stands out: so much of the first error, the drive force where there is one, and of every further one.
_FIRST, _FURTHER = 2, 1
# FIT of a free run below which a model is worth a diagnosis, and below which it may not move by the command at all [%].
_GOOD, _MISSES = 90.0, 20.0


def measures_of(rows: Rows) -> Iterator[Block]:
    """Yield the table of measures, one line for each output; a row is what the first column says and a comparison."""
    table = []
    for label, comparison in rows:
        measures = zip(comparison.names, comparison.model.outputs, strict=True)
        for index, (name, output) in enumerate(measures):
            # One force for the whole record: printed once.
            force = None if index else comparison.force
            fit, ahead = fit_text(comparison.fit[name]), fit_text(comparison.fit_ahead[name])
            errors = (number(comparison.nrmse[name]), number(comparison.rmse[name]), output.unit, ahead)
            relative = "-" if force is None else force_text(force.relative, 4)
            table.append((label, comparison.record.name, name, fit, *errors, relative))
    steps = rows[0][1].steps
    header = ("", "record", "output", "FIT %", "NRMSE", "RMSE", "unit", f"FIT % {steps} ahead", "force error %")
    yield Table.of(header, table)
    for reason in dict.fromkeys(comparison.no_force for _, comparison in rows if comparison.no_force):
        yield f"no force error: {reason}"
    yield from _force_of_noise(rows)


def lowest_fits(rows: Rows, most: int) -> tuple[Rows, str]:
    """Return the records with the lowest FIT in the order of all, and a line on the others; all where they are few."""
    if len(rows) <= most:
        return rows, ""
    lowest = [min(filter(math.isfinite, one.fit.values()), default=math.inf) for _, one in rows]
    by_fit = sorted(range(len(rows)), key=lambda place: lowest[place])
    rest = [lowest[place] for place in by_fit[most:] if math.isfinite(lowest[place])]
    reach = f", with a FIT of {fit_text(rest[0])} to {fit_text(rest[-1])} %" if rest else ""
    line = (
        f"the {most} records with the lowest FIT are shown; {len(rows) - most} more{reach}: idloop compare shows each"
    )
    return [rows[place] for place in sorted(by_fit[:most])], line


def _force_of_noise(rows: Rows) -> Iterator[Block]:
    """Yield why force errors that sensor noise makes are far larger than what a fit leaves of the force."""
    noisy = [(one.force, one.record.name) for _, one in rows if one.force is not None and not one.force.trusted]
    if noisy:
        worst = max((force for force, _ in noisy), key=lambda force: force.noise)
        yield (
            f"force error of {listed(name for _, name in noisy)}: sensor noise alone makes"
            f" {force_text(worst.noise, 3, ' %')}, as the motion is differentiated up to {worst.band:.3g} Hz: it says"
            " nothing of the model. The force balance of a fit is over smooth windows, where noise averages out, and so"
            " leaves a smaller part"
        )


def misses_every_output(comparisons: Iterable[Comparison]) -> bool:
    """Whether the FIT of a free run is below 20 % for every output of some record."""
    return any(max(one.fit.values()) < _MISSES for one in comparisons)


@dataclass(frozen=True)
class WorstOutput:
    """The output whose free run is worst."""

    fit: float  # FIT [%]
    output: str
    record: str

    @property
    def good(self) -> bool:
        """Whether the model needs no diagnosis: a FIT of 90 % or more."""
        return self.fit >= _GOOD

    @property
    def text(self) -> str:
        """How bad it is, in words."""
        fit = fit_text(self.fit, 4, " %")
        if fit.endswith("%"):
            return f"the free run misses {self.output} of {self.record} (FIT {fit})"
        return f"the free run of {self.output} of {self.record} is {fit}"


def worst_output(rows: Rows) -> WorstOutput | None:
    """The output whose free run is worst; None where none was judged."""
    found = [
        WorstOutput(fit, name, comparison.record.name)
        for _, comparison in rows
        for name, fit in comparison.fit.items()
        if not math.isnan(fit)
    ]
    return min(found, key=lambda one: one.fit, default=None)


def hint(rows: Rows) -> Iterator[Block]:
    """Yield what to do next when the free run of an output has a FIT below 90 %."""
    worst = worst_output(rows)
    if worst is not None and not worst.good:
        yield f"{worst.text}: idloop diagnose with the same model and bags names the physical effect that is missing"


def details(rows: Rows) -> Iterator[Block]:
    """Yield every residual test and every share of the error by region of motion."""
    for label, comparison in rows:
        for one in residual_findings([comparison]):
            yield residual_line(label, one.test)
        for name, regions in comparison.share.items():
            shares = {region: (100 * part["error"], 100 * part["time"]) for region, part in regions.items()}
            parts = (f"{region} {error:.0f} % (of time {time:.0f} %)" for region, (error, time) in shares.items())
            yield f"{label}: squared error of {name}: {', '.join(parts)}"


def where_it_fails(rows: Rows) -> Iterator[Block]:
    """Yield where each model fails, every line of it."""
    for label, comparison in rows:
        yield f"{label}: where the error of {comparison.record.name} falls"
        for line in comparison.where.lines():
            yield f"  {line}"


def in_brief(rows: Rows) -> Iterator[Block]:
    """Yield the most telling of residual tests and of where each model fails, a few lines for each model."""
    for label, comparison in rows:
        yield f"{label}, {comparison.record.name}:"
        verdicts = _brief_verdicts(comparison)
        if verdicts:
            yield f"  one-step residual: {verdicts}"
        for index, one in enumerate(comparison.where.maps):
            for line in brief_map(one, _FIRST if index == 0 else _FURTHER):
                yield f"  {line}"


def _brief_verdicts(comparison: Comparison) -> str:
    """Residual tests in one line; outputs with the same result together."""
    named: dict[str, list[str]] = {}
    for test in (one.test for one in residual_findings([comparison])):
        white = "white" if test.white else "not white"
        named.setdefault(f"{white}, {test.freedom}", []).append(test.name)
    return "; ".join(f"{' and '.join(names)} {text}" for text, names in named.items())


def brief_map(one: ErrorMap, most: int) -> list[str]:
    """How large an error is, along what it falls most, what it follows, and its worst stretch."""
    head, *rest = one.lines()
    shown = [head]
    # As `lines` writes them: why, what stands out (most first), what does not, what it follows, the worst stretches.
    rest = rest[1:] if one.why else rest
    shown += rest[: min(most, sum(breakdown.stands_out for breakdown in one.breakdowns))]
    if most == _FIRST:
        shown += [line for line in rest if line.startswith("  a curve over one variable")]
        shown += [f"  worst: {stretch.line()}" for stretch in one.loud_stretches[:1]]
    return shown


_GAIN, _LOOP_GAIN = "drive.gain", "drive.proportional"
_MAY_SET_SPEED = ("-", "V")
_ASTRAY = -900.0  # FIT of a free run that misses by ten times what it varies by [%]
_BLACK_BOX = "open-loop black-box models"  # what a loop without its reference spoils
_FORCE = 0.1  # force error above which a model lacks something, however well its free run follows


def verdict(inspections: Sequence[Inspection], rows: Sequence[tuple[str, Comparison]]) -> str:
    """One sentence that weighs the fit and the faults of what was fitted; `rows` as `measures_of` takes them."""
    worst = worst_output(rows)
    if worst is None:
        model = "no free run could be judged"
    elif worst.good and (forces := [one.force.relative for _, one in rows if one.force and _force_left(one) > _FORCE]):
        model = (
            f"the free run follows the motion (FIT {fit_text(worst.fit, 4, ' %')} or more), but the force error is"
            f" up to {force_text(max(forces), 3, ' %')}: a diagnosis looks for the physical effect that the model lacks"
        )
    elif worst.good:
        model = f"the model describes what was recorded (FIT of the free run {fit_text(worst.fit, 4, ' %')} or more)"
    elif worst.fit < _ASTRAY and (speed := _speeds_beside(rows)):
        model = (
            f"{worst.text}, and that of the velocity is worse than a constant as well: the command may be no force but"
            " set the speed, as the lever of a valve, a joystick and a loop in the drive do: if so, start again with"
            f" `--command 'COLUMN={speed}'`; or the axis is unstable without its controller. Settle this before a"
            " diagnosis"
        )
    else:
        model = f"{worst.text}: a diagnosis looks for the physical effect that the model lacks"
    return f"{model}; {_recordings(inspections)}"


def _speeds_beside(rows: Rows) -> str:
    """Unit of the velocities that a command may set, where the free run of each is worse than a constant.

    A current, a torque and a force set no speed; a voltage may be the input of a drive or of a valve.
    """
    if any(one.model.loop is not None or one.model.input.unit not in _MAY_SET_SPEED for _, one in rows):
        return ""
    outputs = [
        (one.fit[name], output.unit)
        for _, one in rows
        for name, output in zip(one.names, one.model.outputs, strict=True)
        if output.field == "velocity" and not math.isnan(one.fit[name])
    ]
    return "" if any(fit >= 0.0 for fit, _ in outputs) else next((unit for _, unit in outputs), "")


def _force_left(one: Comparison) -> float:
    """Force error of a record that sensor noise does not explain; 0 where there is none."""
    if one.force is None or not one.force.trusted:
        return 0.0
    return math.sqrt(max(one.force.relative**2 - one.force.noise**2, 0.0))


def _recordings(inspections: Sequence[Inspection]) -> str:
    # What one record does not show another may.
    spoilt = [{name: None for fault in one.faults for name in fault.spoils} for one in inspections]
    everywhere = [name for name in spoilt[0] if all(name in one for one in spoilt)]
    said = []
    if everywhere:
        which = "the recording is not" if len(inspections) == 1 else "no recording is"
        # FIT and intervals are those of a physical model: they say nothing of black-box models, which are fitted apart.
        doubted = [] if everywhere == [_BLACK_BOX] else ["whatever FIT and intervals say"]
        said.append(", ".join([f"{which} usable for {joined_names(everywhere)}", *doubted]))
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


def held_scale(model: Model) -> Iterator[Block]:
    """Yield which gain or inertia is held, where the command is no force and only ratios to it show."""
    if model.loop is None and _GAIN not in model.free:
        yield from _forces_in_units_of_the_command(model)
        return
    if model.loop is not None and _LOOP_GAIN in model.free:
        command = "the gain of the loop in the drive is not known, and a set-point"
    elif model.loop is None:
        command = "a command without a unit" if model.input.unit == "-" else f"a command in {model.input.unit}"
    else:
        return
    # Times, angles, speeds and commands do not depend on the scale of forces.
    forces = proportional_to_force(model)
    scaled = [name for name in model.free if name in forces]
    free = joined_names(scaled)
    kind = "torque" if model.input.unit == "N" else "force"
    for name in (f"{body}.inertia" for body in model.bodies):
        one = model.parameter(name)
        if name not in model.free:
            yield (
                f"{name} is held at {one.value:g} {one.unit}: {command} is no {kind}, so the data show"
                f" only ratios to the inertia. If it is larger by a factor, {free}"
                f" {'is' if len(scaled) == 1 else 'are'} larger by the same factor"
            )
    if model.loop is not None:
        yield (
            "gains of the drive that are known tell friction, delay and lag apart: write them into model.yaml"
            " (`drive: {proportional: ..., derivative: ...}`), and let the inertia be estimated"
        )


def _forces_in_units_of_the_command(model: Model) -> Iterator[Block]:
    """Yield that forces are those of a gain of one, where the command is no force."""
    gain, force, unit = model.parameter(_GAIN), model.units.force, model.input.unit
    if gain.value != 1.0 or unit == force:
        return
    command, one = f"a command in {unit}", f"1 {unit}"
    if unit == "-":
        command, one = "a command without a unit", "a command of one"
    kind = "torque" if unit == "N" else "force"
    yield (
        f"{_GAIN} is held at 1 {gain.unit}: {command} is no {kind}, so every {force} of this model is the {kind} of"
        f" {one}. If the drive's gain is known, write it into model.yaml (`drive: {{gain: ...}}`) and fit again"
    )
