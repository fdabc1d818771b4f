"""Where a model fails, on axes with a hidden effect: the error falls where the physics says it must."""

from __future__ import annotations

import json
import sys
from dataclasses import replace

import numpy as np
import pytest

import idloop
from idloop.errors import IdloopError
from idloop.physics import Model, load_model, simulate
from idloop.physics.model_file import from_text
from idloop.records import Record
from idloop.validation import Comparison, compare, share_measures
from idloop.validation.error_choice import drift
from idloop.validation.variables import VARIABLES
from idloop.validation.where import DRIVE_FORCE, NOISE_ALONE

TIME = np.arange(0.0, 12.0, 2e-3)
NOISE = 2e-4


def swept(amplitude: float = 5.0, seed: int = 3) -> np.ndarray:
    """A smooth command with many amplitudes."""
    random = np.random.default_rng(seed)
    frequency = np.array([0.23, 0.41, 0.83, 1.31])
    phase = random.uniform(0.0, 2.0 * np.pi, 4)
    return np.asarray(amplitude / 2.0 * np.sum(np.sin(2.0 * np.pi * frequency * TIME[:, None] + phase), axis=1))


def recorded(model: Model, command: np.ndarray, disturbance: float = 0.0) -> Record:
    random = np.random.default_rng(5)
    walk = disturbance * np.cumsum(random.normal(size=len(TIME)))
    output = simulate(model, TIME, command + walk, TIME).output
    output = output + NOISE * random.normal(size=output.shape)
    units = tuple(o.unit for o in model.outputs)
    return Record(
        "hidden", TIME, command, TIME, output, model.input.name, model.input.unit, model.output_names, units,
        start_ns=1_700_000_000_000_000_000,
    )  # fmt: skip


def hiding(effect: str, command: np.ndarray | None = None) -> Comparison:
    """The plain model beside a record in which an effect acts."""
    plain = load_model("dc_motor")
    return compare(plain, recorded(plain.with_effects([effect]), swept() if command is None else command))


@pytest.fixture(scope="module")
def friction() -> Comparison:
    return hiding("coulomb_friction@motor(level=4)")


def test_an_error_as_large_as_the_stated_noise_may_be_all_noise() -> None:
    plain = load_model("dc_motor")
    text = plain.to_yaml().replace("noise: 0.0332", f"noise: {NOISE}").replace("noise: 0.0728", f"noise: {10 * NOISE}")
    found = compare(from_text(text, None), recorded(plain, swept())).where
    assert found["motor.position"].why == NOISE_ALONE
    assert found["motor.velocity"].why == "", "what is stated is ten times what the sensor has"


def test_noise_that_is_large_and_not_all_of_the_force_error_is_said_by_its_size() -> None:
    """Beside a curve over the command that made up 46 % of it, noise was said to be all of it."""
    plain = load_model("dc_motor")
    noisy = recorded(plain.with_effects(["coulomb_friction@motor(level=6)"]), swept())
    noise = np.random.default_rng(6).normal(size=noisy.output.shape)
    found = compare(plain, replace(noisy, output=noisy.output + [0.05, 0.8] * noise))
    assert found.force is not None
    assert not found.force.trusted
    assert found.force.noise < found.force.relative
    why = found.where[DRIVE_FORCE].why
    assert why.startswith("sensor noise alone makes ")
    assert why.endswith(" % of the commanded force")


def test_all_variables_of_all_errors_are_there_and_their_shares_add_up(friction: Comparison) -> None:
    assert [one.name for one in friction.where.maps] == [DRIVE_FORCE, "motor.position", "motor.velocity"]
    for one in friction.where.maps:
        assert tuple(b.variable for b in one.breakdowns) == VARIABLES
        assert one.left_out == {}
        for breakdown in one.breakdowns:
            assert np.sum(breakdown.error) == pytest.approx(1.0)
            assert np.sum(breakdown.usual) == pytest.approx(1.0)
            if breakdown.variable != "frequency":
                filled = breakdown.usual > 0.0
                power = breakdown.usual[filled] @ breakdown.rms[filled] ** 2
                assert power == pytest.approx(one.rms**2)


def follows(comparison: Comparison) -> dict[str, float]:
    return {b.variable: b.follows for b in comparison.where[DRIVE_FORCE].breakdowns}


def test_dry_friction_is_a_curve_over_velocity(friction: Comparison) -> None:
    found = follows(friction)
    assert found["velocity"] > 0.8
    assert found["direction"] > 0.8
    assert found["position"] < 0.2
    curve = friction.where[DRIVE_FORCE].along("velocity")
    assert curve is not None
    assert curve.edges is not None
    outer = np.abs(curve.edges[1:] + curve.edges[:-1]) > 2.0
    level = np.sign(curve.edges[1:] + curve.edges[:-1])[outer] * curve.mean[outer]
    np.testing.assert_allclose(level, 4.0, atol=0.8)


def test_a_dead_zone_is_a_curve_over_the_command() -> None:
    found = follows(hiding("dead_zone@input(width=0.5)"))
    assert found["command"] > 0.8
    assert found["command"] > found["velocity"]


def test_imbalance_is_a_curve_over_the_turn() -> None:
    found = follows(hiding("imbalance@motor(amplitude=4)", swept() + 2.0))
    assert found["position"] > 0.8
    assert found["velocity"] < 0.3


def test_a_bump_at_one_time_is_found_there() -> None:
    plain = load_model("dc_motor")
    record = recorded(plain, swept())
    known = (record.time >= 6.0) & (record.time < 6.3)
    pushed = record.output + np.where(known, 0.5, 0.0)[:, None] * [0.0, 1.0]
    where = compare(plain, replace(record, output=pushed)).where["motor.velocity"]
    worst = where.stretches[0]
    assert (worst.start, worst.stop) == (pytest.approx(6.0, abs=0.05), pytest.approx(6.3, abs=0.05))
    assert worst.start_ns == pytest.approx(1_700_000_006_000_000_000, abs=50_000_000)
    assert worst.error > 0.9
    time = where.along("time")
    assert time is not None
    assert time.worst.text.startswith("100 % of the error falls in the 10 % of the time from 6 to 7.2 s")


def test_a_free_run_that_drifts_gives_way_to_a_prediction() -> None:
    plain = load_model("dc_motor")
    where = compare(plain, recorded(plain, swept(0.5), disturbance=0.01), steps=25).where
    position = where["motor.position"]
    assert position.basis == "ahead"
    assert "drifts" in position.why or "exceeds" in position.why
    assert "25 steps (0.05 s)" in position.kind
    assert any("a prediction is analysed instead" in line for line in where.lines())


def test_a_free_run_that_does_not_stay_finite_gives_way_to_a_prediction(monkeypatch: pytest.MonkeyPatch) -> None:
    def away(*_: object) -> None:
        raise IdloopError("the free run does not stay finite")

    plain = load_model("dc_motor")
    monkeypatch.setattr(sys.modules["idloop.validation.runs"], "free_run", away)
    result = compare(plain, recorded(plain, swept()))
    assert np.all(np.isnan(result.simulated))
    assert {one.basis for one in result.where.maps} == {"force", "ahead"}
    assert "does not stay finite" in result.where["motor.position"].why
    assert result.share == {}
    json.dumps(result.to_dict(), allow_nan=True)


def test_models_are_compared_by_one_error() -> None:
    """The free run of one drifts, that of the other does not: both are looked at by the prediction."""
    plain = load_model("dc_motor")
    true = plain.with_effects(["load_torque@motor(torque=2)"])
    record = recorded(true, swept())
    drifting, right = compare(plain, record), compare(true, record)
    share_measures([drifting, right])
    first, second = (one.where["motor.position"] for one in (drifting, right))
    assert compare(true, record).where["motor.position"].basis == "free_run"  # by itself
    assert (first.basis, first.kind) == (second.basis, second.kind) == ("ahead", first.kind)
    assert second.why == "as of a model whose free run drifts"
    # And a model that takes the place of another one keeps its error, whatever would suit it.
    kept = compare(plain, record, measures={"motor.position": "free_run"}).where
    assert kept["motor.position"].basis == "free_run"
    assert "it is analysed all the same" in kept["motor.position"].why
    assert kept.measures["motor.position"] == "free_run"


def test_what_is_not_measured_is_left_out_and_said(friction: Comparison) -> None:
    output = friction.record.output.copy()
    output[:, 0] = np.nan
    where = compare(friction.model, replace(friction.record, output=output)).where
    assert [one.name for one in where.maps] == [DRIVE_FORCE, "motor.velocity"]
    assert where["motor.velocity"].left_out == {"position": "no position is measured"}
    with pytest.raises(KeyError):
        where["motor.position"]


def test_a_constant_command_and_one_direction_are_left_out() -> None:
    plain = load_model("dc_motor")
    where = compare(plain, recorded(plain, np.full(len(TIME), 3.0)).cut(1.0, 11.0)).where
    assert where["motor.position"].left_out["command"] == "the command never changes"


def test_text_and_json_say_the_same(friction: Comparison) -> None:
    where = friction.where
    document = json.loads(json.dumps(where.to_dict(), allow_nan=False))
    assert set(document) == {DRIVE_FORCE, "motor.position", "motor.velocity"}
    force = document[DRIVE_FORCE]
    assert set(force["share"]) == set(VARIABLES)
    assert force["basis"] == "force"
    assert force["unit"] == "N·m"
    text = "\n".join(where.lines())
    for one in document.values():
        for breakdown in one["share"].values():
            assert (breakdown["worst"]["text"] in text) == breakdown["stands_out"]
            assert sum(b["error"] for b in breakdown["bins"]) == pytest.approx(1.0)
    assert "share explained by a function of one variable" in text
    assert friction.to_dict()["where"].keys() == document.keys()


def test_only_lasting_departure_counts_as_drift() -> None:
    time = np.arange(0.0, 10.0, 0.01)
    motion = np.sin(2.0 * np.pi * time)
    assert drift(time, motion, 0.1 * np.sin(14.0 * time)) == ""
    assert drift(time, motion, np.full(len(time), 0.2)) == ""
    assert "drifts" in drift(time, motion, 0.05 * time)
    assert "exceeds" in drift(time, motion, 2.0 * motion)
    assert "finite" in drift(time, motion, np.where(time < 5.0, 0.0, np.nan))
    # A slow motion may well have a slow error.
    assert drift(time, time, 0.05 * time) == ""


@pytest.mark.parametrize(("friction", "noise"), [(0.0, True), (3.0, False)])
def test_a_force_error_that_sensor_noise_accounts_for_is_said_to_be_one(friction: float, noise: bool) -> None:
    model = load_model("dc_motor")
    machine = model.with_effects([f"coulomb_friction@motor(level={friction})"])
    signal = idloop.excitation("multilevel", sample_time=0.005, duration=20.0, amplitude=3.0, seed=1)
    found = compare(model, idloop.simulate(machine, signal, seed=1))
    assert bool(found.where[DRIVE_FORCE].why) is noise
