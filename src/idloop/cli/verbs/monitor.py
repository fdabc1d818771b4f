"""`idloop monitor`: says when friction, play or another effect of a fitted model grows."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from idloop.cli._common import (
    BAG,
    MODEL,
    ListOptionCommand,
    apply_options,
    json_option,
    log_written,
    model_options,
    plot_option,
    print_found,
    read_records,
    save_plot,
)
from idloop.cli._progress import part, progress, quiet_option
from idloop.errors import InputError

if TYPE_CHECKING:
    from idloop.physics import Model
    from idloop.records import Record

LEARN = 600.0  # [s]


class MonitorCommand(ListOptionCommand):
    """`--reference A B C`, `--watch X Y` and `--vary X Y` take several values at once."""

    list_options = ("--reference", "--watch", "--vary")


EXAMPLE = """\b
Example:
  idloop monitor fitted.yaml bags/monday bags/tuesday --reference bags/new \\
    --watch coulomb_friction@motor=20% --false-alarms 'per 1000 h' --plot wear.png
"""


@click.command(cls=MonitorCommand, epilog=EXAMPLE)
@click.argument("model", type=MODEL)
@click.argument("bags", type=BAG, nargs=-1, required=True, metavar="BAG...")
@click.option(
    "--watch",
    "texts",
    multiple=True,
    metavar="EFFECT@SITE[.PARAMETER][=GROWTH]",
    help="What may grow, and the growth to be noticed: 20% (the default) or a number in the parameter's unit. "
    "Without it dry friction and what sits in couplings, as far as the model has them.",
)
@click.option("--reference", type=BAG, multiple=True, metavar="BAG...", help="Bags of the healthy machine.")
@click.option(
    "--learn",
    type=click.FloatRange(min=0.0, min_open=True),
    metavar="SECONDS",
    help=f"Without --reference: so much of the first bag is healthy [{LEARN:g} s, at most half of it].",
)
@click.option(
    "--false-alarms",
    default="per 1000 h",
    show_default=True,
    metavar="'per TIME'",
    help="One false alarm of all that is watched in so much time of running (s, min, h, days, weeks, years).",
)
@click.option(
    "--vary",
    multiple=True,
    metavar="PARAMETER",
    help="A parameter that may change without being wear, beside viscous friction. May be repeated.",
)
@click.option(
    "--block",
    type=click.FloatRange(min=0.0, min_open=True),
    default=2.0,
    show_default=True,
    metavar="SECONDS",
    help="Length of the blocks that are judged.",
)
@model_options
@plot_option
@quiet_option
@json_option
def command(
    model: Model,
    bags: tuple[Path, ...],
    *,
    texts: tuple[str, ...],
    reference: tuple[Path, ...],
    learn: float | None,
    false_alarms: str,
    vary: tuple[str, ...],
    block: float,
    settings: tuple[str, ...],
    effects: tuple[str, ...],
    plot: Path | None,
    as_json: bool,
) -> None:
    """Watch an effect of MODEL grow through every BAG, in the order given.

    MODEL is a model that was fitted to the machine when it was healthy.
    """
    from idloop import Monitor, monitoring

    if reference and learn is not None:
        raise InputError("--learn takes the healthy time from the first bag, --reference has it already: use one")
    # What is refused here needs no bag.
    monitoring.parse_false_alarms(false_alarms)
    model = apply_options(model, settings, effects)
    monitoring.choose_watches(model, texts)
    records = read_records(bags, model, fitted=False)
    healthy = read_records(reference, model)
    if not healthy:
        first, records[0] = split(records[0], learn)
        healthy = [first]
    with progress(f"watching {model.name}") as update:
        watching = Monitor.learn(
            model, healthy, texts, vary=vary, false_alarms=false_alarms, block=block, progress=part(update, 0.0, 0.5)
        )
        for done, record in enumerate(records):
            update(0.5 + 0.5 * done / len(records), record.name)
            watching.follow(record)
    save_plot(watching.plot, plot)
    print_found(watching, as_json=as_json, plot=plot)
    log_written(plot)


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
