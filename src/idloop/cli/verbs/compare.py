"""`idloop compare`: measured against one or several models."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from idloop.cli import _inputs, _outputs
from idloop.cli._progress import progress
from idloop.errors import InputError

if TYPE_CHECKING:
    from idloop.physics import Model


def label_models(sources: Sequence[str], models: Sequence[Model]) -> list[str]:
    """Name of each model, or its file where names are not unique."""
    names = [model.name for model in models]
    return names if len(set(names)) == len(names) else list(sources)


@click.command()
@click.argument("models", nargs=-1, required=True, metavar="MODEL...")
@click.argument("bag", type=_inputs.BAG)
@_inputs.model_options
@_inputs.option("--steps", type=click.IntRange(min=1), default=10, help="Samples that a prediction looks ahead.")
@_outputs.plot_option
@click.option("--plot-where", type=_outputs.PLOT, metavar="FILE", help="Write the figure of where the models fail.")
@click.option("--all", "everything", is_flag=True, help="Print everything: all tests, regions, variables, stretches.")
@_outputs.work_options
def command(
    models: tuple[str, ...],
    bag: Path,
    *,
    steps: int,
    plot: Path | None,
    plot_where: Path | None,
    everything: bool,
    as_json: bool,
) -> None:
    """Compare what BAG measured with what each MODEL says, its parameters as they are.

    Free run (only the start is fitted), some samples ahead, and the drive force that the measured motion needs;
    then where the error falls: by time, frequency, velocity, position, command, direction, time since a reversal.
    """
    from idloop.api.comparison import compare
    from idloop.api.data import read_bag

    recordings = [source for source in models if (Path(source) / "metadata.yaml").is_file()]
    if recordings and len(recordings) < len(models):
        raise InputError(f"BAG is one recording, the last: {recordings[0]} is one as well; compare them one by one")
    loaded = [_inputs.with_options(_inputs.open_model(source)) for source in models]
    if any(model.output_names != loaded[0].output_names for model in loaded):
        raise InputError(f"the models have different outputs: compare them one by one ({', '.join(models)})")
    records = [read_bag(bag, model) for model in loaded]
    _inputs.log_warnings(records)
    with progress("comparing") as update:
        found = compare(loaded, records, steps=steps, labels=label_models(models, loaded), progress=update)
    _outputs.save_plot(found.plot, plot)
    _outputs.save_plot(found.plot_where, plot_where)
    if as_json:
        _outputs.print_json({**found.to_dict(), "plot": plot, "plot_where": plot_where})
        return
    _outputs.print_blocks(found.blocks(everything=everything))
    if not everything:
        click.echo("\n(--all says everything that stands out, --plot-where draws it)")
