"""Innovations under another disturbance, without a simulation."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from idloop.estimation.likelihood.estimation_problem import prepare_estimation
from idloop.estimation.observer.translated_innovations import TranslatedCriterion
from idloop.physics import load_model, simulate
from idloop.records import Record

PLACES = st.tuples(st.floats(-9.0, 5.0), st.floats(-1.0, 5.0))


def record_of(model, rng, pause=False):
    time = np.arange(400) * 0.01
    if pause:
        time[200:] += 0.07
    command = rng.uniform(-1.0, 1.0, 20)[np.arange(400) // 20]
    clean = simulate(model, time, command, time).output
    noise = np.array([o.noise for o in model.outputs])
    return Record(
        name="made",
        input_time=time,
        input=command,
        time=time,
        output=clean + noise * rng.standard_normal(clean.shape),
        input_name=model.input.name,
        input_unit=model.input.unit,
        output_names=model.output_names,
        output_units=tuple(o.unit for o in model.outputs),
    )


def criterion_of(name, pause=False, effect=None):
    model = load_model(name)
    truth = model if effect is None else model.with_effect(*effect[:2], **effect[2])
    estimation = prepare_estimation(model, [record_of(truth, np.random.default_rng(5), pause)], "prediction")
    criterion = estimation.criterion(truth)
    criterion.retune(truth.theta)
    return criterion, truth.theta


@pytest.mark.parametrize("name", ["dc_motor", "torsion"])
@settings(max_examples=20, deadline=None)
@given(here=PLACES, there=PLACES)
def test_of_a_linear_model_they_are_exactly_what_the_other_observer_leaves(name, here, there):
    criterion, theta = criterion_of(name)
    near = TranslatedCriterion(criterion, theta, np.array(here))
    ran = criterion.errors(theta, np.array(there))[0][0]
    size = np.max(np.abs(ran), axis=0)
    assert np.all(np.abs(near.errors(theta, np.array(there))[0][0] - ran) <= 1e-5 * size)


def test_a_pause_in_the_record_is_bridged():
    criterion, theta = criterion_of("dc_motor", pause=True)
    near = TranslatedCriterion(criterion, theta, np.array([-4.0, 2.0]))
    there = np.array([1.0, 5.0])
    ran = criterion.errors(theta, there)[0][0]
    assert np.all(np.abs(near.errors(theta, there)[0][0] - ran) <= 1e-5 * np.max(np.abs(ran), axis=0))


def test_beside_dry_friction_they_are_nearly_what_the_other_observer_leaves():
    criterion, theta = criterion_of("dc_motor", effect=("coulomb_friction", "motor", {"level": 1.0}))
    here, there = np.array([-4.0, 2.0]), np.array([-3.0, 2.0])
    near = TranslatedCriterion(criterion, theta, here)
    ran, stayed = criterion.errors(theta, there)[0][0], criterion.errors(theta, here)[0][0]
    missed = np.std(near.errors(theta, there)[0][0] - ran, axis=0)
    assert np.all(missed <= 0.2 * np.std(ran - stayed, axis=0))
