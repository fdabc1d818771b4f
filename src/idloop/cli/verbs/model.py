"""`idloop model`: prints a preset, or a model file checked and written out whole."""

from __future__ import annotations

import click

from idloop.cli import _inputs, _outputs


def list_presets(*, as_json: bool) -> None:
    """Print name, description and size of every preset."""
    from idloop.physics import load_model, preset_names

    models = {name: load_model(name) for name in preset_names()}
    document = [{"name": one.name, "description": one.description} for one in models.values()]
    rows = [(name, " ".join(one.description.split())) for name, one in models.items()]
    _outputs.print_rows(["preset", "what it is"], rows, document, as_json=as_json)


@click.command()
@click.argument("model", required=False)
@click.option("--list", "show_list", is_flag=True, help="List the presets.")
@_inputs.model_options
@_outputs.json_option
def command(model: str | None, *, show_list: bool, as_json: bool) -> None:
    """Print MODEL, a preset or a file, as a whole model file.

    Redirect it to start a model of your own: idloop model dc_motor > mine.yaml
    """
    if show_list or model is None:
        list_presets(as_json=as_json)
        return
    from idloop.physics import preset_names
    from idloop.physics.model_file import PRESETS, to_mapping

    loaded = _inputs.open_model(model)
    checked = _inputs.with_options(loaded)
    if as_json:
        _outputs.print_json(to_mapping(checked))
    elif model in preset_names() and checked is loaded:
        # As written, with the comments that say where its numbers come from.
        click.echo((PRESETS / f"{model}.yaml").read_text(encoding="utf-8"), nl=False)
    else:
        click.echo(checked.to_yaml(), nl=False)
