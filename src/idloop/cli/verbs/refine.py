"""`idloop refine`: diagnose, add, refit, until nothing significant is left; the ladder."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from idloop.api.data import existing_bag
from idloop.api.result import Progress, part
from idloop.cli import _inputs, _outputs
from idloop.cli._command_line import command_line
from idloop.cli._progress import progress
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


@click.command(cls=_inputs.lists("--validate", "--effects"), epilog=EXAMPLE)
@click.argument("sources", nargs=-1, metavar="[MODEL] BAG...")
@_inputs.validate_option
@_inputs.diagnosis_options
@_inputs.model_options
@_inputs.option("--most", type=click.IntRange(min=0), default=8, help="Most effects in the ladder.")
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
@_inputs.limit_options
@click.option("--no-suggest", is_flag=True, help="Do not work out the next experiment for what stays open.")
@_outputs.output_folder_option(f"Write {', '.join(FILES)} (default with --resume: that folder).")
@_outputs.work_options
def command(
    sources: tuple[str, ...],
    *,
    validate: tuple[Path, ...],
    most: int,
    resume: Path | None,
    undo: int,
    add: str | None,
    no_suggest: bool,
    output: Path | None,
    as_json: bool,
    **options: Any,
) -> None:
    """Add the effects that MODEL lacks one by one, until nothing significant is left in the BAGs.

    Every step is fitted to the BAGs and judged on those of --validate. The ladder ends at an adequate model, at a
    residual that no effect explains, or where the data cannot tell; effects that tie are reported together, and
    the experiment that would separate them is worked out, within the limits given or seen in the data.
    """
    from idloop.api.ladder import Ladder as Result
    from idloop.reporting.residual_findings import findings_on_records, residual_findings
    from idloop.reporting.terms import FITTED
    from idloop.reporting.text.diagnosis import ladder_blocks, parameter_blocks
    from idloop.reporting.verdicts import undetectable

    if undo and resume is None:
        raise InputError("--undo takes back the last step of a ladder: add --resume DIR")
    target = output if output is not None else resume
    if target is not None:
        own = resume is not None and target.resolve() == resume.resolve()
        check_target(target, "--output" if output is not None else "--resume", overwrite=_outputs.forced() or own)
    search, limits = _inputs.search_options(options), _inputs.limits_of(options)
    kept = read_ladder(resume) if resume is not None else None
    if undo and kept is not None and resume is not None:
        kept = kept.without_last(undo, resume)
    model, bags = _sources(sources, kept)
    unseen = validate or (kept.validate if kept is not None else ())
    records, validation = _inputs.read_fitted_and_unseen(bags, unseen, model)
    folder, before = (model.folder, None) if kept is None else (kept.folder, kept.ladder)
    taken_back = kept.taken_back if kept is not None else ()
    origin = _origin(bags, unseen, kept, search["seed"]) if target is not None else {}
    as_kept = partial(
        Kept, bags=tuple(bags), validate=tuple(unseen), folder=folder, provenance=origin, taken_back=taken_back
    )
    undecided = search["criterion"] == _AUTO and (before is None or before.criterion == _AUTO)
    keep = _Keeper(target, as_kept, undecided=undecided)
    only_undo = bool(undo) and add is None and kept is not None
    answer: Next | None = None
    with keep.on_interrupt():
        if not undo:
            _inputs.log_grades((*bags, *unseen), model, (*records, *validation))
        with progress(f"refining {model.name}") as update:
            if only_undo and before is not None:
                ladder = before
            else:
                climbing = update if no_suggest else part(update, 0.0, 0.7)
                both = records, validation
                ladder = _climb(model, before, both, add, keep.step, most=most, progress=climbing, **search)
            # What was found after all, or ties with it, is not what the data cannot show.
            ladder = replace(ladder, untestable=tuple(undetectable(ladder)))
            keep(ladder)
            if not (no_suggest or only_undo):
                answer = _next(ladder, records, limits, options["duration"], search["seed"], part(update, 0.7, 1.0))
                planned = None if answer is None else answer.suggestion
                ladder = replace(ladder, suggested_experiment=None if planned is None else planned.to_dict())
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
    steps = taken_back[-1]["steps"] if undo else []
    if as_json:
        result = Result(ladder, tuple(records), tuple(validation), tuple(left))
        _outputs.print_json({**result.to_dict(), "output": target, "taken_back": steps})
    else:
        if undo:
            kept_in = "" if target is None else f" (kept in {target / 'ladder.json'}, taken_back)"
            click.echo(f"taken back: {', '.join(steps)}{kept_in}")
        futile = [f"next experiment: none; {answer.reason}"] if answer is not None and answer.futile else []
        _outputs.print_blocks([*ladder_blocks(ladder, left), *futile, *parameter_blocks(ladder)])
    if unjudged is not None:
        raise unjudged
    if not as_json:
        _outputs.log_written(target)


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
    words = list(sources)
    if kept is None:
        if len(words) < 2:
            missing = "MODEL and BAG are" if not words else "BAG is"
            raise InputError(f"{missing} missing: write idloop refine MODEL BAG..., or --resume DIR")
        model = _inputs.open_model(words[0])
        bags = [existing_bag(word) for word in words[1:]]
        return _inputs.with_options(model), bags
    if words and (not Path(words[0]).exists() or Path(words[0]).suffix in {".yaml", ".yml"}):
        # The model of a ladder is its own; naming it again does no harm.
        _inputs.open_model(words.pop(0))
    bags = [existing_bag(word) for word in words or kept.bags]
    if not bags:
        raise InputError("BAG is missing: the ladder does not know what it was climbed on")
    return kept.ladder.model, bags


def _next(
    ladder: Ladder, records: Sequence[Record], limits: Limits, duration: float | None, seed: int, update: Progress
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
        _outputs.log(f"no experiment can be suggested: {error}")
        return None
