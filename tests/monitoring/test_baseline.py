"""What a reference teaches: an offset near nothing, a variance near one, and how long it would have to be."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest

from idloop.diagnosis.design.experiment import Experiment
from idloop.errors import InputError
from idloop.monitoring import choose_watches, learn
from idloop.monitoring.baseline import step_sizes
from idloop.physics.model_file import from_text

LEVEL, GAP = "coulomb_friction@motor.level", "backlash@motor-load.gap"


def test_a_healthy_reference_agrees_with_the_model(baseline):
    (normal,) = baseline.normal
    assert abs(normal.offset) < 3.0 * normal.offset_stderr
    assert normal.offset_stderr < 0.1 * normal.watch.growth
    assert 0.5 < normal.variance_ratio < 3.0
    assert 0.8 < normal.sensitivity <= 1.0
    assert not normal.why
    assert baseline.varying == ("motor.viscous_friction",)
    assert 4.0 < baseline.delay(0) < 60.0


def test_a_gap_that_noise_blurs_shows_in_part_and_a_machine_that_has_one_is_told_its_size():
    text = """
schema: idloop/model/1
name: two_bodies
input: {topic: joint_command, joint: motor, field: effort, unit: N·m}
outputs: [{topic: joint_states, joint: motor, field: position, unit: rad, noise: 0.1}]
bodies:
  - {name: motor, inertia: 0.01, viscous_friction: 0.05}
  - {name: load, inertia: 0.02, viscous_friction: 0.02}
couplings: [{from: motor, to: load, stiffness: 10.0, damping: 0.05}]
effects: [{effect: backlash, at: motor-load, gap: {value: 0.1, min: 0.0}}]
"""
    model = from_text(text, None)

    def run(gap, seed):
        given = {"name": "multilevel", "amplitude": 0.3, "sample_time": 0.01, "duration": 240.0, "seed": seed}
        return Experiment(given).run(model.with_values({GAP: gap}), noise=True, disturbance=0.005, seed=seed)

    baseline = learn(model, [run(0.1, 1)], choose_watches(model, [f"{GAP}=50%"]), false_alarm_hours=1.0)
    assert 0.5 < baseline.normal[0].sensitivity < 0.98
    (worn,) = baseline.efficient_score(baseline.scores(run(0.15, 2)))
    normal = baseline.normal[0]
    growth = (np.sum(worn.gradient) / np.sum(worn.information) - normal.offset) / normal.sensitivity
    assert growth == pytest.approx(0.05, rel=0.2)


def test_fewer_false_alarms_cost_a_longer_delay(baseline):
    seldom = baseline.with_false_alarm_hours(100.0)
    assert seldom.normal[0].threshold > baseline.normal[0].threshold
    assert seldom.delay(0) > baseline.delay(0)
    assert seldom.with_false_alarm_hours(10.0).normal == baseline.normal
    with pytest.raises(InputError, match="positive"):
        baseline.with_false_alarm_hours(0.0)


def test_a_reference_without_motion_tells_nothing(model, run):
    still = learn(model, [run(60.0, 3, name="step", amplitude=3.0, start=59.95)], choose_watches(model, [LEVEL]))
    assert "informative" in still.normal[0].why
    assert still.normal[0].threshold == np.inf
    assert still.delay(0) == np.inf


def test_a_short_reference_says_how_long_it_should_be(model, run):
    found = learn(model, [run(60.0, 3)], choose_watches(model, [f"{LEVEL}=10%"]), false_alarm_hours=1e6)
    assert "times as long" in found.normal[0].why
    assert found.normal[0].threshold == np.inf


def test_two_watches_share_the_false_alarms(model, run, baseline):
    both = learn(
        model, [run(240.0, 1)], choose_watches(model, [f"{LEVEL}=30%", "drive.gain=-20%"]), false_alarm_hours=10.0
    )
    assert both.false_alarm_hours == 10.0
    assert both.normal[0].threshold > 3.0
    assert both.model.free == ("motor.viscous_friction", "drive.gain", LEVEL)


def test_it_travels_to_another_process(baseline, run):
    record = run(20.0, 9)
    there = pickle.loads(pickle.dumps(baseline))
    assert np.array_equal(there.scores(record).gradient, baseline.scores(record).gradient)


def test_a_record_has_the_same_blocks_whole_and_in_pieces(baseline, run):
    whole = run(60.0, 4, start_ns=1_700_000_000_123_456_789)
    late = whole.cut(25.0, None)
    here, there = baseline.scores(whole), baseline.scores(late)
    assert np.array_equal(there.index, here.index[-len(there) :])
    size = np.std(here.gradient, axis=0)
    assert np.all(np.abs(there.gradient - here.gradient[-len(there) :]) < 0.1 * size)
    shifted = baseline.scores(replace(whole, start_ns=whole.start_ns + 2_000_000_000))
    assert np.array_equal(shifted.index, here.index + 1)
    assert np.array_equal(shifted.gradient, here.gradient)


def test_holes_cost_the_blocks_that_they_are_in(baseline, run):
    record = run(60.0, 5)
    output = record.output.copy()
    output[2000:2150] = np.nan
    found = baseline.scores(replace(record, output=output))
    assert set(baseline.scores(record).index) - set(found.index) <= {9, 10, 11}
    assert 10 not in found.index


def test_another_sample_rate_is_refused(baseline, run):
    record = run(20.0, 6)
    slow = replace(record, time=record.time[::2], output=record.output[::2])
    with pytest.raises(InputError, match="same rate"):
        baseline.scores(slow)


def test_slopes_point_to_the_watched_growth_and_stay_within_bounds(model):
    free = model.with_free([LEVEL, "motor.viscous_friction"])
    steps = step_sizes(free, choose_watches(model, [f"{LEVEL}=0.3"]))
    assert dict(zip(free.free, steps, strict=True)) == pytest.approx({LEVEL: 0.3, "motor.viscous_friction": 0.2306})
