"""Beside the measures of a comparison stands what they do not say."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from idloop.api.first_fit import _describes_nothing
from idloop.reporting.text.comparison import lowest_fits, measures_of


def _comparison(name, *, trusted, fit=50.0):
    force = SimpleNamespace(relative=89.0, noise=89.0 if not trusted else 0.01, band=90.0, trusted=trusted)
    return SimpleNamespace(
        names=("a.position",), fit={"a.position": fit}, nrmse={"a.position": 0.5}, rmse={"a.position": 0.1},
        fit_ahead={"a.position": 90.0}, model=SimpleNamespace(outputs=[SimpleNamespace(unit="rad", field="position")]),
        record=SimpleNamespace(name=name), force=force, no_force="", steps=10,
    )  # fmt: skip


@pytest.mark.parametrize("trusted", [True, False])
def test_a_force_error_of_sensor_noise_says_so_and_that_a_fit_leaves_less(trusted):
    rows = [("fitted", _comparison(name, trusted=trusted)) for name in ("one", "two")]
    said = [one for one in measures_of(rows) if isinstance(one, str)]
    assert len(said) == (not trusted)
    for line in said:
        assert line.startswith("force error of one, two: sensor noise alone makes 89 times the commanded force")
        assert "up to 90 Hz" in line
        assert "smooth windows" in line


@pytest.mark.parametrize("trusted", [True, False])
def test_values_that_describe_nothing_are_not_refused_by_noise_without_saying_so(trusted):
    time = np.arange(100.0)
    one = _comparison("one", trusted=trusted)
    one.time, one.measured, one.simulated = time, np.sin(time)[:, None], np.cos(time)[:, None]
    why = _describes_nothing([one])
    assert "the force error is 89 times the commanded force" in why
    assert ("of which sensor noise alone makes 89 times" in why) == (not trusted)


def test_of_many_records_those_with_the_lowest_fit_are_shown():
    rows = [
        ("fitted", _comparison(f"run{k}", trusted=True, fit=float(fit))) for k, fit in enumerate([90, 20, 80, 10, 70])
    ]
    assert lowest_fits(rows, 5) == (rows, "")
    shown, others = lowest_fits(rows, 2)
    assert [one.record.name for _, one in shown] == ["run1", "run3"]
    assert others.startswith("the 2 records with the lowest FIT are shown; 3 more, with a FIT of 70 to 90 %")
