"""Practical significance: an effect that moves nothing is not named, however certain its presence."""

from dataclasses import replace

import numpy as np
import pytest

from idloop.diagnosis import diagnose
from idloop.diagnosis.equivalence.same_motion import same_motion
from idloop.physics import Model, load_model

from .conftest import record_of

DELAY = "sensor_delay@position[axis]"


def with_noise(model: Model, share: float) -> Model:
    """A machine whose sensors have so many times their usual noise."""
    return replace(model, outputs=tuple(replace(o, noise=share * float(o.noise or 1.0)) for o in model.outputs))


@pytest.mark.parametrize(("delay", "missing"), [(2e-7, False), (2e-3, True)])
def test_a_difference_that_moves_nothing_is_not_named_however_clean_the_data(delay: float, missing: bool) -> None:
    start = with_noise(load_model("axis"), 1e-6)
    records = [record_of(start.with_effects([f"{DELAY}(delay={delay})"]), 4, seconds=8.0)]
    diagnosis = diagnose(start, records, effects=[DELAY])
    assert diagnosis.candidates[0].p_value < 1e-3, "the data have the power to show it"
    assert (diagnosis.best is not None) is missing
    assert (DELAY in diagnosis.passed_over) is not missing
    assert ("moves no output" in diagnosis.passed_over.get(DELAY, "")) is not missing


@pytest.mark.slow
@pytest.mark.parametrize("noise", [0.0, 1e-8, 1e-6])
@pytest.mark.parametrize(
    "hidden",
    ["", "sensor_delay@position[axis](delay=2e-3)", "coulomb_friction@axis(level=0.05)", "dead_zone@input(width=0.1)"],
)
def test_exact_data_show_what_is_missing_and_nothing_else(hidden: str, noise: float) -> None:
    plain = load_model("axis")
    machine = with_noise(plain, noise).with_effects([hidden] if hidden else [])
    without_noise = replace(plain, outputs=tuple(replace(o, noise=None) for o in plain.outputs))
    diagnosis = diagnose(without_noise, [record_of(machine, 4, seconds=8.0)])
    assert diagnosis.set == ((hidden.partition("(")[0],) if hidden else ())
    assert diagnosis.verdict == ("missing" if hidden else "adequate")


@pytest.mark.parametrize("carries_over", [True, False])
def test_what_does_not_carry_over_to_held_out_records_is_listed_and_not_named(start: Model, carries_over: bool) -> None:
    """A diagnosis named what a ladder of the same records refused."""
    name, plain = "coulomb_friction@axis", load_model("axis")
    machine = plain.with_effects([f"{name}(level=0.05)"])
    records = [record_of(machine, 4, seconds=20.0)]
    held_out = [record_of(machine if carries_over else plain, 5, seconds=20.0)]
    diagnosis = diagnose(start, records, held_out, effects=[name], criterion="force")
    assert diagnosis.set == ((name,) if carries_over else ())
    assert (name in diagnosis.passed_over) is not carries_over
    assert diagnose(start, records, effects=[name], criterion="force").set == (name,)


def test_an_output_that_is_not_measured_keeps_nothing_from_being_the_same_motion() -> None:
    start = load_model("axis")
    record = record_of(start, 4, seconds=8.0)
    silent = record.output.copy()
    silent[:, 1] = float("nan")
    for output in (record.output, silent):
        one = [replace(record, output=output)]
        assert same_motion(start, start.with_effects([f"{DELAY}(delay=1e-9)"]), one)
        assert not same_motion(start, start.with_effects([f"{DELAY}(delay=1e-2)"]), one)


@pytest.mark.parametrize(("least", "named"), [(0.01, True), (0.999, False)])
def test_what_helps_less_than_is_asked_for_is_passed_over(start: Model, least: float, named: bool) -> None:
    machine = load_model("axis").with_effects(["coulomb_friction@axis(level=0.05)"])
    record = record_of(machine, 4, seconds=8.0, disturbance=0.05)
    found = diagnose(start, [record], effects=["coulomb_friction"], minimum_improvement=least, criterion="prediction")
    assert (found.best is not None) is named
    assert any("99.9 % is asked for" in why for why in found.passed_over.values()) is not named


@pytest.mark.parametrize(("amplitude", "named"), [(3e-4, False), (0.05, True)])
def test_what_a_coarse_sensor_rounds_off_is_no_ripple(amplitude: float, named: bool) -> None:
    name, start = "sensor_ripple@position[axis]", load_model("axis")
    exact = record_of(start.with_effects([f"{name}(amplitude={amplitude},harmonic=6,phase=0.4)"]), 4, seconds=8.0)
    output = exact.output.copy()
    output[:, 0] = 0.02 * np.round(output[:, 0] / 0.02)
    found = diagnose(start, [replace(exact, output=output)], effects=["sensor_ripple"], criterion="prediction")
    assert (found.best is not None and found.best.name == name) is named


@pytest.mark.parametrize(("ratio", "named"), [(0.0, False), (0.3, True)])
def test_an_effect_must_show_beyond_the_simpler_one_that_it_replaces(ratio: float, named: bool) -> None:
    plain, rich = "coulomb_friction@axis", "asymmetric_friction@axis"
    bare = with_noise(load_model("axis"), 10.0)
    record = record_of(bare.with_effects([f"{rich}(level=0.05,ratio={ratio})"]), 4, seconds=8.0)
    start = bare.with_effects([f"{plain}(level=0.05)"])
    found = diagnose(start, [record], effects=["asymmetric_friction"], criterion="prediction")
    assert (found.set == (rich,)) is named


@pytest.mark.parametrize("give", [True, False])
def test_a_spring_must_give(give: bool) -> None:
    start = with_noise(load_model("axis"), 30.0)
    values = {"stiffness": 20.0, "damping": 0.02, "split": 0.4, "viscous_split": 0.4}
    machine = start.with_effect("compliance", "axis", **values) if give else start
    record = record_of(machine, 4, seconds=8.0)
    found = diagnose(start, [record], effects=["compliance"], criterion="prediction")
    assert (found.best is not None) is give
