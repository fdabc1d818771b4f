"""`idloop inspect`: topics, stamps, excitation, and what a recording can show."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from idloop.cli._common import json_option, plot_option, print_json, print_table
from idloop.reporting.text.blocks import number

if TYPE_CHECKING:
    from idloop.records import Inspection

_VERDICTS = {
    "usable": "usable for identification",
    "not_excited": "nothing can be identified: no excitation",
    "no_command": "not usable: no command found, nothing can be fitted without one",
    "contradictory": "not usable: a position is constant while its velocity moves",
    "several_runs": "not usable: several runs in one bag, the clock was set back between them",
    "too_short": "nothing can be identified: too few samples",
    "short": "hardly usable: too few samples for reliable estimates",
    "unreadable": "not usable: no signal can be read",
}


def print_inspection(inspection: Inspection) -> None:
    """Print the tables and sentences for a reader."""
    print_table(
        [
            "topic",
            "type",
            "messages",
            "rate Hz",
            "period ms",
            "jitter p50 ms",
            "p99 ms",
            "max ms",
            "lost",
            "stamps",
            "delay p99 ms",
        ],
        [
            (
                topic.name,
                topic.type,
                str(topic.count),
                number(topic.stamps.rate),
                _milli(topic.stamps.period),
                _milli(topic.stamps.jitter["p50"]),
                _milli(topic.stamps.jitter["p99"]),
                _milli(topic.stamps.jitter["max"]),
                str(topic.stamps.lost) if topic.stamps.regular else "-",
                "header" if topic.stamped else "receive",
                _milli(topic.delay.get("p99")),
            )
            for topic in inspection.topics
        ],
    )
    if inspection.commands:
        click.echo()
        print_table(
            [
                "command",
                "min",
                "max",
                "rms about mean",
                "crest",
                "levels",
                "90 % band Hz",
                "sign changes",
                "at limits %",
                "zero %",
            ],
            [
                (
                    _with_unit(name, inspection),
                    number(item.minimum),
                    number(item.maximum),
                    number(item.rms),
                    number(item.crest_factor, 3),
                    "many" if item.levels > 64 else str(item.levels),
                    f"{item.band_hz[0]:.3g} to {item.band_hz[1]:.3g}",
                    str(item.sign_changes),
                    number(100 * item.limit_share, 3),
                    number(100 * item.zero_share, 3),
                )
                for name, item in inspection.commands.items()
            ],
        )
    rows = [
        (
            _with_unit(name, inspection),
            topic,
            number(item.minimum),
            number(item.maximum),
            number(item.resolution, 3),
            "yes" if item.moves else "no",
            str(item.reversals),
        )
        for topic, found in inspection.signals.items()
        for name, item in found.items()
    ]
    if rows:
        click.echo()
        print_table(["measured", "topic", "min", "max", "step", "moves", "reversals"], rows)
    if inspection.conditions:
        click.echo()
        print_table(
            ["condition", "values", "min", "max"],
            [
                (f"{name} [{one.unit or '?'}]", str(one.count), number(one.minimum), number(one.maximum))
                for name, one in inspection.conditions.items()
            ],
        )
    click.echo()
    for finding in inspection.findings:
        click.echo(f"{finding.level}: {finding.text}")
    for sentence in inspection.insights:
        click.echo(f"- {sentence}")
    without = f", without {' and '.join(inspection.left_out)}" if inspection.left_out else ""
    click.echo(f"Verdict: {_VERDICTS[inspection.verdict]}{without}")


def _milli(seconds: float | None) -> str:
    return number(None if seconds is None else 1e3 * seconds, 3)


def _with_unit(name: str, inspection: Inspection) -> str:
    unit = inspection.units.get(name)
    return f"{name} [{unit}]" if unit else name


@click.command()
@click.argument("bag", metavar="BAG", type=click.Path(path_type=Path))
@click.option("--command", "command_topic", metavar="TOPIC", help="Topic of the command, when it is not joint_command.")
@click.option("--distro", metavar="NAME", help="ROS distribution of types that the bag does not define.")
@plot_option
@json_option
def command(bag: Path, *, command_topic: str | None, distro: str | None, plot: Path | None, as_json: bool) -> None:
    """Show what BAG holds, how good its stamps are, and what can be learnt from it."""
    from idloop.records import inspect_bag

    inspection = inspect_bag(bag, command=command_topic, distro=distro)
    if plot is not None:
        from idloop import drawing
        from idloop.reporting.plots.recording import plot_recording

        drawing.save(plot_recording(inspection), plot)
    if as_json:
        print_json(inspection.to_dict())
    else:
        print_inspection(inspection)
