"""`idloop monitor`: says when friction, play or another effect of a fitted model grows."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from idloop.api.result import part
from idloop.cli import _inputs, _outputs
from idloop.cli._progress import progress
from idloop.errors import InputError

if TYPE_CHECKING:
    from idloop.physics import Model
    from idloop.records import Record

LEARN = 600.0  # [s]
EXAMPLE = """\b
Example:
  idloop monitor fitted.yaml bags/monday bags/tuesday --reference bags/new \\
    --watch coulomb_friction@motor=20% --false-alarms 'per 1000 h' --plot wear.png
"""


@click.command(cls=_inputs.lists("--reference", "--watch", "--vary"), epilog=EXAMPLE)
@_inputs.model_argument
@_inputs.bags_argument
@click.option(
    "--watch",
    "texts",
    multiple=True,
    metavar="EFFECT@SITE[.PARAMETER][=GROWTH]",
    help="What may grow, and the growth to be noticed: 20% (the default) or a number in the parameter's unit. "
    "Without it dry friction and what sits in couplings, as far as the model has them.",
)
@click.option("--reference", type=_inputs.BAG, multiple=True, metavar="BAG...", help="Bags of the healthy machine.")
@click.option(
    "--learn",
    type=_inputs.POSITIVE,
    metavar="SECONDS",
    help=f"Without --reference: so much of the first bag is healthy [{LEARN:g} s, at most half of it].",
)
@_inputs.option(
    "--false-alarms",
    default="per 1000 h",
    metavar="'per TIME'",
    help="One false alarm of all that is watched in so much time of running (s, min, h, days, weeks, years).",
)
@click.option(
    "--vary",
    multiple=True,
    metavar="PARAMETER",
    help="A parameter that may change without being wear, beside viscous friction. May be repeated.",
)
@_inputs.option(
    "--block", type=_inputs.POSITIVE, default=2.0, metavar="SECONDS", help="Length of the blocks that are judged."
)
@_inputs.model_options
@_outputs.drawn_work_options
def command(
    model: Model,
    bags: tuple[Path, ...],
    *,
    texts: tuple[str, ...],
    reference: tuple[Path, ...],
    learn: float | None,
    plot: Path | None,
    as_json: bool,
    **options: Any,
) -> None:
    """Watch an effect of MODEL grow through every BAG, in the order given.

    MODEL is a model that was fitted to the machine when it was healthy.
    """
    from idloop import Monitor, monitoring

    if reference and learn is not None:
        raise InputError("--learn takes the healthy time from the first bag, --reference has it already: use one")
    # What is refused here needs no bag.
    monitoring.parse_false_alarms(options["false_alarms"])
    model = _inputs.with_options(model)
    monitoring.choose_watches(model, texts)
    records = _inputs.read_records(bags, model, fitted=False)
    healthy = _inputs.read_records(reference, model)
    if not healthy:
        first, records[0] = split(records[0], learn)
        healthy = [first]
    with progress(f"watching {model.name}") as update:
        watching = Monitor.learn(model, healthy, texts, **options, progress=part(update, 0.0, 0.5))
        for done, record in enumerate(records):
            update(0.5 + 0.5 * done / len(records), record.name)
            watching.follow(record)
    _outputs.deliver(watching, as_json=as_json, plot=plot)


def split(record: Record, learn: float | None) -> tuple[Record, Record]:
    """Healthy start of a record, and the rest.

    Raises InputError: the record is too short to be split there.
    """
    seconds = min(LEARN, 0.5 * record.duration) if learn is None else learn
    if seconds >= record.duration:
        raise InputError(
            f"--learn {seconds:g}: {record.name} is {record.duration:.4g} s long, nothing is left to watch"
        )
    cut = float(record.time[0]) + seconds
    return record.cut(None, cut), record.cut(cut, None)
