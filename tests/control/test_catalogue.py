"""The tables of the controllers."""

from __future__ import annotations

import pytest

from idloop.control import CONTROLLERS


def test_every_type_is_there():
    wanted = {"none", "p", "pd", "pid", "lead", "cascade", "state_feedback"}
    assert set(CONTROLLERS) == wanted


@pytest.mark.parametrize("name", sorted(CONTROLLERS))
def test_rows_are_complete_and_their_defaults_legal(name):
    rows = CONTROLLERS[name].parameters
    assert len({row.name for row in rows}) == len(rows)
    for row in rows:
        assert row.description.endswith(".")
        if not row.required:
            assert row.check(row.default, "here") == row.default
