"""Rows A6, B2 and B9: how answers are judged, and that the experiments can show what they hide."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

import papers
from idloop.errors import InputError
from papers.hidden_effects import Worth, answer, part_of, told_nothing, worth
from papers.motor import drifting_fits
from papers.motor.drifting_fits import DEAD_ZONE, THESIS, implied, thesis_gains, true_motor
from papers.motor.independent_motor import GearedMotor
from papers.torsion import torsion_amplitudes, torsion_effects
from papers.torsion.torsion_effects import ALL, EFFECTS, reference, simulated, torsion


def ladder(model, *steps, candidates=()):
    """A ladder with these rungs: each a name, or several that the data cannot tell apart."""
    start = SimpleNamespace(added=None, set=(), p_value=None, model=model)
    rungs = [SimpleNamespace(added=SimpleNamespace(name=names[0]), set=names, p_value=1e-9) for names in steps]
    added = tuple(names[0] for names in steps)
    return SimpleNamespace(
        steps=[start, *rungs], model=model, candidates=candidates, verdict="adequate", criterion="prediction",
        added=added, untestable=("dead_zone@input",),
    )  # fmt: skip


def test_the_dead_zone_is_read_off_a_table_of_gains():
    gains = {u: 10.0 * (1.0 - 0.12 / u) for u in THESIS}
    assert implied(gains) == pytest.approx((10.0, 0.12))


def test_the_published_gains_hold_a_dead_zone_near_the_measured_one():
    assert implied(thesis_gains())[1] == pytest.approx(DEAD_ZONE, abs=0.01)


def test_friction_takes_its_part_of_the_dead_zone():
    values = true_motor(0.25).values
    friction = values["coulomb_friction@motor.level"] / values["drive.gain"]
    assert values["dead_zone@input.width"] + friction == pytest.approx(DEAD_ZONE)


def test_a_motor_without_effects_follows_its_exponential():
    time = np.arange(50) * 0.1
    found = GearedMotor(gain=8.0, damping=2.0).run(np.full(50, 0.5), 0.1)
    speed = 2.0 * (1.0 - np.exp(-2.0 * time))
    np.testing.assert_allclose(found, np.column_stack([2.0 * time - 0.5 * speed, speed]), atol=1e-12)


@pytest.mark.parametrize("damping", [0.5, 3.0])
def test_dry_friction_stops_the_motor_for_good(damping):
    found = GearedMotor(gain=8.0, damping=damping, friction=1.0).run(np.r_[np.full(20, 0.5), np.zeros(80)], 0.1)
    assert np.all(found[20:, 1] >= 0.0)
    assert found[-1, 1] == 0.0
    assert found[-1, 0] == found[-20, 0]


def test_the_motor_within_its_dead_zone_and_the_potentiometer_within_its_gap_stay_where_they_are():
    idle = GearedMotor(gain=8.0, damping=2.0, dead_zone=0.12).run(np.full(30, 0.119), 0.1)
    assert np.all(idle == 0.0)
    slack = GearedMotor(gain=8.0, damping=2.0, gap=10.0).run(np.full(10, 0.5), 0.1)
    assert np.all(slack[:, 0] == 0.0)
    assert slack[-1, 1] > 0.0


def test_an_answer_is_right_when_all_is_named_and_nothing_else():
    truth = torsion(("offset", "friction"))
    found = answer(ladder(truth, ("coulomb_friction@motor",), ("load_torque@motor", "input_offset@input")), truth, 1.0)
    assert found.right
    assert [rung.how for rung in found.rungs] == ["found", "in the set"]
    assert found.words == "coulomb_friction@motor; load_torque@motor or input_offset@input"


def test_a_constant_torque_is_held_against_the_offset_that_it_stands_for():
    truth = torsion(("offset",))
    model = torsion(()).with_effect("load_torque", "motor", torque=0.003)
    (rung,) = answer(ladder(model, ("load_torque@motor", "input_offset@input")), truth, 1.0).rungs
    assert rung.estimates[0].true == pytest.approx(0.0397 * 0.0742)


@pytest.mark.parametrize("named", [(), ("slip@motor-load1", "dead_zone@input")])
def test_an_answer_is_wrong_when_something_is_missed_or_false(named):
    truth = torsion(("slip",))
    assert not answer(ladder(truth, *((name,) for name in named)), truth, 1.0).right


def test_a_phase_is_compared_on_the_circle():
    truth = torsion(("imbalance",))
    turned = truth.with_values({"imbalance@motor.phase": 0.4 - 2.0 * math.pi})
    (rung,) = answer(ladder(turned, ("imbalance@motor",)), truth, 1.0).rungs
    phase = next(e for e in rung.estimates if e.name == "phase")
    assert phase.value == pytest.approx(0.4)


def test_a_start_model_is_told_nothing():
    true = torsion(())
    start = told_nothing(true, 3)
    moved = [abs(start.values[name] / true.values[name] - 1.0) for name in true.free]
    assert min(moved) >= 0.2 - 1e-9
    assert max(moved) <= 0.4 + 1e-9


def test_progress_of_a_part():
    told = []
    part_of(lambda share, text: told.append((share, text)), 1, 4)(0.5, "x")
    assert told == [(0.375, "x")]


@pytest.mark.slow
def test_the_experiments_on_the_torsion_system_can_show_what_they_hide():
    truth = torsion(ALL)
    moves, steps = (simulated(truth, reference(kind, 1.0, 5), 5) for kind in ("moves", "steps"))
    assert np.ptp(moves.output[:, 0]) > 2.0 * 2.0 * np.pi
    assert np.max(np.abs(steps.input)) > EFFECTS["saturation"][2]["limit"]
    assert np.ptp(steps.output[:, 0] - steps.output[:, 1]) > 2.0 * EFFECTS["slip"][2]["limit"]
    # The error of the drive's torque, by which the models are judged, tells them apart.
    assert worth(truth, [steps]).force < 0.5 * worth(torsion(()), [steps]).force


def test_a_case_of_the_torsion_system_is_told_from_end_to_end(complete):
    truth = torsion(("friction",))
    found = answer(ladder(truth, ("coulomb_friction@motor",)), truth, 1.0)
    worths = {
        torsion_effects.LINEAR: Worth(10.0, 20.0),
        torsion_effects.WITH_EFFECTS: Worth(90.0, 5.1),
        torsion_effects.TRUE: Worth(91.0, 5.0),
    }
    complete(torsion_effects.TorsionEffects((torsion_effects.TorsionCase("friction", 0.01, 0, found, worths),)))


def test_the_amplitudes_of_the_torsion_system_are_told_from_end_to_end(complete):
    truth = torsion(ALL)
    found = answer(ladder(truth, *((name,) for name in truth.effect_names)), truth, 1.0)
    names = (torsion_amplitudes.LINEAR_SMALL, torsion_amplitudes.LINEAR_LARGE, torsion_effects.WITH_EFFECTS,
             torsion_effects.TRUE)  # fmt: skip
    plain = torsion(())
    models = dict(zip(names, (plain, plain, truth, truth), strict=True))
    shares = (torsion_amplitudes.SMALL, torsion_amplitudes.THIRD, torsion_amplitudes.LARGE)
    worths = {
        name: {u: Worth(50.0, force) for u in shares} for name, force in zip(names, (30.0, 25.0, 5.0, 5.0), strict=True)
    }
    shown = simulated(truth, reference("steps", 0.9, 5), 5)
    complete(torsion_amplitudes.TorsionAmplitudes(0.01, 0, found, models, worths, shown))


@pytest.mark.parametrize("name", drifting_fits.FRICTION)
def test_the_drift_of_linear_fits_is_told_from_end_to_end(name, complete, monkeypatch, silent):
    """All but the search for the effects, which the diagnosis's own tests have: here it is told the answer."""

    def told(start, truth, training, validation, progress, level):
        model = truth if len(training) > 1 else start
        added = [(effect,) for effect in model.effect_names]
        steps = ladder(model, *added)
        steps.steps[0].model = start.with_values({"drive.gain": 12.0, "motor.viscous_friction": 1.5})
        return answer(steps, truth, 1.0)

    monkeypatch.setattr(drifting_fits, "climb", told)
    complete(drifting_fits.reproduce(1, silent, (name,)))


@pytest.mark.parametrize(
    ("row", "parts", "words"),
    [("B2", ("frction",), "no part 'frction'.*friction"), ("A1", ("x",), "has no parts"), ("a6", ("",), "no part ''")],
)
def test_a_part_that_is_not_there_is_one_line(row, parts, words):
    with pytest.raises(InputError, match=words) as caught:
        papers.reproduce(row, parts=parts)
    assert "\n" not in str(caught.value)
