"""What every row must do: hold, go into JSON, and draw itself with units."""

from __future__ import annotations

import json
from collections.abc import Callable

import numpy as np
import pytest

from papers.reproduction import Reproduction


@pytest.fixture
def complete() -> Callable[[Reproduction], None]:
    """Check a row from end to end."""

    def check(found: Reproduction) -> None:

        from idloop.json_values import to_json

        missed = [(line.quantity, line.ours, line.paper) for line in found.rows() if line.holds is False]
        assert missed == []
        assert any(line.holds for line in found.rows())
        # A reader can tell what was claimed, in few words.
        for line in found.rows():
            assert (line.holds is None) == (line.claimed is None)
            assert line.claimed is None or 0 < len(line.claimed) <= 40
        document = to_json(found.to_dict())
        json.dumps(document, allow_nan=False)
        assert len(document["rows"]) == len(found.rows())
        for table in found.tables():
            assert {len(row) for row in table.rows} == {len(table.header)}
        assert all("\n" not in note for note in found.notes())
        figure = np.ravel(found.plot())[0].figure
        labels = [ax.get_xlabel() + ax.get_ylabel() for ax in figure.axes]
        assert any("[" in text for text in labels)
        figure.canvas.draw()

    return check


@pytest.fixture
def silent() -> Callable[[float, str], None]:
    """A progress that checks what it is told."""

    def tell(share: float, text: str) -> None:
        assert 0.0 <= share <= 1.0
        assert text

    return tell
