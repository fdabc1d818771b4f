"""`idloop papers`: redoes rows of the source papers and prints ours beside theirs."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import idloop
from idloop.cli import _inputs, _outputs
from idloop.cli._progress import progress, quiet_option
from idloop.cli.main import COULD_NOT, DONE
from idloop.errors import InputError
from idloop.reporting.text.blocks import number

if TYPE_CHECKING:
    from papers.reproduction import Cell, Reproduction

EXAMPLES = Path(idloop.__file__).resolve().parents[2] / "examples"
HOLDS = {True: "yes", False: "NO", None: ""}


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


def cell(value: Cell) -> str:
    """Text of a cell: five digits of a number, words as they are."""
    return value if isinstance(value, str) else number(value, 5)


def print_reproduction(found: Reproduction) -> None:
    """Print the table "quantity | ours | paper | claimed", the further tables and the notes."""
    rows = []
    for line in found.rows():
        quantity = f"{line.quantity} [{line.unit}]" if line.unit else line.quantity
        values = (cell(line.ours), cell(line.paper))
        rows.append((quantity, *values, line.source, line.claimed or "", HOLDS[line.holds]))
    _outputs.print_table(["quantity", "ours", "paper", "source", "claimed", "holds"], rows)
    for table in found.tables():
        click.echo(f"\n{table.title}")
        _outputs.print_table(table.header, [[cell(value) for value in row] for row in table.rows])
    if found.notes():
        click.echo()
    for note in found.notes():
        click.echo(f"- {note}")


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
@_outputs.plot_option
@quiet_option
@_outputs.json_option
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
    if as_json:
        heading = {"schema": "idloop/papers/1", "row": name, "title": ROWS[name].title, "paper": ROWS[name].paper}
        _outputs.print_json({**heading, "seed": seed, "parts": list(chosen), **found.to_dict(), "plot": plot})
    else:
        click.echo(f"{name}: {ROWS[name].title}\n{ROWS[name].paper}\n")
        print_reproduction(found)
    missed = sum(line.holds is False for line in found.rows())
    if missed:
        _outputs.log(f"{name}: {missed} of {len(found.rows())} lines do not hold")
    return COULD_NOT if missed else DONE
