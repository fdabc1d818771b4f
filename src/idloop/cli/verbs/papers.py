"""`idloop papers`: redoes rows of the source papers and prints ours beside theirs."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import click

import idloop
from idloop.cli import _inputs, _outputs
from idloop.cli._progress import progress
from idloop.cli.main import COULD_NOT, DONE
from idloop.errors import InputError

EXAMPLES = Path(idloop.__file__).resolve().parents[2] / "examples"


def _find_papers() -> None:
    """Make the rows importable: they are no part of the installed package.

    Raises InputError: idloop was installed without its source tree.
    """
    if not (EXAMPLES / "papers" / "__init__.py").is_file():
        raise InputError("the rows of the papers are in examples/papers of the source tree: run this in a checkout")
    if str(EXAMPLES) not in sys.path:
        sys.path.insert(0, str(EXAMPLES))


def list_rows(*, as_json: bool) -> None:
    """Print name, title and paper of every row."""
    from papers import ROWS

    cells = [(name, row.title, row.paper) for name, row in ROWS.items()]
    rows = [
        {"row": name, "title": row.title, "paper": row.paper, "parts": list(row.parts)} for name, row in ROWS.items()
    ]
    document = {"schema": "idloop/papers/1", "rows": rows}
    _outputs.print_rows(["row", "what is redone", "paper"], cells, document, as_json=as_json)


EXAMPLE = """\b
Example:
  idloop papers
  idloop papers A3 --plot a3.png
  idloop papers B2 --part friction
"""


@click.command(epilog=EXAMPLE)
@click.argument("row", required=False)
@_inputs.option("--seed", type=click.IntRange(min=0), default=0, help="Of the measurement noise.")
@click.option("--part", "parts", multiple=True, metavar="PART", help="One case of a long row; repeat for several.")
@_outputs.drawn_work_options
def command(row: str | None, *, seed: int, parts: tuple[str, ...], plot: Path | None, as_json: bool) -> int:
    """Redo ROW of the source papers in simulation; without ROW, list the rows.

    Each line has our figure, the paper's, what is claimed of ours, and whether it holds: where nothing is claimed, both
    are empty. Exit code 1 where a line does not hold.
    The rows A6, B2, B9 and C5 diagnose hidden effects and take minutes.
    """
    _find_papers()
    if row is None:
        if parts:
            raise InputError("--part needs a row: idloop papers B2 --part friction")
        list_rows(as_json=as_json)
        return DONE
    from papers import ROWS, find_parts, find_row, reproduce

    name = find_row(row)
    chosen = find_parts(name, parts)
    with progress(f"{name}: {ROWS[name].title}") as update:
        found = reproduce(name, seed, update, chosen)
    if plot is not None:
        import matplotlib as mpl
        import numpy as np

        mpl.use("Agg")  # a file is written, so no window is needed
        axes: Any = np.ravel(found.plot())[0]
        _outputs.save_plot(lambda: axes.figure, plot)
    title, paper = ROWS[name].title, ROWS[name].paper
    if as_json:
        heading = {"schema": "idloop/papers/1", "row": name, "title": title, "paper": paper}
        _outputs.print_json({**heading, "seed": seed, "parts": list(chosen), **found.to_dict(), "plot": plot})
    else:
        _outputs.print_blocks([f"{name}: {title}", paper, "", *found.blocks()])
    missed = sum(line.holds is False for line in found.rows())
    if missed:
        _outputs.log(f"{name}: {missed} of {len(found.rows())} lines do not hold")
    return COULD_NOT if missed else DONE
