"""Visitors in a real Chromium for the page's tests, with a watch over what it complains about and whom it calls."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture
def visit(browser):
    """Open the page; at the end no visitor may have met an error or called another host."""
    from visitor import Visitor

    visitors: list[Visitor] = []

    def go(address):
        visitors.append(Visitor(browser, address))
        return visitors[-1]

    yield go
    for one in visitors:
        one.close()
    assert [one.complaints for one in visitors] == [[]] * len(visitors)
    assert [one.foreign for one in visitors] == [[]] * len(visitors)
