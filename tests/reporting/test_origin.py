"""`idloop report` with recordings that are named anew: fitted data stay fitted data."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from idloop.cli.verbs.report import _origin
from idloop.errors import InputError
from idloop.reporting.provenance import provenance


@pytest.fixture
def bags(tmp_path):
    """Two recordings, and the ladder that was climbed on them."""
    for name in "ab":
        (tmp_path / name).write_text(name, encoding="utf-8")
    fitted, unseen = [tmp_path / "a"], [tmp_path / "b"]
    return fitted, unseen, SimpleNamespace(provenance=provenance(fitted, unseen))


def test_recordings_that_served_as_they_do_are_taken(bags):
    fitted, unseen, kept = bags
    assert [bag["use"] for bag in _origin(kept, fitted, unseen)["bags"]] == ["fitted", "unseen"]


def test_fitted_data_do_not_become_unseen_ones(bags):
    fitted, unseen, kept = bags
    with pytest.raises(InputError, match="a: of this ladder these are fitted data: name it by --bag"):
        _origin(kept, [], fitted)
    with pytest.raises(InputError, match="b: of this ladder these are unseen data: name it by --validate"):
        _origin(kept, unseen, [])


def test_recordings_that_are_not_there_any_more_refuse_nothing(bags, tmp_path):
    kept = SimpleNamespace(provenance=provenance([tmp_path / "gone"], []))
    assert _origin(kept, [], [tmp_path / "gone"])
