"""Alarms of wear over recordings: their false ones counted beside the promise, and the delay of true ones."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import poisson

from idloop.fleet.alarms import REFERENCE, watched, wear_alarms
from idloop.fleet.statistics import Series, take_apart
from idloop.physics import load_model

UNITS, DAYS = 100, 300


def parts(seed: int, grown: int = 0, scatter: float = 0.05):
    rng = np.random.default_rng(seed)
    y = 1.0 + 0.1 * rng.normal(size=(UNITS, 1)) + scatter * rng.normal(size=(UNITS, DAYS))
    y[:grown, DAYS // 2 :] += 0.2
    names = tuple((f"r{k:03d}", "j") for k in range(UNITS))
    return take_apart(Series("kind", "p", "N", names, np.arange(DAYS) + 20000.0, y, np.full(y.shape, 1e-6)))


@pytest.mark.parametrize("recordings", [1000.0, 10_000.0])
def test_false_alarms_are_as_rare_as_promised(recordings):
    fleets = 5
    counted = sum(len(wear_alarms(parts(seed), recordings)) for seed in range(fleets))
    assert counted <= poisson.ppf(0.999, fleets * UNITS * (DAYS - REFERENCE) / recordings)


def test_a_growth_is_named_with_its_onset_and_size():
    found = {one.robot: one for one in wear_alarms(parts(7, grown=20)) if int(one.robot[1:]) < 20}
    assert len(found) >= 19
    assert np.median([one.day for one in found.values()]) == pytest.approx(20000 + DAYS // 2, abs=5)
    assert np.median([one.size for one in found.values()]) == pytest.approx(0.2, abs=0.08)


def test_a_single_recording_raises_no_alarm():
    series = parts(1, scatter=0.01)
    series.left[3, 100] += 5.0
    assert wear_alarms(series) == []


def test_nothing_is_promised_where_recordings_scatter_too_much():
    assert wear_alarms(parts(2, grown=20, scatter=2.0)) is None


def test_what_can_wear_is_what_the_monitor_watches():
    axis = load_model("axis")
    assert watched(axis) == ()
    assert watched(axis.with_effects(["coulomb_friction@axis(level=0.1)"])) == ("coulomb_friction@axis.level",)
