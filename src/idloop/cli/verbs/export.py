"""`idloop export`: what was identified, in the formats of a robot's stack."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from idloop.cli import _inputs, _outputs
from idloop.errors import InputError
from idloop.output_files import make_folder, probe_file, probe_folder, write_text

if TYPE_CHECKING:
    from idloop.exporters import Exported
    from idloop.physics import Model

SCHEMA = "idloop/export/1"
EXAMPLE = """\b
Formats:
  urdf          <joint> with damping, friction and limits
  mujoco        MJCF of the axis, ready to load
  usd           joint of UsdPhysics and PhysX, with the drive of a servo
  control       A, B, C, D of the linear part for python-control, as JSON
  ros2_control  parameters of a controller with the model's gains
  compensator   a model file with what the controller node can cancel
  c             header of C99 with the command that a motion needs
  ranges        intervals as ranges for domain randomisation
  json          every number with its unit and its standard error
\b
Examples:
  idloop export axis --format urdf
  idloop export fitted.yaml --format mujoco --output axis.xml
  idloop export fitted.yaml --output for_the_robot
"""


@click.command(epilog=EXAMPLE)
@_inputs.model_argument
@click.option("--format", "forms", multiple=True, metavar="NAME", help="One of those below; may be repeated.")
@click.option(
    "--output",
    type=click.Path(path_type=Path),
    metavar="PATH",
    help="File to write; for several formats a folder, which is made.",
)
@_outputs.force_option("Overwrite what is there.")
@_inputs.model_options
@_outputs.json_option
def command(model: Model, *, forms: tuple[str, ...], output: Path | None, as_json: bool) -> None:
    """Write MODEL in other tools' formats: the one named, or all that can hold it.

    What a format cannot carry is said in the file and, line by line, on stderr.
    """
    several = len(dict.fromkeys(forms)) != 1  # what --output is follows from the number of formats
    if output is not None and not several:
        probe_file(output, "--output", overwrite=_outputs.forced())
    elif output is not None and output.exists() and not output.is_dir():
        raise InputError(f"--output {output}: several formats need a folder, and this is a file")
    elif output is not None:
        probe_folder(output, "--output", parents=True)
    chosen = _inputs.with_options(model)
    files = _write_all(chosen, forms)
    if output is None and len(files) > 1 and not as_json:
        raise InputError("--output is missing: several formats need a folder; or name one --format")
    paths = [output / file.file_name if several and output is not None else output for file in files]
    # All are probed before the first is written.
    for path in paths if several and output is not None and output.is_dir() else ():
        if path is not None:
            probe_file(path, "--output", overwrite=_outputs.forced())
    for file, path in zip(files, paths, strict=True):
        for line in file.left_out:
            _outputs.log(f"{file.format}: not carried: {line}")
        if path is not None:
            make_folder(path.parent, parents=True)
            write_text(path, file.text)
            _outputs.log_written(path)
    if as_json:
        listed = [
            {"format": f.format, "path": path, "text": f.text, "left_out": f.left_out}
            for f, path in zip(files, paths, strict=True)
        ]
        _outputs.print_json({"schema": SCHEMA, "model": chosen.name, "files": listed})
    elif output is None:
        click.echo(files[0].text, nl=False)


def _write_all(model: Model, forms: tuple[str, ...]) -> list[Exported]:
    from idloop.exporters import FORMATS, export

    if forms:
        return [export(model, form) for form in dict.fromkeys(forms)]
    files = []
    for form in FORMATS:
        try:
            files.append(export(model, form))
        except InputError as error:
            _outputs.log(f"{form}: left out: {error}")
    return files
