"""`idloop suggest`: the next experiment, the one that best separates what the data so far leave open."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from idloop.api.data import existing_bag
from idloop.cli import _inputs, _outputs
from idloop.cli._progress import progress
from idloop.errors import InputError

if TYPE_CHECKING:
    from idloop.api.ladder import Ladder
    from idloop.physics import Model
    from idloop.records import Record

EXAMPLE = """\b
Examples:
  idloop suggest dc_motor bags/train --max-command 3 --output next.yaml
  idloop suggest --between dead_zone.yaml friction.yaml bags/train --plot next.png
  idloop suggest --ladder runs/refined --position-range -3 3
  idloop suggest fitted.yaml bags/train --show imbalance@motor --position-range -7 7
\b
Run it: the excitation node takes the file as its parameter `experiment`, then call its service
~/run_experiment.
"""


@click.command(cls=_inputs.lists("--also"), epilog=EXAMPLE)
@click.argument("sources", nargs=-1, metavar="[MODEL...] BAG")
@click.option("--between", nargs=2, metavar="MODEL MODEL", help="Two rival models; the same as naming two MODELs.")
@click.option(
    "--ladder",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Settle what a ladder of idloop refine left open; BAG may be left out.",
)
@click.option("--show", metavar="EFFECT@SITE", help="Make this effect visible, which the data so far do not show.")
@click.option("--also", type=_inputs.BAG, multiple=True, metavar="BAG...", help="More of the data so far.")
@_inputs.limit_options
@click.option("--start", type=float, metavar="POSITION", help="Where the axis will rest before.")
@click.option("--no-fit", is_flag=True, help="Take rival models as they are instead of fitting them first.")
@_inputs.criterion_option
@_inputs.seed_option
@_inputs.trust_option
@_outputs.output_option("NEXT.yaml", "Write the experiment.")
@_outputs.drawn_work_options
def command(
    sources: tuple[str, ...],
    *,
    between: tuple[str, str] | None,
    ladder: Path | None,
    show: str | None,
    also: tuple[Path, ...],
    no_fit: bool,
    output: Path | None,
    plot: Path | None,
    as_json: bool,
    **options: Any,
) -> None:
    """Choose the experiment that best separates rival models of the data in BAG, within limits.

    With several MODELs these are the rivals, each fitted to BAG first. With one, it is diagnosed, and the effects
    that tie are the rivals; where none tie, effects that the data cannot show are asked for. Limits that are not
    given are the largest command and motion in the data. The figure of --plot shows what is sent in, what each rival
    would show, and by how much they differ beside the noise. Of effects that are one equation, which no motion can tell
    apart, a check by hand is named instead; an experiment that is expected to say nothing is not written.

    Data with a recorded reference come from a closed loop: the experiment is a reference then, and MODEL must have the
    section `controller` that says which law ran.
    """
    names, bags = _split(sources, between, ladder, show)
    from idloop.api.suggestion import suggest

    subject: Ladder | list[Model]
    with progress("choosing an experiment") as update:
        if ladder is not None:
            subject, records = _ladder_and_records(ladder, bags, also)
        else:
            subject = [_inputs.open_model(name) for name in names]
            records = _inputs.read_records([*bags, *also], subject[0])
        found = suggest(subject, records, show=show, fitted=no_fit, progress=update, **options)
    if found.experiment is None:
        for option, place in (("--output", output), ("--plot", plot)):
            if place is not None:
                _outputs.log(f"{option} {place}: not written, there is no experiment that is worth running")
        output = plot = None
    _outputs.deliver(found, as_json=as_json, output=output, plot=plot)


def _split(
    sources: Sequence[str], between: tuple[str, str] | None, ladder: Path | None, show: str | None
) -> tuple[list[str], list[Path]]:
    """Models and bags of the command line; the last word is the bag."""
    if ladder is not None and between:
        raise InputError("--ladder has its own rivals: leave --between out")
    if ladder is not None and show is not None:
        raise InputError("--ladder asks for what it left open itself: leave --show out, or name MODEL")
    if ladder is not None:
        return [], [existing_bag(source) for source in sources]
    if not sources:
        raise InputError("BAG is missing: name the recording that the models are to explain")
    names = [*(between or ()), *sources[:-1]]
    if not names:
        raise InputError(f"MODEL is missing: write idloop suggest MODEL {sources[-1]}, or --between two models")
    if len(names) > 1 and show is not None:
        raise InputError("--show takes one MODEL: the rivals are that model with and without the effect")
    return names, [existing_bag(sources[-1])]


def _ladder_and_records(folder: Path, bags: Sequence[Path], also: Sequence[Path]) -> tuple[Ladder, list[Record]]:
    """Ladder of a folder, and its records: from its own bags or those given, and from more of them."""
    from idloop.api.ladder import Ladder
    from idloop.reporting.ladder_folder import read_ladder

    kept = read_ladder(folder)
    chosen = [*(bags or kept.bags), *also]
    if not chosen:
        raise InputError(f"{folder}: its bags are not known any more; name BAG")
    records = _inputs.read_records(chosen, kept.ladder.model)
    return Ladder(kept.ladder, tuple(records)), records
