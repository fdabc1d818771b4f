"""Paragraphs and tables of a result, as plain text or as HTML."""

from __future__ import annotations

import html
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Table:
    """A table with one header line."""

    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    @classmethod
    def of(cls, header: Iterable[str], rows: Iterable[Iterable[str]]) -> Table:
        """Table of any iterables; cells become text."""
        return cls(tuple(header), tuple(tuple(map(str, row)) for row in rows))

    @classmethod
    def by_column(cls, columns: Mapping[str, Callable[..., str]], items: Iterable[tuple[Any, ...]]) -> Table:
        """Table with a row for each item: each column is its title and what it shows of the parts of an item."""
        return cls.of(columns, [[show(*item) for show in columns.values()] for item in items])


# A line of text, an empty one between two parts, or a table.
Block = str | Table


def number(value: float | None, digits: int = 4) -> str:
    """Text of a number in tables; "-" where there is none."""
    return "-" if value is None or not math.isfinite(value) else f"{value:.{digits}g}"


def as_text(blocks: Iterable[Block]) -> str:
    """Return the blocks as lines of plain text, without a newline at the end."""
    return "\n".join(block if isinstance(block, str) else _table_text(block) for block in blocks)


def as_html(blocks: Iterable[Block]) -> str:
    """Return the blocks as HTML for a notebook cell: nothing is loaded, nothing runs."""
    parts = []
    for block in blocks:
        if isinstance(block, Table):
            parts.append(_table_html(block))
        elif block:
            parts.append(f"<div style='white-space:pre-wrap'>{html.escape(block)}</div>")
        else:
            parts.append("<br>")
    return "".join(parts)


def _table_text(table: Table) -> str:
    columns = list(zip(table.header, *table.rows, strict=True))
    widths = [max(map(len, column)) for column in columns]
    numeric = _numeric(table)

    def line(row: Sequence[str]) -> str:
        padded = (
            cell.rjust(width) if right else cell.ljust(width)
            for cell, width, right in zip(row, widths, numeric, strict=True)
        )
        return "  ".join(padded).rstrip()

    return "\n".join([line(table.header), line(["-" * width for width in widths]), *map(line, table.rows)])


def _table_html(table: Table) -> str:
    alignment = ["right" if right else "left" for right in _numeric(table)]

    def line(row: Sequence[str], tag: str) -> str:
        cells = zip(row, alignment, strict=True)
        return "<tr>" + "".join(f"<{tag} style='text-align:{to}'>{html.escape(c)}</{tag}>" for c, to in cells) + "</tr>"

    body = "".join(line(row, "td") for row in table.rows)
    return f"<table><thead>{line(table.header, 'th')}</thead><tbody>{body}</tbody></table>"


def _numeric(table: Table) -> list[bool]:
    columns = list(zip(*table.rows, strict=True)) or [()] * len(table.header)
    return [bool(column) and all(map(_looks_numeric, column)) for column in columns]


def _looks_numeric(cell: str) -> bool:
    return cell in {"", "-", "–"} or cell.lstrip("+-−±").replace("%", "").strip()[:1].isdigit()
