"""The suggested experiment separates tied effects, stays within its limits and predicts the outcome."""

from __future__ import annotations

import json
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from idloop.diagnosis import diagnose, refine
from idloop.diagnosis.design.effect_question import effect_rivals, suggest_effect
from idloop.diagnosis.design.expected_outcome import describe
from idloop.diagnosis.design.experiment import Experiment
from idloop.diagnosis.design.innovation_errors import transfer
from idloop.diagnosis.design.limits import motion
from idloop.diagnosis.design.next_experiment import suggest_next
from idloop.diagnosis.design.rival_set import experiment_gains, labels, prepare_rivals
from idloop.diagnosis.design.suggest import Limits, suggest
from idloop.errors import InputError
from idloop.estimation import fit
from idloop.estimation.observer.stationary import design, discretise
from idloop.physics import Engine, load_model
from idloop.signals import build_signal

NOISE = (0.002, 0.01)
PRBS = {"name": "prbs", "sample_time": 0.01, "duration": 15.0, "amplitude": 2.0, "band_hz": 1.0, "seed": 1}
DEAD_ZONE, SATURATION = "dead_zone@input(width=0.4)", "saturation@input(limit=1.6)"


@pytest.fixture(scope="module")
def motor():
    """DC motor with sensors good enough to see friction."""
    model = load_model("dc_motor")
    return replace(model, outputs=tuple(replace(o, noise=n) for o, n in zip(model.outputs, NOISE, strict=True)))


def fitted(model, records):
    return fit(model, records, criterion="prediction").model


@pytest.fixture(scope="module")
def tie(motor):
    """A two-level command cannot tell a dead zone from a saturation: both are a gain."""
    record = Experiment(PRBS).run(motor.with_effects([DEAD_ZONE]), noise=True, disturbance=0.02, seed=3)
    return record, [fitted(motor.with_effects([effect]), [record]) for effect in (DEAD_ZONE, SATURATION)]


@pytest.fixture(scope="module")
def suggestion(tie):
    record, rivals = tie
    return suggest(rivals, [record])


def lead(motor, record, right: str, wrong: str) -> float:
    """Log-likelihood by which the right structure leads the wrong one on a record."""
    loss = [fit(motor.with_effects([effect]), [record], criterion="prediction").loss for effect in (right, wrong)]
    return 0.5 * len(record.time) * float(np.log(loss[1] / loss[0]))


@pytest.mark.slow
@pytest.mark.parametrize(("right", "wrong"), ((DEAD_ZONE, SATURATION), (SATURATION, DEAD_ZONE)))
def test_it_resolves_what_a_two_level_command_leaves_tied(motor, tie, suggestion, right, wrong):
    record, _ = tie
    assert abs(lead(motor, record, DEAD_ZONE, SATURATION)) < 3.0
    new = suggestion.experiment.run(motor.with_effects([right]), noise=True, disturbance=0.02, seed=8)
    assert lead(motor, new, right, wrong) > 30.0


@pytest.mark.slow
def test_the_expected_lead_is_of_the_size_that_is_found(motor, suggestion):
    new = suggestion.experiment.run(motor.with_effects([DEAD_ZONE]), noise=True, disturbance=0.02, seed=8)
    expected = suggestion.outcomes[0].in_favour
    assert expected / 5.0 < lead(motor, new, DEAD_ZONE, SATURATION) < 5.0 * expected


def test_every_rival_stays_within_the_limits(tie):
    record, rivals = tie
    limits = Limits(command=1.8, position=(-0.5, 0.6), velocity=2.0)
    found = suggest(rivals, [record], limits, start=0.0, duration=6.0)
    assert found.discrimination > 10.0
    assert found.duration == pytest.approx(6.0)
    assert np.max(np.abs(build_signal(**found.signal).value)) <= 1.8 + 1e-9
    for model in rivals:
        predicted = found.experiment.run(model)
        place, speed = motion(model, predicted)
        assert -0.5 <= np.min(place) < np.max(place) <= 0.6
        assert np.max(np.abs(speed)) <= 2.0


def test_limits_that_are_not_given_are_what_was_seen(tie, suggestion):
    record, _ = tie
    limits = suggestion.limits
    assert limits.command == pytest.approx(2.0)
    place, speed = motion(load_model("dc_motor"), record)
    assert limits.position == pytest.approx((np.min(place), np.max(place)))
    assert 0.8 * np.max(np.abs(speed)) < limits.velocity <= np.max(np.abs(speed))


def test_equal_seeds_give_equal_answers(tie, suggestion):
    record, rivals = tie
    again = suggest(rivals, [record])
    assert again.to_dict() == suggestion.to_dict()


def test_the_answer_is_json_and_names_both_cases(suggestion):
    document = json.loads(json.dumps(suggestion.to_dict()))
    assert (document["adds_to"], document["unit"]) == ("command", "V")
    assert document["discrimination"] > 30.0
    assert [outcome["rival"] for outcome in document["outcomes"]] == ["dead_zone@input", "saturation@input"]
    assert document["outcomes"][0]["errors"]["saturation@input"]["motor.position"]["unit"] == "rad"
    # What the figure needs is no part of it.
    assert set(document) == {
        "signal", "adds_to", "unit", "duration", "discrimination", "outcomes", "text", "limits", "start",
    }  # fmt: skip
    assert build_signal(**document["signal"]).duration == pytest.approx(document["duration"])


def test_it_carries_the_rivals_and_the_noise_that_a_figure_shows(tie, suggestion):
    _, rivals = tie
    assert [label for label, _ in suggestion.rivals] == [outcome.rival for outcome in suggestion.outcomes]
    assert [model for _, model in suggestion.rivals] == rivals
    assert suggestion.noise == pytest.approx(NOISE)


def test_progress_runs_from_nothing_to_the_end(tie):
    record, rivals = tie
    shares = []
    suggest(rivals, [record], duration=4.0, progress=lambda share, text: shares.append(share))
    assert shares[0] == 0.0
    assert shares == sorted(shares)
    assert 0.9 < shares[-1] <= 1.0


def test_limits_too_narrow_to_decide_are_reported(motor):
    record = Experiment(PRBS).run(motor, noise=True, disturbance=0.02, seed=3)
    plain = fitted(motor, [record])
    rivals = [plain, plain.with_effect("saturation", "input", limit=5.0)]
    found = suggest(rivals, [record], duration=5.0)
    assert found.discrimination < 1.0
    assert "widen" in found.text
    wider = suggest(rivals, [record], Limits(command=8.0, position=(-60.0, 60.0), velocity=40.0), duration=5.0)
    assert wider.discrimination > 30.0


def test_a_model_that_contains_the_truth_is_no_loss(motor):
    record = Experiment(PRBS).run(motor, noise=True, disturbance=0.02, seed=3)
    plain = fitted(motor, [record])
    found = suggest_effect(plain, "coulomb_friction@motor", [record], duration=5.0)
    without, with_it = found.outcomes
    assert without.rival == "no further effect"
    assert without.in_favour == 0.0
    assert with_it.in_favour == pytest.approx(found.discrimination)
    assert found.discrimination > 30.0


def test_an_untestable_effect_takes_a_size_that_the_data_so_far_allow(motor):
    record = Experiment(PRBS).run(motor, noise=True, disturbance=0.02, seed=3)
    plain = fitted(motor, [record])
    _, with_it = effect_rivals(plain, "saturation@input", [record], Limits(command=6.0, velocity=30.0))
    assert 2.0 < with_it.values["saturation@input.limit"] < 6.0
    with pytest.raises(InputError, match="motr"):
        effect_rivals(plain, "cogging@motr", [record], Limits())


def test_a_command_that_may_not_jump_does_not(tie):
    record, rivals = tie
    found = suggest(rivals, [record], Limits(rate=15.0), duration=5.0)
    value = found.experiment.built.value
    assert np.max(np.abs(np.diff(value))) <= 15.0 * 0.01 + 1e-9
    assert found.discrimination > 10.0


def test_of_many_effects_those_that_the_limits_let_show_are_shown(motor):
    record = Experiment(PRBS).run(motor, noise=True, disturbance=0.02, seed=3)
    plain = fitted(motor, [record])
    effects = (("dead_zone", "input", {"width": 0.2}), ("saturation", "input", {"limit": 5.0}))
    rivals = [plain, *(plain.with_effect(name, at, **values) for name, at, values in effects)]
    found = suggest(rivals, [record], duration=5.0, against_first=True)
    assert "expected to show dead_zone@input if there; not saturation@input" in found.text
    assert found.outcomes[1].in_favour > 10.0 > found.outcomes[2].in_favour


@pytest.mark.slow
def test_a_ladder_with_a_tie_gets_the_experiment_that_resolves_it(motor):
    """Motion one way only: dry friction, an offset and a dead zone are all the same constant force."""
    one_way = {"name": "multilevel", "sample_time": 0.01, "duration": 10.0, "amplitude": 0.6, "offset": 1.4, "seed": 2}
    record = Experiment(one_way).run(motor.with_effects(["coulomb_friction@motor(level=3)"]), noise=True, seed=1)
    ladder = refine(motor, [record], effects=["coulomb_friction", "input_offset"])
    assert set(ladder.steps[-1].set) == {"coulomb_friction@motor", "input_offset@input"}
    found = suggest_next(ladder, [record], Limits(position=(-20.0, 20.0)), duration=6.0)
    assert found.text.startswith("this data cannot tell")
    assert found.discrimination > 30.0
    assert np.min(found.experiment.built.value) < 0.0 < np.max(found.experiment.built.value)


@pytest.mark.slow
def test_what_a_diagnosis_has_found_is_known_to_the_next_experiment(motor):
    friction = "coulomb_friction@motor"
    record = Experiment(PRBS).run(motor.with_effects([f"{friction}(level=1)"]), noise=True, seed=1)
    found = diagnose(motor, [record], effects=["coulomb_friction", "dead_zone"])
    assert found.set == (friction,)
    assert found.untestable == ("dead_zone@input",)
    suggestion = suggest_next(found, [record], Limits(command=3.0), duration=6.0)
    assert suggestion.text.startswith("this data cannot show dead_zone@input")
    assert [friction in model.effect_names for _, model in suggestion.rivals] == [True, True]


@pytest.mark.slow
def test_in_closed_loop_the_reference_is_excited():
    model = load_model("axis").with_effects(["coulomb_friction@axis(level=0.05)"])
    wave = {"name": "sine", "sample_time": 0.001, "duration": 4.0, "amplitude": 0.3, "frequency": 0.5}
    record = Experiment(wave, "reference", model.controller).run(model, noise=True, disturbance=1e-3, seed=1)
    bare = load_model("axis")
    rivals = [fitted(bare.with_effects([e]), [record]) for e in ("coulomb_friction@axis(level=0.04)",)]
    rivals.append(fitted(bare.with_effects(["dead_zone@input(width=0.04)"]), [record]))
    found = suggest(rivals, [record], duration=3.0)
    assert found.adds_to == "reference"
    assert found.controller == bare.controller
    assert found.discrimination > 10.0
    low, high = found.limits.position
    predicted = found.experiment.run(model)
    assert low - 0.05 < np.min(predicted.output[:, 0]) < np.max(predicted.output[:, 0]) < high + 0.05
    slow = suggest(rivals, [record], Limits(velocity=0.8), duration=3.0)
    assert np.max(np.abs(np.diff(slow.experiment.built.value))) <= 0.8 * 0.001 + 1e-12
    without = [replace(rival, controller=None) for rival in rivals]
    with pytest.raises(InputError, match="controller"):
        suggest(without, [record])


def test_rivals_are_named_by_what_they_do_not_share(motor):
    both = motor.with_effects(["coulomb_friction@motor", "dead_zone@input"])
    one = motor.with_effects(["coulomb_friction@motor"])
    assert labels([both, one]) == ["dead_zone@input", "no further effect"]
    assert labels([one, one]) == ["dc_motor (1)", "dc_motor (2)"]


def test_innovations_of_one_observer_give_those_of_another():
    model = load_model("torsion")
    engine, n = Engine(model), 400
    linear = engine.linearise(None)
    time = np.arange(n) * 1e-3
    command = np.sin(40.0 * time)
    measured = engine.simulate(None, time, command, time)
    noise = np.array([o.noise for o in model.outputs])
    gains = [design(linear.A, linear.C, linear.G, 1e-3, q, noise).gain for q in (1e-6, 1e-2)]
    # The same observer state for both, so that only the gains differ.
    one, other = (engine.predict(None, time, 1.3 * command, time, measured, gain) for gain in gains)
    m = len(linear.A)
    augmented = np.zeros((m + 1, m + 1))
    augmented[:m, :m], augmented[:m, m] = linear.A, linear.G
    transition, _ = discretise(augmented, np.zeros_like(augmented), 1e-3)
    output = np.hstack([linear.C, np.zeros((len(linear.C), 1))])
    found = transfer(one[:, :, None], transition, output, *gains)[:, :, 0]
    np.testing.assert_allclose(found, other, atol=1e-3 * np.max(np.abs(other)))
    assert np.max(np.abs(one - other)) > 0.1 * np.max(np.abs(other))


@pytest.mark.parametrize(
    ("limits", "word"),
    (
        ({"command": -1.0}, "command"),
        ({"velocity": np.nan}, "velocity"),
        ({"position": (1.0, -1.0)}, "lower end"),
    ),
)
def test_invalid_limits_are_refused(limits, word):
    with pytest.raises(InputError, match=word):
        Limits(**limits)


def test_invalid_questions_are_refused(motor, tie):
    record, rivals = tie
    with pytest.raises(InputError, match="two rival"):
        suggest(rivals[:1], [record])
    with pytest.raises(InputError, match="different signals"):
        suggest([rivals[0], load_model("emps")], [record])
    with pytest.raises(InputError, match="widen"):
        suggest(rivals, [record], Limits(velocity=1e-9))


@pytest.mark.slow
def test_where_model_error_is_all_that_is_left_forces_are_compared():
    """A machine measured almost without noise: no disturbance may explain away what its model misses."""
    model = load_model("emps")
    controller = model.controller
    moves = {"points": (1.0, -1.0, 0.3), "velocity_limit": 0.1, "acceleration_limit": 1.0, "dwell": 0.2}
    signal = {"name": "smooth", "sample_time": 0.001, "duration": 8.0, "amplitude": 0.08, **moves}
    truth = model.with_effects(["stribeck_friction@axis(coulomb=18,static=24,velocity=0.01)"])
    record = Experiment(signal, "reference", controller).run(truth, seed=1)
    quiet = np.random.default_rng(0).normal(scale=1e-8, size=record.output.shape)
    record = replace(record, output=record.output + quiet)
    rivals = [
        fit(model.with_effects([effect]), [record], criterion="force").model
        for effect in ("coulomb_friction@axis(level=20)", "asymmetric_friction@axis(level=20)")
    ]
    prepared = prepare_rivals(rivals, [record], "force")
    experiment = Experiment({**signal, "points": (1.0, -1.0)}, "reference", controller, sample_time=0.001)
    by_force, _ = experiment_gains(prepared, experiment)
    assert by_force[0, 1] == 0.0
    shifted = [rivals[0], rivals[1].with_values({"asymmetric_friction@axis.ratio": 0.2})]
    strong, _ = experiment_gains(prepare_rivals(shifted, [record], "force"), experiment)
    assert strong[1, 0] > max(10.0, by_force[1, 0])
    found = suggest(shifted, [record], criterion="force", duration=4.0)
    assert found.outcomes[1].errors["coulomb_friction@axis"]["force[axis]"]["unit"] == "N"


def test_the_pairs_that_an_experiment_separates_are_of_the_rivals_that_it_names() -> None:
    """It named six effects, and six pairs of the four for which it was designed."""
    rivals: Any = [SimpleNamespace(label=name, model=load_model("axis")) for name in ("play", "lag", "drag")]
    gains = np.array([[0.0, 50.0, 50.0], [50.0, 0.0, 0.0], [50.0, 0.0, 0.0]])
    experiment: Any = SimpleNamespace(duration=6.0)
    said = describe(rivals, experiment, Limits(command=1.0, position=(-0.000564, 77.04)), 0.0, gains)
    assert said.startswith("expected to tell 2 of the 3 pairs of play, lag and drag apart; no experiment of 6 s within")
    assert "position −0.000564 to 77 rad" in said
