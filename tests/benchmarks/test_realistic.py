"""The realistic cases hold what they promise: real drives, dominant effects, and small things beside them."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from by_drive import LONGEST_STEP, DriveMachine
from by_equations import EquationsMachine
from drive_oracle import WORTH, worth
from experiment import experiment, record, sent, simulated, start_model, true_model
from machines import base_model
from nuisances import stamps, ticks
from plain import plain
from realistic import RULES, realistic
from score import Rung, score
from simulators import run
from sizes import sizes


@pytest.fixture(scope="module")
def cases():
    return list(realistic())


def shortest(cases, chosen):
    return min(filter(chosen, cases), key=lambda c: c.rate * c.duration * len(c.training))


def test_at_least_150_cases_of_none_one_and_two_effects(cases):
    count = Counter(len(case.hidden) for case in cases)
    assert len(cases) >= 150
    assert count[0] >= 20
    assert count[1] >= 80
    assert count[2] >= 40
    # Along a length, cogging is a force with a pitch.
    assert {hidden.effect for case in cases for hidden in case.hidden} == {*RULES, "periodic_force"}
    assert min(Counter(case.loop for case in cases).values()) >= 50


def test_records_are_as_long_as_real_ones_and_the_unseen_one_has_another_excitation(cases):
    for case in cases:
        assert 1 <= len(case.training) <= 4
        assert 5.0 <= case.duration <= 30.0
        assert 100.0 <= case.rate <= 1000.0
        assert case.validation.kind not in {drive.kind for drive in case.training}


def test_cases_are_drawn_anew_as_they_were(cases):
    assert {case.id: case for case in realistic()} == {case.id: case for case in cases}


def test_one_seed_gives_one_experiment(cases):
    case = shortest(cases, lambda c: c.loop == "closed" and c.hidden)
    first, again, other = experiment(case), experiment(case), experiment(case, suite=2)
    assert np.array_equal(first.training[0].output, again.training[0].output)
    assert np.array_equal(first.training[0].time, again.training[0].time)
    assert not np.array_equal(first.training[0].output, other.training[0].output)
    assert first.start.effect_names == ()


def test_every_machine_has_the_small_things(cases):
    for case in cases:
        own = case.nuisances
        assert own.friction > 0.0
        assert own.reach > 0.0
        assert own.break_away > 1.0
        assert own.counts[0] > 0.0
        assert 200.0 <= own.current_loop <= 1000.0
        assert own.delay > 0.0
        assert np.isfinite(own.limit)
        assert own.supply_ripple > 0.0
        assert own.tick_jitter > 0.0
        assert own.stamp_jitter > 0.0
        assert len(own.torque_ripple) == 3
        assert own.unexplained > 0.0


def test_small_things_are_below_the_dominant_ones(cases):
    levels = {"coulomb_friction": "level", "stribeck_friction": "coulomb", "imbalance": "amplitude"}
    seen = 0
    for case in cases:
        own = case.nuisances
        for hidden in case.hidden:
            if hidden.effect in levels:
                seen += 1
                force = hidden.values[levels[hidden.effect]]
                assert max(own.friction, own.unexplained, *(wave[0] for wave in own.torque_ripple)) < 0.51 * force
    assert seen > 30


def test_positions_are_whole_counts_and_the_velocity_is_their_difference(cases):
    case = shortest(cases, lambda c: c.nuisances.velocity_filter == 0.0 and "bare" not in c.machine)
    shown = record(case, case.training[0], 1, "training0")
    place = shown.output[:, 0]
    counts = place / case.nuisances.counts[0]
    assert np.max(np.abs(counts - np.rint(counts))) < 1e-6
    assert shown.output[1:, 1] == pytest.approx(np.diff(place) * case.rate, abs=1e-9 * case.rate)
    filtered = replace(case, nuisances=replace(case.nuisances, velocity_filter=2.0 / case.rate))
    smooth = record(filtered, case.training[0], 1, "training0").output[:, 1]
    assert np.std(np.diff(smooth)) < 0.7 * np.std(np.diff(shown.output[:, 1]))


def test_samples_and_stamps_jitter_and_never_pass_each_other(cases):
    for case in cases[:30]:
        taken = ticks(case.nuisances, case.rate, 2000, 1)
        told = stamps(case.nuisances, taken[:-1], case.rate, 2)
        assert np.all(np.diff(taken) > LONGEST_STEP)
        assert np.all(np.diff(told) > 0.0)
        assert np.std(np.diff(told)) * case.rate > 0.002
        assert np.std(np.diff(told - taken[:-1])) > 0.0


@pytest.mark.parametrize(
    ("machine", "effects"),
    [
        ("gimbal", ()),
        ("belt", ()),
        ("gimbal", ("coulomb_friction@axis(level=0.03)",)),
        ("gimbal", ("stribeck_friction@axis(coulomb=0.02,static=0.04,velocity=0.5)",)),
        ("gimbal", ("asymmetric_friction@axis(level=0.03,ratio=0.3)",)),
        ("gimbal", ("compliance@axis(stiffness=5,damping=0.01,split=0.4)", "cogging@axis(amplitude=0.01,harmonic=6)")),
        (
            "gimbal",
            ("dead_zone@input(width=0.03)", "input_offset@input(offset=0.02)", "input_delay@input(delay=0.004)"),
        ),
        ("gimbal", ("saturation@input(limit=0.1)", "cable_spring@axis(stiffness=0.02,rest=0.3)")),
        ("belt", ("backlash@motor-disc(gap=0.05)", "load_torque@disc(torque=0.02)", "imbalance@disc(amplitude=0.02)")),
    ],
)
def test_without_the_small_things_it_agrees_with_the_equations(machine, effects):
    model = base_model(machine, 500.0, "open").with_effects(effects)
    command = np.repeat(np.random.default_rng(0).uniform(-1.0, 1.0, 12), 50) * 0.2
    if machine == "belt":
        command *= 10.0
    quiet, still = np.zeros((len(command), len(model.outputs))), np.zeros(len(command))
    places = [i for i, output in enumerate(model.outputs) if output.field == "position"]
    ours = DriveMachine(plain(model), None, np.arange(len(command) + 1) / 500.0, 500.0)
    theirs = EquationsMachine(plain(model), 1.0 / 500.0, len(command))
    shown, wanted = (run(each, command, None, quiet, still, None)[1][:, places] for each in (ours, theirs))
    assert np.max(np.abs(shown - wanted)) < 3e-3 * np.std(wanted)


def still_drive(cases, **changes):
    """A drive whose friction holds it, driven for half a second and left alone for another."""
    case = next(c for c in cases if c.machine == "gimbal" and not c.hidden)
    own = replace(case.nuisances, friction=0.05, reach=1e-3, supply_ripple=0.0, unexplained=0.0, **changes)
    built = DriveMachine(plain(base_model("gimbal", 500.0, "open")), own, np.arange(501) / 500.0, 500.0)
    run(built, np.repeat([0.04, 0.0], 250), None, np.zeros((500, 2)), np.zeros(500), None)
    return built.states[:, 0]


def test_below_break_away_a_body_gives_like_a_spring_and_comes_back(cases):
    place = still_drive(cases, torque_ripple=())
    assert 3e-4 < place[250] < 3e-3
    # Dahl: 80 % of the level bends 1.6 of the reach, of which 0.8 are elastic
    assert 0.2 * place[250] < place[500] < 0.8 * place[250]


@pytest.mark.parametrize(
    "change",
    [
        {"supply_ripple": 0.0},
        {"unexplained": 0.0},
        {"torque_ripple": ()},
        {"current_loop": 1e5},
        {"delay": 0.0},
        {"friction": 0.0},
        {"limit": 0.01},
        {"tick_jitter": 0.0},
        {"break_away": 1.0},
    ],
)
def test_each_small_thing_moves_the_machine(cases, change):
    case = shortest(cases, lambda c: not c.hidden and c.loop == "open")
    with_it = record(case, case.training[0], 1, "training0")
    without = record(replace(case, nuisances=replace(case.nuisances, **change)), case.training[0], 1, "training0")
    assert np.max(np.abs(with_it.output[:, 0] - without.output[:, 0])) > 3.0 * case.nuisances.counts[0]


@pytest.mark.slow
def test_dominant_effects_are_worth_their_name(cases):
    quick = sorted((c for c in cases if c.hidden), key=lambda c: c.rate * c.duration * len(c.training))[:4]
    for case in quick:
        assert min(worth(case).values()) > WORTH, case.id


def test_what_is_not_there_is_worth_nothing(cases):
    case = shortest(cases, lambda c: c.truth == ("saturation@input",) and c.loop == "open")
    out_of_reach = replace(case.hidden[0], values={"limit": 1e3})
    assert abs(worth(replace(case, hidden=(out_of_reach,)))["saturation@input"]) < 0.01


def judge(case, *sets):
    rungs = [Rung(names[0], tuple(names), None, 0.0, 10.0) for names in sets]
    return score(case, start_model(case, 1), rungs)


def test_small_things_may_be_named_and_nothing_else(cases):
    case = next(c for c in cases if not c.hidden and c.machine == "gimbal")
    for name in ("presliding_friction@axis", "sensor_quantisation@position[axis]", "velocity_filter@velocity[axis]",
                 "actuator_lag@input", "input_delay@input", "cogging@axis", "cogging#2@axis"):  # fmt: skip
        assert judge(case, [name]).false == (), name
    for name in ("load_torque@axis", "dead_zone@input", "gravity@axis", "quadratic_drag@axis", "compliance@axis"):
        assert judge(case, [name]).false == (name,)


def test_richer_friction_holds_the_plainer_one(cases):
    dry = next(c for c in cases if c.truth == ("coulomb_friction@axis",))
    assert judge(dry, ["presliding_friction@axis"]).found == (True,)
    assert judge(dry, ["stribeck_friction@axis"]).found == (True,)
    falling = next(c for c in cases if c.hidden and c.hidden[0].effect == "stribeck_friction" and len(c.hidden) == 1)
    at = falling.hidden[0].at
    plainer = judge(falling, [f"coulomb_friction@{at}"])
    assert plainer.found == (False,)
    assert plainer.false == ()
    assert judge(falling, [f"presliding_friction@{at}"]).found == (True,)


@pytest.mark.slow
def test_every_machine_moves_and_none_runs_away(cases):
    for case in cases[:25]:
        _, built, _ = simulated(case, true_model(case), *sent(case, case.training[0], 1, "t"), 1, "t")
        place = built.states[:, 0]
        usual = sizes(case.machine, case.loop, case.training[0]).stroke
        assert 30.0 * case.nuisances.counts[0] < np.std(place)
        # what a constant force adds in open loop grows with the time
        assert np.std(place) < 10.0 * case.duration * usual, case.id
