"""`idloop inspect`: what is wrong with recordings, what is in them, and what they can show."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import click

from idloop.cli import _outputs
from idloop.errors import InputError


@click.command()
@click.argument("bags", metavar="BAG...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--command", "command_topic", metavar="TOPIC", help="Topic of the command, when it is not joint_command.")
@click.option("--distro", metavar="NAME", help="ROS distribution of types that the bag does not define.")
@_outputs.plot_option
@_outputs.json_option
def command(
    bags: tuple[Path, ...], *, command_topic: str | None, distro: str | None, plot: Path | None, as_json: bool
) -> None:
    """Show what is wrong with each BAG, what it holds, and what can be learnt from it.

    Several bags are compared as well: joints, units, sample times and gains.
    """
    from idloop.api.inspection import inspect_bag
    from idloop.records import compare_inspections
    from idloop.records.inspection.together import judged_together
    from idloop.reporting.text.inspection import comparison_blocks, inspection_blocks

    if plot is not None and len(bags) > 1:
        raise InputError(f"--plot draws one bag, not {len(bags)}; give one")
    found = [inspect_bag(bag, command=command_topic, distro=distro) for bag in bags]
    if plot is not None:
        from idloop.reporting.plots.recording import plot_recording

        _outputs.save_plot(lambda: plot_recording(found[0]), plot)
    if len(found) == 1:
        _outputs.print_either(partial(inspection_blocks, found[0]), found[0].to_dict() if as_json else None)
        return
    between, found = compare_inspections(found), list(judged_together(found))
    records = {"bags": [one.to_dict() for one in found], "between": [one.to_dict() for one in between]}
    document = {"schema": "idloop/inspections/1", **records}
    _outputs.print_either(partial(comparison_blocks, found, between), document if as_json else None)
