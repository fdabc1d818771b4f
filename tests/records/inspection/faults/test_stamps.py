"""Two clocks that only the motion shows: the command is stamped early, late, or by a clock that runs fast."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from idloop.records.inspection.faults import stamps
from idloop.records.inspection.time_axes import time_axes

STREAM = SimpleNamespace(stamped=True)


@pytest.fixture(autouse=True)
def one_clock_by_receipt(monkeypatch):
    monkeypatch.setattr(stamps, "clock_finding", lambda *_: None)


def _axis(make_axis, offset=0.0, faster=0.0, *, joined=True, **changes):
    time = np.arange(3000) / 200.0
    streams = {"command_stream": STREAM, "measured_stream": STREAM}
    return make_axis(input_time=offset + (1.0 + faster) * time, joined=joined, **streams, **changes)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("joined", [True, False])
def test_one_clock(make_axis, seed, joined):
    assert stamps.two_clocks(_axis(make_axis, 1e-4, joined=joined, seed=seed)) is None


@pytest.mark.parametrize("faster", [0.004, -0.004, 0.015])
def test_clocks_that_drift_apart(make_axis, faster):
    axis = _axis(make_axis, 0.02, faster)
    found = stamps.two_clocks(axis)
    assert found.kind == "two_clocks"
    assert found.spoils == ("identification",)
    # With the cure both run alike.
    t, first = axis.input_time, axis.input_time[0]
    cured = first + found.evidence["offset"] + found.evidence["stretch"] * (t - first)
    np.testing.assert_allclose(cured, np.arange(3000) / 200.0, atol=0.01)


def test_a_motion_before_its_command(make_axis):
    found = stamps.two_clocks(_axis(make_axis, 0.12))
    assert found.kind == "two_clocks"
    assert found.evidence["offset"] == pytest.approx(-0.12, abs=0.006)
    assert "offset: -0.12" in found.cure
    assert found.evidence["command_late"] == -found.evidence["offset"]
    assert f"--late {found.evidence['command_late']:.4g}`" in found.cure


def test_a_motion_late_in_joined_files_may_be_a_delay(make_axis):
    found = stamps.two_clocks(_axis(make_axis, -0.1))
    assert found.kind == stamps.OFFSET
    assert found.evidence["offset"] == pytest.approx(0.1, abs=0.006)
    assert f"--late {-found.evidence['offset']:.4g}`" in found.cure
    assert "command_late" not in found.evidence
    assert stamps.two_clocks(_axis(make_axis, -0.1, joined=False)) is None, "a delay"


def test_a_motion_that_the_command_does_not_explain_shows_no_clock(make_axis):
    rng = np.random.default_rng(1)
    assert stamps.two_clocks(_axis(make_axis, 0.12, drive=lambda _: rng.normal())) is None
    assert time_axes(make_axis(count=100)) is None
