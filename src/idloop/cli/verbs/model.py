"""`idloop model`: prints a preset, or a model file checked and written out whole."""

from __future__ import annotations

import click

from idloop.cli._common import apply_options, json_option, model_options, open_model, print_json, print_table


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


def preset_text(name: str) -> str:
    """Text of a preset's file."""
    from idloop.physics.model_file import PRESETS

    return (PRESETS / f"{name}.yaml").read_text(encoding="utf-8")


@click.command()
@click.argument("model", required=False)
@click.option("--list", "show_list", is_flag=True, help="List the presets.")
@model_options
@json_option
def command(
    model: str | None, *, show_list: bool, settings: tuple[str, ...], effects: tuple[str, ...], as_json: bool
) -> None:
    """Print MODEL, a preset or a file, as a whole model file.

    Redirect it to start a model of your own: idloop model dc_motor > mine.yaml
    """
    if show_list or model is None:
        list_presets(as_json=as_json)
        return
    from idloop.physics import preset_names

    checked = apply_options(open_model(model), settings, effects)
    if as_json:
        from idloop.physics.model_file import to_mapping

        print_json(to_mapping(checked))
    elif model in preset_names() and not settings and not effects:
        # As written, with the comments that say where its numbers come from.
        click.echo(preset_text(model), nl=False)
    else:
        click.echo(checked.to_yaml(), nl=False)
