"""What every result of the public API can do: words, a figure, plain values, a notebook cell."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any

from idloop.reporting.text.blocks import Block, as_html, as_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from idloop.records import Record

# Called with the share done in [0, 1] and a short text.
Progress = Callable[[float, str], None]


def ignore_progress(share: float, text: str) -> None:
    """Progress that nobody reads."""


def part(progress: Progress, start: float, stop: float) -> Progress:
    """Progress of a part of the work, from `start` to `stop` of the whole."""

    def update(share: float, text: str) -> None:
        progress(start + (stop - start) * share, text)

    return update


def as_records(records: Record | Iterable[Record]) -> list[Record]:
    """One record or several, as a list."""
    from idloop.records import Record

    return [records] if isinstance(records, Record) else list(records)


class Result(ABC):
    """A result that prints, draws and serialises itself."""

    @abstractmethod
    def blocks(self) -> Iterable[Block]:
        """Paragraphs and tables of `summary`."""

    @abstractmethod
    def to_dict(self) -> dict[str, Any]:
        """Return the JSON document of the verb of the same name."""

    @abstractmethod
    def plot(self) -> Figure:
        """Draw the result."""

    def summary(self) -> str:
        """Return the result as text: what the verb prints."""
        return as_text(self.blocks())

    def _repr_html_(self) -> str:
        return as_html(self.blocks())


def names_of(models: Sequence[Any]) -> list[str]:
    """Name of each model; numbered where names are not unique."""
    names = [model.name for model in models]
    return names if len(set(names)) == len(names) else [f"{name} {i + 1}" for i, name in enumerate(names)]
