"""`idloop replay`: plays a bag into a live estimator, which sees what it saw then."""

from __future__ import annotations

import tempfile
from pathlib import Path

import click

from idloop.cli import _inputs, _outputs
from idloop.reporting.text.blocks import number


@click.command("replay", short_help="Play a bag into the live graph.")
@click.argument("bag", type=_inputs.BAG, metavar="BAG")
@_inputs.option("--model", "model_name", default="dc_motor", metavar="MODEL", help="Model to fit.")
@click.option("--effect", "effects", multiple=True, metavar="NAME@SITE(...)", help="Effect added to the model.")
@_inputs.option("--window", type=float, default=20.0, help="Seconds of data a fit uses.")
@_inputs.option("--validation", type=float, default=10.0, help="Seconds after it that judge the fit.")
@_inputs.option("--fit-period", type=float, default=10.0, help="Seconds between fits.")
@click.option("--rate", type=float, default=0.0, help="Times real time; 0: as fast as the nodes acknowledge.")
@click.option("--output", type=_outputs.NEW_FOLDER, help="Keep what the estimator said in this new bag.")
@_inputs.domain_option
@_outputs.json_option
def command(
    bag: Path,
    model_name: str,
    effects: tuple[str, ...],
    window: float,
    validation: float,
    fit_period: float,
    rate: float,
    output: Path | None,
    domain: int | None,
    as_json: bool,
) -> None:
    """Play BAG into a live graph of estimator and recorder; print the last fit and its parameters."""
    from idloop.graph import Windows, replay_bag

    with tempfile.TemporaryDirectory(prefix="idloop_replay_") as folder:
        result = replay_bag(
            bag,
            model_name,
            output or Path(folder) / "replay",
            effects=effects,
            windows=Windows(window, validation, fit_period),
            rate=rate,
            say=lambda label, line: _outputs.log(f"[{label}] {line}"),
            domain_id=domain,
        )
    if as_json:
        _outputs.print_json({"schema": "idloop/replay/1", "bag": bag, "model": model_name, "result": result})
        return
    _outputs.print_table(
        ("output", "FIT on unseen data", "FIT on fitted data"),
        [(name, f"{value:.2f} %", f"{result.fit_train[name]:.2f} %") for name, value in result.fit.items()],
    )
    click.echo()
    rows = [
        (name, number(one["value"], 6), number(one["stderr"], 2), one["unit"])
        for name, one in result.parameters.items()
    ]
    _outputs.print_table(("parameter", "value", "standard error", "unit"), rows)
