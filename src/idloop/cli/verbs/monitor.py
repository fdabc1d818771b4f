"""`idloop monitor`: says when friction, play or another effect of a fitted model grows."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from idloop.cli._common import (
    BAG,
    MODEL,
    ListOptionCommand,
    apply_options,
    json_option,
    log,
    model_options,
    number,
    plot_option,
    print_json,
    print_table,
    read_records,
)
from idloop.cli._progress import progress, quiet_option
from idloop.errors import InputError

if TYPE_CHECKING:
    from idloop.monitoring import Baseline, Monitor, Trace, WatchState
    from idloop.physics import Model
    from idloop.records import Record

LEARN = 600.0  # [s]
MOST_ALARMS = 12  # printed of each record; the JSON document has all


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
    from idloop import monitoring as monitor

    if reference and learn is not None:
        raise InputError("--learn takes the healthy time from the first bag, --reference has it already: use one")
    hours = monitor.parse_false_alarms(false_alarms)
    model = apply_options(model, settings, effects)
    watches = monitor.choose_watches(model, texts)
    records = read_records(bags, model, fitted=False)
    healthy = read_records(reference, model)
    if not healthy:
        first, records[0] = split(records[0], learn)
        healthy = [first]
    with progress(f"watching {model.name}") as update:
        baseline = monitor.learn(
            model,
            healthy,
            watches,
            varying=vary,
            false_alarm_hours=hours,
            block=block,
            progress=lambda share, text: update(0.5 * share, text),
        )
        watching = monitor.Monitor(baseline)
        traces = []
        for done, record in enumerate(records):
            update(0.5 + 0.5 * done / len(records), record.name)
            watching.begin()
            traces.append(watching.follow(record))
    if plot is not None:
        from idloop.drawing import save
        from idloop.reporting.plots.wear import plot_wear

        save(plot_wear(baseline, records, traces), plot)
    if as_json:
        print_json(document(baseline, watching, records, traces, plot))
    else:
        print_watches(baseline, watching, records, traces)
    if plot is not None:
        log(f"written: {plot}")


def split(record: Record, learn: float | None) -> tuple[Record, Record]:
    """Healthy start of a record, and the rest.

    Raises
    ------
    InputError
        The record is too short to be split there.
    """
    seconds = min(LEARN, 0.5 * record.duration) if learn is None else learn
    if seconds >= record.duration:
        raise InputError(
            f"--learn {seconds:g}: {record.name} is {record.duration:.4g} s long, nothing is left to watch"
        )
    cut = float(record.time[0]) + seconds
    return record.cut(None, cut), record.cut(cut, None)


def seconds_of(baseline: Baseline, record: Record, block: int) -> float:
    """End of a block on the record's own clock [s]."""
    return (baseline.end_of(block) - record.start_ns) * 1e-9


def alarm_rows(baseline: Baseline, records: list[Record], traces: list[Trace]) -> list[dict[str, Any]]:
    """Every alarm with the record in which it was raised, in order."""
    rows = []
    for record, trace in zip(records, traces, strict=True):
        start = float(record.time[0])
        first = int(trace.index[0]) if len(trace.index) else 0
        for block, which, alarm in trace.alarms:
            watch = baseline.watches[which]
            rows.append({
                "record": record.name,
                "parameter": watch.parameter,
                "unit": watch.unit,
                "time": seconds_of(baseline, record, block),
                # A sum may have begun to rise in the record before.
                "onset": seconds_of(baseline, record, max(first, alarm.onset) - 1) if alarm.onset <= block else start,
                "growth": alarm.growth,
            })  # fmt: skip
    return rows


def document(
    baseline: Baseline, watching: Monitor, records: list[Record], traces: list[Trace], plot: Path | None
) -> dict[str, Any]:
    """The JSON document."""
    watches = []
    for state, normal in zip(watching.states(), baseline.normal, strict=True):
        fields = dict(vars(state))
        del fields["alarms"]
        reference = {
            "offset": normal.offset,
            "stderr": normal.offset_stderr,
            "spread": normal.spread,
            "echo": normal.echo,
        }
        watches.append({**fields, "reference": reference})
    return {
        "schema": "idloop/monitor/1",
        "model": baseline.model.name,
        "false_alarm_hours": baseline.false_alarm_hours,
        "block": baseline.block,
        "reference_duration": baseline.duration,
        "may_vary": baseline.varying,
        "watches": watches,
        "alarms": alarm_rows(baseline, records, traces),
        "plot": plot,
    }


def print_watches(baseline: Baseline, watching: Monitor, records: list[Record], traces: list[Trace]) -> None:
    """Print what is promised, the state of every watch, and every alarm."""
    vary = ", ".join(baseline.varying) or "nothing"
    click.echo(f"reference: {baseline.duration:.4g} s of the healthy machine; may vary without being wear: {vary}")
    click.echo(f"promised: one false alarm in {baseline.false_alarm_hours:.4g} h of running as in the reference")
    click.echo()
    states = watching.states()
    header = (
        "watched",
        "unit",
        "healthy",
        "noticed",
        "state",
        "newest growth",
        "95 %",
        "delay here s",
        "in reference s",
    )
    print_table(header, [_row(state) for state in states])
    rows = alarm_rows(baseline, records, traces)
    if rows:
        click.echo()
        print_table(
            ("record", "alarm at s", "since s", "watched", "growth by then", "95 %", "unit"),
            [
                (
                    row["record"],
                    f"{row['time']:.1f}",
                    f"{row['onset']:.1f}",
                    row["parameter"],
                    number(row["growth"].value, 3),
                    _interval(row["growth"]),
                    row["unit"],
                )
                for row in rows[:MOST_ALARMS]
            ],
        )
        if len(rows) > MOST_ALARMS:
            click.echo(f"and {len(rows) - MOST_ALARMS} more alarms")
    click.echo()
    for state in states:
        click.echo(_sentence(state))
    for normal in baseline.normal:
        if abs(normal.offset) > max(0.5 * normal.echo * abs(normal.watch.growth), 1.96 * normal.offset_stderr):
            click.echo(
                f"{normal.watch.parameter}: the reference itself differs from the model by "
                f"{normal.offset / normal.echo:.3g} "
                f"{normal.watch.unit}: fit the model to the healthy machine first"
            )


def _row(state: WatchState) -> tuple[str, ...]:
    growth = state.growth
    return (
        state.parameter,
        state.unit,
        number(state.value),
        f"{state.watched:+.3g}",
        state.state.replace("_", " "),
        "-" if growth is None else f"{growth.value:+.3g}",
        "-" if growth is None else _interval(growth),
        number(state.delay, 3),
        number(state.reference_delay, 3),
    )


def _interval(growth: Any) -> str:
    return f"{growth.low:.3g} .. {growth.high:.3g}"


def _sentence(state: WatchState) -> str:
    if state.state == "alarm":
        return f"{state.parameter}: alarm, it has changed in the direction of wear"
    if state.state == "quiet":
        return f"{state.parameter}: no sign of a change of {state.watched:.3g} {state.unit}, which would show"
    return f"{state.parameter}: this data cannot tell; {state.why}"
