"""`idloop report`: the folder of a ladder as one HTML page that can be mailed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from idloop.cli import _inputs, _outputs
from idloop.cli._progress import progress
from idloop.errors import InputError
from idloop.output_files import make_folder, probe_file
from idloop.reporting.ladder_folder import (
    Kept,
    fitted_records,
    judged_records,
    read_ladder,
    read_next_experiment,
    write_report,
)
from idloop.reporting.terms import FITTED, UNSEEN

if TYPE_CHECKING:
    from idloop.reporting.page.contents import Contents

EXAMPLE = """\b
Examples:
  idloop report runs/refined
  idloop report runs/refined --output for_the_customer.html --pdf for_the_customer.pdf
  idloop report runs/refined --svg figures/
"""


PAGE = _outputs.OutputFile((".html", ".htm"), replaces=True)
PAPER = _outputs.OutputFile((".pdf",), replaces=True)
PICTURE = _outputs.OutputFile((".png",), replaces=True)


@click.command(cls=_inputs.lists("--bag", "--validate"), epilog=EXAMPLE)
@click.argument("run", type=click.Path(path_type=Path), metavar="RUN")
@click.option("--output", type=PAGE, metavar="FILE", help="HTML file (default: RUN/report.html).")
@click.option("--pdf", type=PAPER, metavar="FILE", help="Print the page with Chromium as well.")
@click.option("--picture", type=PICTURE, metavar="FILE", help="Take a picture (PNG) of the answer as well.")
@click.option(
    "--svg", type=_outputs.OUTPUT_FOLDER, metavar="DIR", help="Write the figures for a paper as well, one SVG each."
)
@click.option(
    "--bag", type=_inputs.BAG, multiple=True, metavar="BAG...", help="The fitted recordings, if they have moved."
)
@click.option(
    "--validate", type=_inputs.BAG, multiple=True, metavar="BAG...", help="The unseen ones, if they have moved."
)
@_outputs.work_options
def command(
    run: Path,
    *,
    output: Path | None,
    pdf: Path | None,
    picture: Path | None,
    svg: Path | None,
    bag: tuple[Path, ...],
    validate: tuple[Path, ...],
    as_json: bool,
) -> None:
    """Write the report of RUN, the folder of `idloop refine --output RUN`.

    One HTML page that needs nothing else: what is missing, the ladder, measured against model, where the model
    fails, what is left, what this data cannot show, the next experiment, equations, parameters, provenance.
    """
    from idloop.reporting.page import chromium

    kept = read_ladder(run)
    page = output if output is not None else probe_file(run / "report.html", "RUN", overwrite=True)
    if pdf is not None or picture is not None:
        chromium.find_chromium()
    with progress(f"report of {run}", writes=True) as update:
        contents = gather_kept(kept, run, bag, validate, update)
        size = write_report(contents, page)
        files = []
        if svg is not None:
            from idloop.reporting.page.page_figures import save_paper_figures

            files = save_paper_figures(contents, make_folder(svg))
        update(0.95, "printing")
        if pdf is not None:
            chromium.print_pdf(page, pdf)
        if picture is not None:
            chromium.take_picture(page, picture)
    if as_json:
        document = {"schema": "idloop/report/1", "run": run, "report": page, "bytes": size, "pdf": pdf}
        document |= {"picture": picture, "svg": files, "added": kept.ladder.added, "verdict": kept.ladder.verdict}
        _outputs.print_json(document)
        return
    _outputs.log_written(page, pdf, picture, *files)


def gather_kept(
    kept: Kept, run: Path, bags: Sequence[Path] = (), validate: Sequence[Path] = (), update: Any = None
) -> Contents:
    """Compute what the report of a folder says, from its own recordings or from those that are given."""
    from idloop.reporting.page.contents import gather

    model = kept.ladder.model
    fitted, unseen = bags or kept.bags, validate or kept.validate
    if not fitted and not unseen:
        raise InputError(f"{run}: the ladder does not know its recordings; name them by --bag")
    for path in (*fitted, *unseen):
        if not path.exists():
            raise InputError(f"{path}: this recording of {run} is not there any more: name it by --bag or --validate")
    records, validation = _inputs.read_records(fitted, model), _inputs.read_records(unseen, model, excited=False)
    return gather(
        kept.ladder, fitted_records(kept, records), [*validation, *judged_records(kept, records)],
        suggestion=read_next_experiment(run, kept), provenance=_origin(kept, fitted, unseen), progress=update,
    )  # fmt: skip


def _origin(kept: Kept, fitted: Sequence[Path], unseen: Sequence[Path]) -> dict[str, Any]:
    """What the folder says of its origin, held against the recordings as they are now."""
    from idloop.reporting.provenance import provenance

    now = provenance(fitted, unseen)
    then: dict[str, set[str]] = {}
    for bag in kept.provenance.get("bags", ()):
        then.setdefault(bag["sha256"], set()).add(bag["use"])
    for bag in now["bags"] if then else ():
        # Data that made the parameters do not judge them.
        if bag["sha256"] is not None and bag["use"] not in then.get(bag["sha256"], {bag["use"]}):
            served, option = (FITTED, "--bag") if bag["use"] == UNSEEN else (UNSEEN, "--validate")
            raise InputError(f"{bag['path']}: of this ladder these are {served} data: name it by {option}")
        if bag["sha256"] not in then:
            _outputs.log(
                f"{bag['path']}: this recording is not the one that the ladder was climbed on (its checksum differs)"
            )
    return {**now, **kept.provenance}
