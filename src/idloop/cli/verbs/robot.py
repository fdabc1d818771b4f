"""`idloop robot`: a whole robot from its URDF and its bags, and the trajectory that shows most of it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from idloop.cli import _inputs, _outputs
from idloop.cli._progress import progress
from idloop.errors import InputError

EXAMPLE = """\b
Examples:
  idloop robot arm.urdf bags/arm1 bags/arm2 --validate bags/arm3 --output runs/arm
  idloop robot arm.urdf bags/arm1 --payload bags/with_tool
  idloop robot excite arm.urdf --output trajectory.yaml    (idloop robot excite --help)
"""
EXCITE_EXAMPLE = """\b
Examples:
  idloop robot excite arm.urdf --output trajectory.yaml
  idloop robot excite arm.urdf --share 0.5 --max-acceleration 4 --output trajectory.csv
"""
EXCITE = "excite"


class RobotCommand(_inputs.ListOptionCommand):
    """`excite` as the first word is a command of its own."""

    list_options = ("--validate", "--payload")

    def make_context(
        self, info_name: str | None, args: list[str], parent: click.Context | None = None, **extra: Any
    ) -> click.Context:
        """Hand the line over to `excite` where that is its first word."""
        if args and args[0] == EXCITE:
            return excite.make_context(f"{info_name} {EXCITE}", args[1:], parent, **extra)
        return super().make_context(info_name, args, parent, **extra)


@click.command(EXCITE, epilog=EXCITE_EXAMPLE)
@click.argument("urdf", type=click.Path(path_type=Path), metavar="URDF")
@_inputs.option("--period", type=_inputs.POSITIVE, default=10.0, metavar="SECONDS")
@_inputs.option("--periods", type=click.IntRange(min=1), default=2, help="How often it is repeated.")
@_inputs.option("--harmonics", type=click.IntRange(min=2), default=5, help="Sines of each joint.")
@_inputs.option("--share", type=float, default=0.8, help="Part of every limit of the URDF to use.")
@click.option("--max-acceleration", type=_inputs.POSITIVE, help="Of every joint [rad/s² or m/s²].")
@_inputs.option("--distance", type=float, default=0.03, help="Least distance between links [m].")
@_inputs.option("--rate", type=click.FloatRange(1.0), default=50.0, help="Points per second.")
@_inputs.option("--steps", type=click.IntRange(min=0), default=20, help="Of the optimiser.")
@_inputs.option("--seed", type=int, default=0, help="Equal seeds give equal answers.")
@_outputs.output_option(
    "FILE",
    "Write the points (.yaml: trajectory_msgs/msg/JointTrajectory; .csv).",
    _outputs.OutputFile((".yaml", ".yml", ".csv")),
)
@_outputs.drawn_work_options
def excite(urdf: Path, *, output: Path | None, plot: Path | None, as_json: bool, **options: Any) -> None:
    """Plan the trajectory that shows most of the parameters of the robot in URDF, within its limits.

    Periodic sums of sines that begin and end at rest, optimised for the base parameters within the limits of position,
    velocity, effort and acceleration, with the links apart from each other. The surroundings of the robot are not
    known: run it slowly first.
    """
    from idloop.api.robot_excitation import excite_robot

    with progress(f"planning for {urdf.stem}") as update:
        found = excite_robot(urdf, **options, progress=update)
    _outputs.deliver(found, as_json=as_json, output=output, plot=plot)


@click.command(cls=RobotCommand, epilog=EXAMPLE)
@click.argument("urdf", type=click.Path(path_type=Path), metavar="URDF")
@_inputs.bags_argument
@_inputs.validate_option
@click.option("--payload", type=_inputs.BAG, multiple=True, metavar="BAG...", help="Bags with a body at the last link.")
@_inputs.option("--topic", default="joint_states", help="Topic of the JointState messages.")
@_inputs.option(
    "--level", type=float, default=0.01, help="Probability of naming an effect at any joint where none is missing."
)
@_inputs.option("--rounds", type=click.IntRange(min=1), default=2, help="Fits of links and joints.")
@_inputs.option("--seed", type=int, default=0, help="Equal seeds give equal answers.")
@click.option("--workers", type=click.IntRange(min=0), help="Processes for the joints (default: one for each core).")
@_outputs.output_folder_option("Write robot.json, robot.urdf, report.html, and the model of each joint.")
@_outputs.drawn_work_options
def command(
    urdf: Path,
    bags: tuple[Path, ...],
    *,
    validate: tuple[Path, ...],
    output: Path | None,
    plot: Path | None,
    as_json: bool,
    **options: Any,
) -> None:
    """Identify the rigid bodies of the robot in URDF and all of its joints, and name what each joint lacks.

    The BAGs hold position and measured effort of the joints (JointState, any order, a joint missing now and then).
    Links, gravity and coupling come from Pinocchio, with base parameters from the data and possible inertias.
    """
    from idloop.api.robot import identify_robot

    if output is not None and (output / "robot.json").exists() and not _outputs.forced():
        raise InputError(f"--output {output}: there is a robot already, name another folder or add --force")
    with progress(f"identifying {urdf.stem}") as update:
        found = identify_robot(urdf, bags, validate, **options, progress=update)
    _outputs.deliver(found, as_json=as_json, output=output, plot=plot)
