"""Searches that continue after their first round, and strengths that end at their bound."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from tests.diagnosis.conftest import RATE, record_of

from idloop.diagnosis import refine
from idloop.diagnosis.evidence import prediction_view
from idloop.diagnosis.evidence.prediction_view import (
    PredictionView,
    _may_become_significant,
    bound_reached,
    earlier_command,
)
from idloop.diagnosis.options import Options
from idloop.diagnosis.screening.command_response import CommandResponse
from idloop.diagnosis.screening.proposals import proposals
from idloop.diagnosis.search import non_local_search
from idloop.diagnosis.search.step import ADEQUATE
from idloop.estimation.likelihood.estimation_problem import prepare_estimation
from idloop.estimation.likelihood.refit import refit
from idloop.physics import Model, load_model


@pytest.mark.parametrize(
    ("replaces", "slow", "gain", "score", "goes_on"),
    [
        pytest.param("coulomb_friction@axis", False, 0.0, 100.0, True, id="a replacement that is still far off"),
        pytest.param("coulomb_friction@axis", False, 60.0, 1.0, True, id="a replacement that has gained already"),
        pytest.param("coulomb_friction@axis", False, 0.0, 1.0, False, id="a replacement that nothing speaks for"),
        pytest.param(None, True, 0.0, 100.0, False, id="a constant force, which the disturbance stands for"),
        pytest.param(None, False, 0.0, 100.0, True, id="any other effect, by its score"),
        pytest.param(None, False, 60.0, 1.0, False, id="any other effect whose score is nothing"),
    ],
)
def test_what_is_searched_further_after_a_first_round(
    replaces: str | None, slow: bool, gain: float, score: float, goes_on: bool
) -> None:
    proposal = SimpleNamespace(replaces=replaces, effect=SimpleNamespace(slow=slow))
    first: Any = SimpleNamespace(proposal=proposal, gain=gain, statistic=score)
    assert _may_become_significant(first, 40.0) is goes_on


@pytest.mark.parametrize(
    ("effect", "values", "reported"),
    [
        ("load_dependent_friction", {"ratio": 0.99}, True),
        ("load_dependent_friction", {"ratio": 0.9}, False),
        ("gain_asymmetry", {"ratio": -0.95}, True),
        ("gain_asymmetry", {"ratio": 0.0}, False),
        ("coulomb_friction", {"level": 0.0}, False),
        ("compliance", {"stiffness": 0.0}, False),
    ],
)
def test_a_strength_at_a_bound_other_than_zero_is_reported(
    effect: str, values: dict[str, float], reported: bool
) -> None:
    (proposal,) = proposals(load_model("axis"), [effect])
    text = bound_reached(proposal.model(values), proposal)
    assert text == (f"its ratio ended at the bound of what makes sense, {values['ratio']:g}" if reported else "")


@pytest.mark.parametrize(("ratio", "reported"), [(1.0, True), (-1.0, True), (0.6, False), (0.0, False)])
def test_the_strength_of_an_effect_is_what_it_has_beyond_a_simpler_one(ratio: float, reported: bool) -> None:
    model = load_model("axis").with_effects(["coulomb_friction@axis(level=0.1)"])
    (proposal,) = proposals(model, ["asymmetric_friction"])
    assert bool(bound_reached(proposal.model({"level": 0.1, "ratio": ratio}), proposal)) is reported


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_all_of_a_share_is_a_share(share: float) -> None:
    model = load_model("axis").with_effects(["compliance@axis(stiffness=20.0, damping=0.02, split=0.4)"])
    (proposal,) = proposals(model, ["compliance"])
    values = {"stiffness": 20.0, "damping": 0.02, "split": 0.4, "viscous_split": share}
    assert not bound_reached(proposal.model(values), proposal)


def test_no_friction_takes_the_whole_drive_of_an_axis_that_is_only_driven(start: Model) -> None:
    # Driven one way, a share of the drive's force is nothing but the scale of inertia and friction.

    time = np.arange(0.0, 20.0, 1.0 / RATE)
    command = 0.5 + 0.1 * np.sign(np.sin(2.0 * time))
    machine = load_model("axis").with_effects(["coulomb_friction@axis(level=0.1)"])
    known = start.with_free(name for name in start.free if name != "drive.gain")
    found = refine(known, [record_of(machine, 3, command=command)], criterion="force")
    assert "load_dependent_friction@axis" not in found.added


def test_beside_a_balance_the_motion_follows_the_command(monkeypatch: pytest.MonkeyPatch) -> None:
    """A noise model may have absorbed the command; the force balance has shown what the command does."""
    model = load_model("axis")
    estimation = prepare_estimation(model, [record_of(model, 5)], "prediction")
    view = PredictionView(estimation, model, Options(effects=["sensor_delay", "coulomb_friction"]))
    monkeypatch.setattr(prediction_view, "responds_to_command", lambda *_: False)
    monkeypatch.setattr(non_local_search, "_restarted_near_nominal", lambda *_: [])
    parent = refit(estimation, model)
    alone = view.evaluate(parent)
    balanced = view.beside(model, balanced=True).evaluate(parent)
    assert alone.response is not CommandResponse.FOLLOWS
    assert balanced.response is CommandResponse.FOLLOWS
    assert balanced.verdict() == (ADEQUATE, ())


def test_a_balance_decides_until_a_body_is_split() -> None:
    model = load_model("axis")
    estimation = prepare_estimation(model, [record_of(model, 5)], "prediction")
    view = PredictionView(estimation, model, Options()).beside(model, balanced=True)
    split = model.with_effects(["compliance@axis(stiffness=50.0, damping=0.1)"])
    choices = view.choices(model)
    assert choices is not None
    assert "coulomb_friction@axis" not in choices
    assert view.choices(split) is None  # the whole catalogue


@pytest.mark.parametrize(("level", "seconds", "samples"), [(0.1, 60, 5_000), (0.0, 60, 12_000), (0.1, 40, 8_000)])
def test_more_samples_are_used_only_where_a_few_do_not_decide_or_save_little(
    level: float, seconds: int, samples: int
) -> None:
    model = load_model("axis")
    machine = model.with_effects([f"coulomb_friction@axis(level={level})"])
    estimation = prepare_estimation(model, [record_of(machine, 5, seconds=float(seconds))], "prediction")
    view = PredictionView(estimation, model, Options(effects=["coulomb_friction", "sensor_delay"]))
    step: Any = view.evaluate(refit(estimation, model))
    assert step.decided is (level > 0.0)
    assert sum(len(data.time) for data in step.estimation.data) == pytest.approx(samples, rel=0.01)
    # What is named is then fitted to all, and what excites the axis is said of all.
    assert f"{seconds} s in 1 record," in step.gate.findings[0]


@pytest.mark.parametrize("early", [0.0, 0.01, 0.5])
def test_a_command_that_acts_before_its_stamps_is_found(early: float) -> None:
    model = load_model("axis")
    # Quiet sensors, as counts of an encoder are: a hundredth of a sample shows.
    model = replace(model, outputs=tuple(replace(one, noise=0.02 * (one.noise or 1e-4)) for one in model.outputs))
    record = record_of(model, 5, seconds=30.0)
    late = replace(record, input_time=record.input_time + early / RATE)
    estimation = prepare_estimation(model, [late], "prediction")
    shift, gain = earlier_command(estimation, refit(estimation, model))
    assert shift == pytest.approx(-early / RATE, abs=0.003 / RATE)
    assert (gain > 100.0) is (early > 0.0)


def test_no_command_is_taken_as_earlier_where_an_effect_explains_far_more(start: Model) -> None:
    """A delay would be found too long by as much."""
    record = record_of(start.with_values(load_model("axis").values).with_effects(["input_delay@input(delay=0.01)"]), 1)
    estimation = prepare_estimation(start, [record], "prediction")
    view = PredictionView(estimation, start, Options(effects=["input_delay"]))
    step = view.evaluate(refit(estimation, start))
    assert step.names == ("input_delay@input",)
    shift, gain = earlier_command(estimation, step.parent)
    assert shift < 0.0
    assert gain > step.threshold()
    assert view.with_timing(step) is None


@pytest.mark.parametrize(("torque", "superfluous"), [(0.0, True), (0.1, False)])
def test_a_free_run_drops_what_has_become_nothing_beside_another_effect(torque: float, superfluous: bool) -> None:
    model = load_model("axis")
    name = "load_torque@axis"
    record = record_of(model.with_effects([f"{name}(torque={torque})"]), 4, seconds=8.0)
    estimation = prepare_estimation(model, [record], "simulation")
    fit = refit(estimation, model.with_effects([f"{name}(torque={torque + 0.01})"]))
    without = PredictionView(estimation, model, Options()).without(fit, name)
    assert (without is not None) is superfluous
