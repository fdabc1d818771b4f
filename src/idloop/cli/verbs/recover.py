"""`idloop recover`: what can be saved of a recording that was cut off by a crash."""

from __future__ import annotations

from pathlib import Path

import click

from idloop.cli import _inputs, _outputs
from idloop.output_files import probe_folder


@click.command("recover")
@click.argument("bag", type=_inputs.BAG, metavar="BAG")
@click.argument("target", type=_outputs.NEW_FOLDER, metavar="[NEW_BAG]", required=False)
@_outputs.json_option
def command(bag: Path, target: Path | None, *, as_json: bool) -> None:
    """Copy every readable message of the recording BAG into NEW_BAG (default: BAG_recovered).

    For recordings whose recorder was killed or whose disk was full: mcap and sqlite3 of ROS 2, .bag of ROS 1, also
    packed by zstd. NEW_BAG is read back before anything is said about it. BAG stays as it is.
    """
    from idloop.records.bags.recover import recover_bag
    from idloop.records.bags.storage.storage_files import RECOVERED, bag_name

    place = target or probe_folder(bag.with_name(f"{bag_name(bag)}{RECOVERED}"), "NEW_BAG", new=True, parents=True)
    result = recover_bag(bag, place)
    counts = [(topic, str(count)) for topic, count in result.topics.items()]
    _outputs.print_rows(["topic", "messages"], counts, {"schema": "idloop/recover/1", **vars(result)}, as_json=as_json)
    if not as_json:
        click.echo(f"{result.bag}: {result.messages} messages over {result.duration:.6g} s; {result.state}")
