"""`idloop refine`: diagnose, add, refit, until nothing significant is left; the ladder."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from idloop.cli._command_line import command_line
from idloop.cli._common import (
    BAG,
    ModelArgument,
    apply_options,
    json_option,
    log,
    log_grades,
    model_options,
    print_blocks,
    print_json,
    read_fitted_and_unseen,
)
from idloop.cli._diagnosis import DiagnosisCommand, diagnosis_options, limit_options, read_limits
from idloop.cli._places import OUTPUT_FOLDER, force_option
from idloop.cli._progress import part, progress, quiet_option
from idloop.errors import IdloopError, InputError
from idloop.reporting.ladder_folder import FILES, Kept, check_target, read_ladder, write_all, write_ladder

if TYPE_CHECKING:
    from idloop.diagnosis import Ladder
    from idloop.diagnosis.design.suggest import Limits
    from idloop.physics import Model
    from idloop.records import Record
    from idloop.reporting.next_experiment import Next
    from idloop.reporting.residual_findings import ResidualFinding

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
    from idloop.api.ladder import Ladder as Result
    from idloop.reporting.detectability import undetectable
    from idloop.reporting.residual_findings import findings_on_records, residual_findings
    from idloop.reporting.terms import FITTED
    from idloop.reporting.text.ladder import ladder_blocks, parameter_blocks

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
    if not undo:
        with keep.on_interrupt():
            log_grades((*bags, *unseen), model, (*records, *validation))
    with keep.on_interrupt(), progress(f"refining {model.name}") as update:
        climbing = update if no_suggest else part(update, 0.0, 0.7)
        if undo and add is None and kept is not None:
            ladder = kept.ladder
        else:
            before = kept.ladder if kept is not None else None
            ladder = _climb(
                model, before, (records, validation), add, keep.step,
                level=level, criterion=criterion, minimum_improvement=0.01 * minimum_improvement,
                effects=only or None, most=most, seed=seed, progress=climbing,
            )  # fmt: skip
        # What was found after all, or ties with it, is not what the data cannot show.
        ladder = replace(ladder, untestable=tuple(undetectable(ladder)))
        keep(ladder)
        if not no_suggest and not (undo and add is None):
            answer = _next(ladder, records, limits, duration, seed, part(update, 0.7, 1.0))
            planned = None if answer is None or answer.suggestion is None else answer.suggestion.to_dict()
            ladder = replace(ladder, suggested_experiment=planned)
    left: Sequence[ResidualFinding] = ()
    unjudged: IdloopError | None = None
    try:
        if target is not None:
            with keep.on_interrupt(), progress("writing the report") as update:
                suggestion = None if answer is None else answer.suggestion
                contents = write_all(target, as_kept(ladder), records, validation, suggestion, part(update, 0.0, 0.8))
            left = residual_findings(judged.rows[-1][1] for judged in contents.judged if judged.use == FITTED)
        else:
            left = findings_on_records(ladder.model, records)
    except InputError:
        raise
    except IdloopError as error:
        # A model that runs away cannot be compared with anything; what was found is printed all the same.
        unjudged = error
    if as_json:
        result = Result(ladder, tuple(records), tuple(validation), tuple(left))
        print_json({**result.to_dict(), "output": target, "taken_back": taken_back[-1]["steps"] if undo else []})
        if unjudged is not None:
            raise unjudged
        return
    if undo:
        kept_in = "" if target is None else f" (kept in {target / 'ladder.json'}, taken_back)"
        click.echo(f"taken back: {', '.join(taken_back[-1]['steps'])}{kept_in}")
    futile = [f"next experiment: none; {answer.reason}"] if answer is not None and answer.futile else []
    print_blocks([*ladder_blocks(ladder, left), *futile, *parameter_blocks(ladder)])
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
    def on_interrupt(self) -> Iterator[None]:
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


def _climb(
    model: Model,
    ladder: Ladder | None,
    records: tuple[Sequence[Record], Sequence[Record]],
    add: str | None,
    keep: Callable[[Ladder], None],
    **options: Any,
) -> Ladder:
    """Add what the user names, then what is missing; `records`: what is fitted, and what judges."""
    from idloop.diagnosis import add_effect, refine

    fitted, unseen = records
    if add is not None:
        common: dict[str, Any] = {name: options[name] for name in ("seed", "progress")}
        if ladder is None:
            level, criterion = options["level"], options["criterion"]
            ladder = refine(model, fitted, unseen, level=level, criterion=criterion, most=0, **common)
        ladder = add_effect(ladder, add, fitted, unseen, **common)
        keep(ladder)
    return refine(model, fitted, unseen, ladder=ladder, on_step=keep, **options)


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
    from idloop.reporting.next_experiment import next_of_ladder

    tied = any(ladder.rivals(step) for step in ladder.steps)
    wider = any(limit is not None for limit in limits.to_dict().values())
    if not tied and not wider and ladder.verdict != "not_excited":
        return None
    try:
        return next_of_ladder(ladder, records, limits, {"duration": duration, "seed": seed, "progress": update})
    except IdloopError as error:
        log(f"no experiment can be suggested: {error}")
        return None
