"""`idloop workbench`: the page of the live graph, for recordings."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from idloop.cli import _inputs, _outputs
from idloop.ending_signals import event_on_ending_signal
from idloop.reporting.ladder_folder import Kept, check_target, write_ladder

if TYPE_CHECKING:
    from idloop.diagnosis import Ladder
    from idloop.physics import Model

EXAMPLE = """\b
Examples:
  idloop workbench                                  a page on which a log is dropped
  idloop workbench dc_motor bags/train --validate bags/unseen
  idloop workbench emps bags/emps_train --validate bags/emps_pulses --output runs/emps --port 8080
\b
On a live graph the page comes with it: idloop launch hidden workbench:=true
"""


@click.command(cls=_inputs.lists("--validate", "--effects"), epilog=EXAMPLE)
@click.argument("model", type=_inputs.MODEL, metavar="[MODEL]", required=False)
@click.argument("bags", nargs=-1, type=_inputs.BAG, metavar="[BAG...]")
@_inputs.validate_option
@_inputs.diagnosis_options
@_inputs.model_options
@_inputs.limit_options
@_outputs.output_folder_option(
    "Write model.yaml and ladder.json after every step; idloop refine --resume goes on from there."
)
@_inputs.option(
    "--address",
    default="127.0.0.1",
    help="Address to serve at; outside this machine the printed address holds a random token.",
)
@click.option("--port", type=click.IntRange(0, 65535), default=0, help="Port to serve at.  [default: any that is free]")
@click.option("--no-browser", is_flag=True, help="Do not open a browser.")
@_outputs.json_option
def command(
    model: Model | None,
    bags: tuple[Path, ...],
    *,
    validate: tuple[Path, ...],
    output: Path | None,
    address: str,
    port: int,
    no_browser: bool,
    as_json: bool,
    **options: Any,
) -> None:
    """Look at MODEL on BAGs in a browser: where it fails, what is missing, add it, take it back.

    The page is served until Ctrl-C. Measured data and model, the error over what may explain it, the ranked effects
    and the ladder are those of compare, diagnose, refine and suggest. Without MODEL the page takes a log of any form,
    as idloop start does, and goes on from there.
    """
    if model is None:
        from idloop.cli._start_page import serve

        serve(port, lambda place: _tell(place, no_browser=no_browser, as_json=as_json))
        return
    if not bags:
        raise click.UsageError("Missing argument 'BAG...'.")
    if output is not None:
        check_target(output, "--output", overwrite=_outputs.forced())
    model = _inputs.with_options(model)
    search, limits = _inputs.search_options(options), _inputs.limits_of(options)
    only = search["effects"] or ()
    if only:
        from idloop.diagnosis.screening.proposals import proposals

        proposals(model, only)  # an unknown name is refused now, not at the first search
    records, unseen = _inputs.read_fitted_and_unseen(bags, validate, model)

    # Only now: bad input is refused before the page's libraries are loaded.
    from idloop.reporting.workbench.offline import OfflineSource
    from idloop.reporting.workbench.server import Place, Site
    from idloop.reporting.workbench.steps import Study

    study = Study(
        tuple(records), tuple(unseen), search["level"], search["criterion"], only, search["seed"], limits,
        options["duration"], search["minimum_improvement"],
    )  # fmt: skip
    source = OfflineSource(model, study, keep=_keeper(output, bags, validate, model), paths=(bags, validate))
    try:
        site = Site(source, Place(address, port))
        try:
            _tell(site.address, no_browser=no_browser, as_json=as_json)
            with event_on_ending_signal() as ended:
                ended.wait()
        finally:
            site.close()
    finally:
        source.close()


def _keeper(
    target: Path | None, bags: tuple[Path, ...], validate: tuple[Path, ...], model: Model
) -> Callable[[Ladder], None] | None:
    """What leaves every step on the disk; nothing without --output."""
    if target is None:
        return None
    return lambda ladder: write_ladder(target, Kept(ladder, bags, validate, model.folder))


def _tell(address: str, *, no_browser: bool, as_json: bool) -> None:
    """Print the address, and open it."""
    if as_json:
        _outputs.print_json({"schema": "idloop/workbench/1", "address": address})
    else:
        click.echo(address)
    _outputs.log("Ctrl-C ends it")
    if not no_browser:
        import webbrowser

        if not webbrowser.open(address):
            _outputs.log("no browser found: open the address yourself")
