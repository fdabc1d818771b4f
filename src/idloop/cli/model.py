"""`idloop model`: prints a preset, or a model file checked and written out whole."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from idloop.cli._common import (
    MODEL,
    apply_options,
    json_option,
    model_options,
    print_json,
    print_table,
)

if TYPE_CHECKING:
    from idloop.physics import Model


def list_presets(*, as_json: bool) -> None:
    """Print name, description and size of every preset."""
    from idloop.physics import load_model, preset_names

    models = [load_model(name) for name in preset_names()]
    if as_json:
        print_json([{"name": model.name, "description": model.description} for model in models])
        return
    print_table(
        ["preset", "what it is"],
        [(name, " ".join(model.description.split())) for name, model in zip(preset_names(), models, strict=True)],
    )


@click.command()
@click.argument("model", type=MODEL, required=False)
@click.option("--list", "show_list", is_flag=True, help="List the presets.")
@model_options
@json_option
def command(
    model: Model | None, *, show_list: bool, settings: tuple[str, ...], effects: tuple[str, ...], as_json: bool
) -> None:
    """Print MODEL, a preset or a file, as a whole model file.

    Redirect it to start a model of your own: idloop model dc_motor > mine.yaml
    """
    if show_list or model is None:
        list_presets(as_json=as_json)
        return
    model = apply_options(model, settings, effects)
    if as_json:
        print_json(model.to_mapping())
    else:
        click.echo(model.to_yaml(), nl=False)
