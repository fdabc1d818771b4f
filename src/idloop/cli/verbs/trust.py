"""`idloop trust`: says once for each folder of effects that its Python files may run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from idloop.cli import _outputs
from idloop.errors import InputError
from idloop.spelling import listed

SCHEMA = "idloop/trust/1"


def effects_of(place: Path) -> Path:
    """Folder of effects that a place names: itself, the one in it, or the one beside a model file."""
    inside = (place.parent if place.is_file() else place) / "effects"
    return inside if inside.is_dir() else place


@click.command("trust")
@click.argument("place", type=click.Path(path_type=Path), metavar="[FOLDER_OR_MODEL]", required=False)
@click.option("--list", "show_list", is_flag=True, help="List the folders that are trusted.")
@click.option("--revoke", is_flag=True, help="Trust the folder no longer.")
@_outputs.json_option
def command(place: Path | None, *, show_list: bool, revoke: bool, as_json: bool) -> None:
    """Let the Python files of a folder of effects run when a model is opened.

    Reading a model file runs the effects in the folder `effects` beside it, so look at them first. FOLDER_OR_MODEL is
    that folder, the one that holds it, or the model file. A file that is changed, added or removed asks again.
    """
    from idloop.physics import trust

    if show_list == (place is not None) or (show_list and revoke):
        raise InputError("name one folder or model file, as in `idloop trust effects`, or give --list alone")
    if place is None:
        folders = trust.trusted_folders()
        rows = [(str(one.folder), one.state) for one in folders]
        if as_json or rows:
            document = {"schema": SCHEMA, "folders": list(map(vars, folders))}
            _outputs.print_rows(["folder", "state"], rows, document, as_json=as_json)
        else:
            click.echo("no folder is trusted")
        return
    folder = effects_of(place)
    if revoke:
        trust.revoke(folder)
        state: dict[str, Any] = {"folder": folder.resolve(), "trusted": False}
        line = f"{folder.resolve()}: not trusted any more"
    else:
        files = trust.read_effect_files(folder)
        if not files.effects:
            raise InputError(f"{folder}: no folder with Python files, and none is beside it; check the path")
        trust.trust(files)
        state = {"folder": files.folder, "trusted": True, "files": sorted(files.sources)}
        line = f"{files.folder}: {listed(sorted(files.sources))} may run; whatever changes asks again"
    _outputs.print_either(lambda: [line], {"schema": SCHEMA, **state} if as_json else None)
