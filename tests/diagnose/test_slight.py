"""Significance is not enough: what moves nothing, or is not told from nothing, is no missing physics."""

from dataclasses import replace

import numpy as np
import pytest

from idloop.diagnose import diagnose
from idloop.diagnose.confirm import Confirmed
from idloop.diagnose.intervals import with_stderr
from idloop.diagnose.proposals import proposals
from idloop.diagnose.refit import Refit, refit
from idloop.diagnose.setting import prepare_setting
from idloop.diagnose.slight import same_motion, too_slight
from idloop.physics import Model, load_model
from idloop.records import Record

from .conftest import record_of

DELAY = "sensor_delay@position[axis]"


def with_noise(model: Model, share: float) -> Model:
    """A machine whose sensors have so many times their usual noise."""
    return replace(model, outputs=tuple(replace(o, noise=share * float(o.noise or 1.0)) for o in model.outputs))


def confirmed_with(start: Model, machine: Model, name: str) -> tuple[Refit, Confirmed, list[Record]]:
    records = [record_of(machine, 4, seconds=8.0)]
    setting = prepare_setting(start, records, "prediction")
    parent = refit(setting, start)
    proposal = next(p for p in proposals(parent.model, [name]) if p.name == name)
    strength = proposal.effect.strength
    fit = refit(setting, proposal.model({strength: machine.values[f"{name}.{strength}"]}), None, parent)
    return parent, Confirmed(proposal, fit, fit.log_likelihood - parent.log_likelihood, 0.0), records


@pytest.mark.parametrize(("delay", "missing"), [(2e-7, False), (2e-3, True)])
def test_a_difference_that_moves_nothing_is_not_named_however_clean_the_data(delay: float, missing: bool) -> None:
    start = with_noise(load_model("axis"), 1e-6)
    machine = start.with_effects([f"{DELAY}(delay={delay})"])
    parent, found, records = confirmed_with(start, machine, DELAY)
    assert found.gain > 20.0, "the data have the power to show it"
    assert ("moves no output" in too_slight(parent, found, records)) is not missing
    diagnosis = diagnose(start, records, effects=[DELAY])
    assert (diagnosis.best is not None) is missing
    assert (DELAY in diagnosis.passed_over) is not missing
    assert ("moves no output" in diagnosis.summary()) is not missing


def test_an_effect_whose_interval_holds_none_is_not_told_from_none() -> None:
    name, start = "coulomb_friction@axis", with_noise(load_model("axis"), 100.0)
    machine = start.with_effects([f"{name}(level=1e-4)"])
    parent, found, records = confirmed_with(start, machine, name)
    # Whatever the likelihood says of it.
    assert "95 %" in too_slight(parent, found, records)


@pytest.mark.parametrize("told", [True, False])
def test_a_spring_must_give_more_than_its_interval(told: bool) -> None:
    start, name = with_noise(load_model("axis"), 30.0), "compliance@axis"
    values = {"stiffness": 20.0, "damping": 0.02, "split": 0.4, "viscous_split": 0.4}
    records = [record_of(start.with_effect("compliance", "axis", **values) if told else start, 4, seconds=8.0)]
    setting = prepare_setting(start, records, "prediction")
    parent = refit(setting, start)
    (proposal,) = proposals(parent.model, [name])
    fit = refit(setting, proposal.model(values), None, parent)
    why = too_slight(parent, Confirmed(proposal, fit, fit.log_likelihood - parent.log_likelihood, 0.0), records)
    assert why == ("" if told else "the 95 % interval of its give holds the value at which it does nothing")


@pytest.mark.parametrize(("ratio", "told"), [(0.0, False), (0.3, True)])
def test_a_richer_effect_must_be_told_from_the_plainer_one_whose_place_it_takes(ratio: float, told: bool) -> None:
    plain, rich = "coulomb_friction@axis", "asymmetric_friction@axis"
    bare = with_noise(load_model("axis"), 10.0)
    records = [record_of(bare.with_effects([f"{rich}(level=0.05,ratio={ratio})"]), 4, seconds=8.0)]
    start = bare.with_effects([f"{plain}(level=0.05)"])
    setting = prepare_setting(start, records, "prediction")
    parent = refit(setting, start)
    proposal = next(p for p in proposals(parent.model, [rich]) if p.replaces == plain)
    fit = refit(setting, proposal.model({"level": 0.05, "ratio": ratio + 0.01}), None, parent)
    confirmed = Confirmed(proposal, fit, fit.log_likelihood - parent.log_likelihood, 0.0)
    assert (f"what it has beyond {plain}" in too_slight(parent, confirmed, records)) is not told


@pytest.mark.parametrize(("amplitude", "told"), [(0.0, False), (0.02, True)])
def test_a_wave_over_a_short_arc_is_judged_by_both_its_components(amplitude: float, told: bool) -> None:
    name, start = "sensor_ripple@velocity[axis]", with_noise(load_model("axis"), 0.1)
    command = 0.02 * np.sin(2.0 * np.pi * 2.0 * np.arange(1600) / 200.0)
    machine = start.with_effects([f"{name}(amplitude={amplitude},harmonic=1,phase=0.6)"])
    records = [record_of(machine, 4, command=command)]
    setting = prepare_setting(start, records, "prediction")
    parent = refit(setting, start)
    (proposal,) = proposals(parent.model, [name])
    fit = refit(setting, proposal.model({"amplitude": 0.02, "harmonic": 1.0, "phase": 0.6}), None, parent)
    strength = with_stderr(fit, records).parameter(f"{name}.amplitude")
    assert strength.value < 1.96 * (strength.stderr or 0.0), "over so short an arc its own interval reaches nothing"
    why = too_slight(parent, Confirmed(proposal, fit, fit.log_likelihood - parent.log_likelihood, 0.0), records)
    assert (why == "") is told


@pytest.mark.parametrize(("amplitude", "named"), [(3e-4, False), (0.05, True)])
def test_what_a_coarse_sensor_rounds_off_is_no_ripple(amplitude: float, named: bool) -> None:
    name, start = "sensor_ripple@position[axis]", load_model("axis")
    machine = start.with_effects([f"{name}(amplitude={amplitude},harmonic=6,phase=0.4)"])
    (exact,) = [record_of(machine, 4, seconds=8.0)]
    column = [o.site for o in start.outputs].index("position[axis]")
    output = exact.output.copy()
    output[:, column] = 0.02 * np.round(output[:, column] / 0.02)
    records = [replace(exact, output=output)]
    setting = prepare_setting(start, records, "prediction")
    parent = refit(setting, start)
    proposal = next(p for p in proposals(parent.model, [name]) if p.name == name)
    fit = refit(setting, proposal.model({"amplitude": amplitude, "harmonic": 6.0, "phase": 0.4}), None, parent)
    confirmed = Confirmed(proposal, fit, fit.log_likelihood - parent.log_likelihood, 0.0)
    assert ("rounding" in too_slight(parent, confirmed, records)) is not named


@pytest.mark.parametrize("noise", [0.0, 1e-8, 1e-6])
@pytest.mark.parametrize(
    "hidden",
    ["", "sensor_delay@position[axis](delay=2e-3)", "coulomb_friction@axis(level=0.05)", "dead_zone@input(width=0.1)"],
)
def test_exact_data_show_what_is_missing_and_nothing_else(hidden: str, noise: float) -> None:
    plain = load_model("axis")
    machine = with_noise(plain, noise).with_effects([hidden] if hidden else [])
    untold = replace(plain, outputs=tuple(replace(o, noise=None) for o in plain.outputs))
    diagnosis = diagnose(untold, [record_of(machine, 4, seconds=8.0)])
    assert diagnosis.set == ((hidden.partition("(")[0],) if hidden else ())
    assert diagnosis.verdict == ("missing" if hidden else "adequate")


def test_an_output_that_is_not_measured_keeps_nothing_from_being_the_same_motion() -> None:
    start = load_model("axis")
    record = record_of(start, 4, seconds=8.0)
    silent = record.output.copy()
    silent[:, 1] = np.nan
    for output in (record.output, silent):
        one = [replace(record, output=output)]
        assert same_motion(start, start.with_effects([f"{DELAY}(delay=1e-9)"]), one)
        assert not same_motion(start, start.with_effects([f"{DELAY}(delay=1e-2)"]), one)
