"""`idloop refine`: diagnose, add, refit, until nothing significant is left; the ladder."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from idloop.cli._command_line import command_line
from idloop.cli._common import (
    BAG,
    ModelArgument,
    apply_options,
    format_table,
    json_option,
    log,
    model_options,
    number,
    print_json,
    read_fitted_and_unseen,
)
from idloop.cli._diagnosis import (
    DiagnosisCommand,
    diagnosis_options,
    limit_options,
    p_text,
    parameters_text,
    read_limits,
)
from idloop.cli._ladder_folder import FILES, Kept, check_target, read_ladder, write_all, write_ladder
from idloop.cli._places import OUTPUT_FOLDER, force_option
from idloop.cli._progress import part, progress, quiet_option
from idloop.errors import IdloopError, InputError
from idloop.reporting.verdicts import basis, conclusion

if TYPE_CHECKING:
    from idloop.cli._next_experiment import Next
    from idloop.diagnosis import Ladder
    from idloop.diagnosis.design.suggest import Limits
    from idloop.physics import Model
    from idloop.records import Record
    from idloop.reporting.remains import Remainder

_AUTO = "auto"
# What a ladder that is gone on with knows by itself, or has behind it.
_OF_THE_LADDER = ("sources", "validate", "settings", "effects", "resume", "undo", "add", "output", "force")
EXAMPLE = """\b
Examples:
  idloop refine dc_motor bags/train --validate bags/unseen --output runs/refined
  idloop refine --resume runs/refined --undo
  idloop refine --resume runs/refined --undo --undo --add coulomb_friction@motor
  idloop refine emps bags/train --most 2 --json
"""


@click.command(cls=DiagnosisCommand, epilog=EXAMPLE)
@click.argument("sources", nargs=-1, metavar="[MODEL] BAG...")
@click.option("--validate", type=BAG, multiple=True, metavar="BAG...", help="Bags that the fits do not see.")
@diagnosis_options
@model_options
@click.option("--most", type=click.IntRange(min=0), default=8, show_default=True, help="Most effects in the ladder.")
@click.option(
    "--resume",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Go on with the ladder in DIR; MODEL and BAG are those of then when left out.",
)
@click.option(
    "--undo",
    count=True,
    help="Take the last step of the resumed ladder back, and stop there; twice: the last two. ladder.json keeps them.",
)
@click.option("--add", metavar="EFFECT@SITE", help="Add this effect, the user's own choice, and go on from there.")
@limit_options
@click.option("--no-suggest", is_flag=True, help="Do not work out the next experiment for what stays open.")
@click.option(
    "--output",
    type=OUTPUT_FOLDER,
    metavar="DIR",
    help=f"Write {', '.join(FILES)} (default with --resume: that folder).",
)
@force_option("Overwrite the files in the folder of --output.")
@quiet_option
@json_option
def command(
    sources: tuple[str, ...],
    *,
    validate: tuple[Path, ...],
    level: float,
    minimum_improvement: float,
    only: tuple[str, ...],
    criterion: str,
    seed: int,
    settings: tuple[str, ...],
    effects: tuple[str, ...],
    most: int,
    resume: Path | None,
    undo: int,
    add: str | None,
    max_command: float | None,
    position_range: tuple[float, float] | None,
    max_velocity: float | None,
    duration: float | None,
    no_suggest: bool,
    output: Path | None,
    force: bool,
    as_json: bool,
) -> None:
    """Add the effects that MODEL lacks one by one, until nothing significant is left in the BAGs.

    Every step is fitted to the BAGs and judged on those of --validate. The ladder ends at an adequate model, at a
    residual that no effect explains, or where the data cannot tell; effects that tie are reported together, and
    the experiment that would separate them is worked out, within the limits given or seen in the data.
    """
    from idloop.diagnosis.equivalence.equivalent_effects import ladder_twins
    from idloop.reporting.estimates import parameter_estimates
    from idloop.reporting.remains import compared, remainders
    from idloop.reporting.tried import only_words
    from idloop.reporting.unshown import unshown
    from idloop.reporting.use import FITTED

    if undo and resume is None:
        raise InputError("--undo takes back the last step of a ladder: add --resume DIR")
    target = output if output is not None else resume
    if target is not None:
        own = resume is not None and target.resolve() == resume.resolve()
        check_target(target, "--output" if output is not None else "--resume", overwrite=force or own)
    limits = read_limits(max_command, position_range, max_velocity)
    kept = read_ladder(resume) if resume is not None else None
    if undo and kept is not None and resume is not None:
        kept = kept.without_last(undo, resume)
    model, bags = _sources(sources, kept)
    model = apply_options(model, settings, effects) if kept is None else model
    unseen = validate or (kept.validate if kept is not None else ())
    records, validation = read_fitted_and_unseen(bags, unseen, model)
    folder = kept.folder if kept is not None else model.folder
    origin = _origin(bags, unseen, kept, seed) if target is not None else {}

    taken_back = kept.taken_back if kept is not None else ()

    def as_kept(ladder: Ladder) -> Kept:
        return Kept(ladder, tuple(bags), tuple(unseen), folder, origin, taken_back=taken_back)

    undecided = criterion == _AUTO and (kept is None or kept.ladder.criterion == _AUTO)
    keep = _Keeper(target, as_kept, undecided=undecided)
    answer: Next | None = None
    with keep.told(), progress(f"refining {model.name}") as update:
        climbing = update if no_suggest else part(update, 0.0, 0.7)
        climb = _Climb(
            records, validation, level, 0.01 * minimum_improvement, criterion, only, seed, most, climbing, keep.step
        )
        if undo and add is None and kept is not None:
            ladder = kept.ladder
        else:
            ladder = climb(model, kept.ladder if kept is not None else None, add=add)
        # What was found after all, or ties with it, is not what the data cannot show.
        ladder = replace(ladder, untestable=tuple(unshown(ladder)))
        keep(ladder)
        if not no_suggest and not (undo and add is None):
            answer = _next(ladder, records, limits, duration, seed, part(update, 0.7, 1.0))
            planned = None if answer is None or answer.suggestion is None else answer.suggestion.to_dict()
            ladder = replace(ladder, suggested_experiment=planned)
    left: Sequence[Remainder] = ()
    unjudged: IdloopError | None = None
    try:
        if target is not None:
            with keep.told(), progress("writing the report") as update:
                suggestion = None if answer is None else answer.suggestion
                contents = write_all(target, as_kept(ladder), records, validation, suggestion, part(update, 0.0, 0.8))
            left = remainders(judged.rows[-1][1] for judged in contents.judged if judged.use == FITTED)
        else:
            left = compared(ladder.model, records)
    except InputError:
        raise
    except IdloopError as error:
        # A model that runs away cannot be compared with anything; what was found is told all the same.
        unjudged = error
    if as_json:
        print_json({
            **ladder.to_dict(),
            "parameters": parameter_estimates(ladder.model),
            "residual": [one.to_dict() for one in left],
            "conclusion": conclusion(ladder, left, only_words(ladder)),
            "one_equation": [group.to_dict() for group in ladder_twins(ladder)],
            "output": target,
            "taken_back": taken_back[-1]["steps"] if undo else [],
        })  # fmt: skip
        if unjudged is not None:
            raise unjudged
        return
    if undo:
        kept_in = "" if target is None else f" (kept in {target / 'ladder.json'}, taken_back)"
        click.echo(f"taken back: {', '.join(taken_back[-1]['steps'])}{kept_in}")
    print_ladder(ladder, left)
    if answer is not None and answer.futile:
        click.echo(f"next experiment: none; {answer.reason}")
    print_parameters(ladder)
    if unjudged is not None:
        raise unjudged
    if target is not None:
        log(f"written: {target}")


@dataclass
class _Keeper:
    """Leaves the ladder on the disk as it grows; after Ctrl-C it says what is kept, and how to go on."""

    target: Path | None
    as_kept: Callable[[Ladder], Kept]
    undecided: bool  # the criterion is chosen by what is found
    latest: Ladder | None = None

    def __call__(self, ladder: Ladder) -> None:
        self.latest = ladder
        if self.target is not None:
            write_ladder(self.target, self.as_kept(ladder))

    def step(self, ladder: Ladder) -> None:
        """Keep a ladder that is not at its end: who goes on with it chooses as one who was not interrupted."""
        self(replace(ladder, criterion=_AUTO) if self.undecided else ladder)

    @contextlib.contextmanager
    def told(self) -> Iterator[None]:
        """Say in the interrupt what is kept."""
        try:
            yield
        except KeyboardInterrupt:
            raise KeyboardInterrupt(f"interrupted: {self._kept()}") from None

    def _kept(self) -> str:
        if self.latest is None:
            return "nothing is kept, no step was finished"
        found = ", ".join(self.latest.added) or "no effect"
        if self.target is None:
            return f"nothing is kept without --output; found so far: {found}"
        self(self.latest)  # once more: it may have been cut off halfway
        go_on = command_line(click.get_current_context(), without=_OF_THE_LADDER, with_=("--resume", str(self.target)))
        return f"{self.target} keeps model.yaml and ladder.json with {found}; go on with: {go_on}"


@dataclass(frozen=True)
class _Climb:
    """The work itself, with everything that all its parts need."""

    records: Sequence[Record]
    validation: Sequence[Record]
    level: float
    least: float
    criterion: str
    only: tuple[str, ...]
    seed: int
    most: int
    update: Callable[..., None]
    keep: Callable[[Ladder], None]

    def __call__(self, model: Model, ladder: Ladder | None, *, add: str | None) -> Ladder:
        from idloop.diagnosis import add_effect, refine

        common: dict[str, Any] = {"seed": self.seed, "progress": self.update}
        if add is not None:
            if ladder is None:
                ladder = refine(
                    model, self.records, self.validation, level=self.level, criterion=self.criterion, most=0, **common
                )
            ladder = add_effect(ladder, add, self.records, self.validation, **common)
            self.keep(ladder)
        return refine(
            model,
            self.records,
            self.validation,
            level=self.level,
            criterion=self.criterion,
            minimum_improvement=self.least,
            effects=self.only or None,
            most=self.most,
            ladder=ladder,
            on_step=self.keep,
            **common,
        )


def _origin(bags: Sequence[Path], unseen: Sequence[Path], kept: Kept | None, seed: int) -> dict[str, Any]:
    """Where the ladder comes from; the commands of a resumed one first."""
    from idloop.reporting.provenance import provenance

    before = kept.provenance.get("commands", []) if kept is not None else []
    return provenance(bags, unseen, commands=[*before, command_line(click.get_current_context())], seed=seed)


def _sources(sources: Sequence[str], kept: Kept | None) -> tuple[Model, Sequence[Path]]:
    """Model and bags of the command line, or those of the resumed ladder."""
    if kept is None:
        if len(sources) < 2:
            missing = "MODEL and BAG are" if not sources else "BAG is"
            raise InputError(f"{missing} missing: write idloop refine MODEL BAG..., or --resume DIR")
        return ModelArgument().convert(sources[0], None, None), [BAG.convert(s, None, None) for s in sources[1:]]
    words = list(sources)
    if words and (not Path(words[0]).exists() or Path(words[0]).suffix in {".yaml", ".yml"}):
        # The model of a ladder is its own; naming it again does no harm.
        ModelArgument().convert(words.pop(0), None, None)
    bags = [BAG.convert(word, None, None) for word in words] or list(kept.bags)
    if not bags:
        raise InputError("BAG is missing: the ladder does not know what it was climbed on")
    for bag in bags:
        BAG.convert(bag, None, None)
    return kept.ladder.model, bags


# ---------------------------------------------------------------- the next experiment


def _next(
    ladder: Ladder,
    records: Sequence[Record],
    limits: Limits,
    duration: float | None,
    seed: int,
    update: Callable[..., None],
) -> Next | None:
    """The experiment that would settle what is open, if anything is.

    Limits that the user has set ask what lies beyond the data so far.
    """
    from idloop.cli._next_experiment import next_of_ladder

    tied = any(ladder.rivals(step) for step in ladder.steps)
    wider = any(limit is not None for limit in limits.to_dict().values())
    if not tied and not wider and ladder.verdict != "not_excited":
        return None
    try:
        return next_of_ladder(ladder, records, limits, {"duration": duration, "seed": seed, "progress": update})
    except IdloopError as error:
        log(f"no experiment can be suggested: {error}")
        return None


# ---------------------------------------------------------------- the table


def print_ladder(ladder: Ladder, left: Sequence[Remainder] = ()) -> None:
    """Print one line a step, the verdict with its physics and what speaks against it, and what would be next.

    Parameters
    ----------
    ladder : Ladder
    left : sequence of Remainder
        Residual tests of the last model on the fitted data.
    """
    from idloop.diagnosis.equivalence.equivalent_effects import ladder_twins
    from idloop.reporting.estimates import fit_text
    from idloop.reporting.remains import also_significant, remainder_lines
    from idloop.reporting.tried import only_words
    from idloop.reporting.unshown import unshown
    from idloop.reporting.use import SAID

    for line in ladder.findings:
        click.echo(line)
    kind = "validation" if any(step.validation for step in ladder.steps) else "train"
    names = list(ladder.steps[0].model.output_names)
    forces = any(getattr(step, kind).get("force") is not None for step in ladder.steps)
    rows = []
    for step in ladder.steps:
        measures: Mapping[str, Any] = getattr(step, kind)
        added = step.added
        force = measures.get("force")
        rows.append(
            (
                "start" if added is None else f"+ {added.name}",
                "-" if added is None else "own choice" if step.chosen_by == "user" else p_text(step.p_value),
                *(fit_text(measures.get("fit", {}).get(name)) for name in names),
                *(["-" if force is None else number(100.0 * force, 3)] if forces else []),
                "" if added is None else parameters_text(added.parameters),
            )
        )
    measured = [*(f"FIT % {name}" for name in names), *(["force error %"] if forces else [])]
    click.echo(format_table(("step", "p", *measured, "parameters at that step (95 %)"), rows))
    click.echo(f"(errors of the {SAID[kind]} data)")
    for step in ladder.steps:
        others = ladder.rivals(step)
        if step.added is not None:
            click.echo(f"{step.added.name}: {step.added.text}")
            if replaced := ladder.replaced(step):
                click.echo(f"  {replaced}")
        if others:
            click.echo(f"  this data cannot tell it from {', '.join(others)}")
    for group in ladder_twins(ladder):
        click.echo("\n".join(group.lines))
    click.echo(f"verdict: {conclusion(ladder, left, only_words(ladder))}")
    for one in ladder.worsened:
        click.echo(f"beware: {one.text}")
    if ladder.unknown is not None:
        click.echo(ladder.unknown.text)
    for line in remainder_lines(ladder.verdict, left):
        click.echo(line)
    over = ", ".join(f"{one.name} (p {p_text(one.p_value)})" for one in also_significant(ladder))
    if over and ladder.verdict == "missing":
        click.echo(f"significant as well: {over}")
    for name, why in ladder.passed_over.items():
        click.echo(f"significant on the fitted data, yet not added: {name}: {why}")
    hidden = unshown(ladder)
    if hidden:
        lacking = ["what is still missing"] if ladder.verdict == "missing" else []
        click.echo(f"{basis(lacking)}this data cannot show: {', '.join(hidden)}")
    suggested = ladder.suggested_experiment
    if suggested is not None:
        click.echo(f"next experiment: {suggested['text']}")
        for outcome in suggested["outcomes"]:
            click.echo(f"  {outcome['text']}")


def print_parameters(ladder: Ladder) -> None:
    """Print the last model's parameters: those of a step are biased by what was still missing then."""
    from idloop.estimation.statistics.interval_text import interval_text
    from idloop.reporting.estimates import held_parameters, parameter_estimates, read_off_parameters

    rows = [
        (
            name,
            number(one["value"], 6),
            "not determined" if None in one["interval"] else interval_text(*one["interval"]),
            f"{one['unit']}{'  at its bound' if one['at_bound'] else ''}",
        )
        for name, one in parameter_estimates(ladder.model).items()
    ]
    if rows:
        click.echo("\nparameters of the last model, all refitted:")
        click.echo(format_table(("parameter", "value", "95 % interval", "unit"), rows))
    for name, one in read_off_parameters(ladder).items():
        click.echo(f"read off the readings: {name} {number(one.value, 6)} {one.unit}")
    held = [f"{name} {number(one.value)} {one.unit}".rstrip(" -") for name, one in held_parameters(ladder).items()]
    if held:
        click.echo(f"held, not estimated: {', '.join(held)}")
