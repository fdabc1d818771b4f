"""Effects by the force balance: on every body, in coarse windows first, beside a curve that explains far more."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.diagnosis.conftest import axis_by_current, record_of

from idloop.diagnosis.diagnosis import diagnosis_of
from idloop.diagnosis.evidence import force_view
from idloop.diagnosis.evidence.deciding_view import requested_force_fit
from idloop.diagnosis.evidence.force_evaluation import Evaluator
from idloop.diagnosis.evidence.force_view import ForceView, unbalanced
from idloop.diagnosis.options import Options
from idloop.diagnosis.refine import refine
from idloop.diagnosis.residual_curves.periods import harmonics
from idloop.diagnosis.screening.proposals import proposals
from idloop.estimation.dataset import prepare
from idloop.estimation.likelihood.estimation_problem import prepare_estimation
from idloop.physics import Model, load_model
from idloop.physics.model_file import build_model
from idloop.physics.schema import read_model_file
from idloop.physics.simulation import simulate
from idloop.records import Record, read_record
from idloop.records.tables.importing import import_bag

TWO_BODIES = """\
schema: idloop/model/1
name: gear
input: {topic: command, joint: motor, field: effort, unit: N·m}
outputs:
  - {topic: states, joint: motor, field: position, unit: rad, noise: 1.0e-5}
  - {topic: states, joint: load, field: position, unit: rad, noise: 1.0e-5}
bodies:
  - {name: motor, inertia: {value: 0.01}, viscous_friction: {value: 0.05}}
  - {name: load, inertia: {value: 0.02}, viscous_friction: {value: 0.03}}
couplings:
  - {from: motor, to: load, stiffness: {value: 30.0}, damping: {value: 0.05}}
"""


def gear() -> Model:
    return build_model(read_model_file(TWO_BODIES, "gear.yaml"), "gear.yaml")


def turned(machine: Model, seed: int = 1, rate: float = 500.0, seconds: float = 20.0) -> Record:
    """Smooth motion over some turns with a little noise."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, seconds, 1.0 / rate)
    command = sum(a * np.sin(2.0 * np.pi * f * time + p) for a, f, p in zip(
        rng.uniform(0.3, 0.8, 5), rng.uniform(0.1, 2.0, 5), rng.uniform(0.0, 6.0, 5), strict=True
    ))  # fmt: skip
    noise = np.column_stack([rng.normal(size=len(time)) * float(o.noise or 0.0) for o in machine.outputs])
    output = simulate(machine, time, command, time, noise=noise).output
    names, units = tuple(o.name for o in machine.outputs), tuple(o.unit for o in machine.outputs)
    return Record(f"run{seed}", time, command, time, output, "motor.effort", machine.input.unit, names, units)


def simulated(machine: Model, time: np.ndarray, command: np.ndarray) -> np.ndarray:
    noise = np.random.default_rng(5).normal(size=(len(time), len(machine.outputs)))
    return simulate(machine, time, command, time, noise=noise * [float(o.noise or 0.0) for o in machine.outputs]).output


def evaluated(model: Model, record: Record, effects: list[str] | None = None) -> force_view.ForceStep:
    estimation = prepare_estimation(model, [record], "prediction")
    step = ForceView(estimation, Options(effects=effects)).evaluate(requested_force_fit(model, estimation, {}))
    assert isinstance(step, force_view.ForceStep)
    return step


def test_an_effect_on_a_body_without_a_drive_is_named():
    machine = gear().with_effects(["imbalance@load(amplitude=0.1, phase=0.4)"])
    step = evaluated(gear(), turned(machine), ["imbalance", "coulomb_friction", "load_torque"])
    assert step.names == ("imbalance@load",)
    best = step.tied[0]
    assert best.fit.relative_by_body[0] == pytest.approx(
        step.parent.relative_by_body[0], abs=1e-3
    )  # nothing changes at the motor
    assert best.fit.relative_by_body[1] < 0.2 * step.parent.relative_by_body[1]
    assert best.fit.model.values["imbalance@load.amplitude"] == pytest.approx(0.1, rel=0.02)


@pytest.mark.slow
def test_coarse_windows_change_no_answer(monkeypatch):
    machine = load_model("axis").with_effects(["coulomb_friction@axis(level=0.05)", "imbalance@axis(amplitude=0.1)"])
    record = turned(machine, rate=1000.0)
    quick = evaluated(load_model("axis"), record)
    monkeypatch.setattr(force_view, "_COARSE_WINDOWS", 10**9)
    whole = evaluated(load_model("axis"), record)
    assert len(quick.parent.rows) > 3_000
    assert quick.names == whole.names
    assert quick.tied[0].evidence.log == pytest.approx(whole.tied[0].evidence.log, rel=1e-3)
    behind = [one for one in quick.evaluated if one.names not in {tied.names for tied in quick.tied}]
    assert any(one.fit.jacobian.size == 0 for one in behind)  # judged by the values of a glance
    best = quick.tied[0].scores
    assert all(best.against(one.scores).distinguishable for one in behind)


@pytest.mark.parametrize(("harmonic", "shortest", "longest"), [(14, 1.0, 3.0), (40, 0.3, 1.0)])
def test_a_wave_as_short_as_a_window_is_found(harmonic, shortest, longest):
    """At the speed of the motion a period lasts less than some windows: slower windows show it."""
    machine = load_model("axis").with_effects([f"cogging@axis(amplitude=0.08, harmonic={harmonic}, phase=0.8)"])
    record = turned(machine, rate=250.0)
    speed = float(np.sqrt(np.mean(record.output[:, 1] ** 2)))
    assert shortest < 2.0 * np.pi / harmonic / speed * 250.0 / 7 < longest
    estimation = prepare_estimation(load_model("axis"), [record], "prediction")
    found, tried = harmonics(requested_force_fit(load_model("axis"), estimation, {}), 0)
    assert found[0] == harmonic
    assert tried >= harmonic - 1


def test_of_several_waves_the_one_of_unseen_samples_is_named():
    """A wave that one record has explains more of the samples that it is fitted to than one that all records have."""
    usual = "cogging@axis(amplitude=0.03, harmonic=12, phase=0.8)"
    model = load_model("axis")
    other = "cogging@axis(amplitude=0.13, harmonic=17, phase=0.3)"
    records = [turned(model.with_effects(waves), 1, rate=250.0) for waves in ([usual], [usual, other])]
    estimation = prepare_estimation(model, records, "prediction")
    fit = requested_force_fit(model, estimation, {})
    assert harmonics(fit, 0)[0][0] == 17
    step = ForceView(estimation, Options(effects=["cogging"])).evaluate(fit)
    assert [one.fit.model.values["cogging@axis.harmonic"] for one in step.tied] == [12.0]


def test_a_force_that_repeats_along_a_length_is_named_with_its_period():
    model = load_model("emps")
    machine = model.with_effects(["periodic_force@axis(amplitude=5.0, period=0.0123, phase=0.8)"])
    record = turned(replace(machine, outputs=(replace(machine.outputs[0], noise=1e-6),)), rate=500.0)
    step = evaluated(model, record)
    assert step.names == ("periodic_force@axis",)
    values = step.tied[0].fit.model.values
    assert values["periodic_force@axis.amplitude"] == pytest.approx(5.0, rel=0.05)
    assert values["periodic_force@axis.period"] == pytest.approx(0.0123, rel=1e-3)
    assert "periodic_force@axis" not in [one.name for one in proposals(load_model("axis"))]


@pytest.mark.parametrize(
    ("stiffness", "forces", "named"),
    [
        (0.5, ["periodic_force@axis(amplitude=0.08, period=0.4304, phase=0.8)"], "periodic_force@axis"),
        (1.0, [f"cogging@axis(amplitude=0.05, harmonic={n}, phase=0.8)" for n in (14, 15)], "cogging@axis"),
    ],
)
def test_over_few_turns_a_period_between_two_harmonics_is_told_from_both_of_them(stiffness, forces, named):
    """A motor behind a gear has 14.6 waves to the turn of its axis."""
    model = load_model("axis").with_effects([f"cable_spring@axis(stiffness={stiffness})"])
    record = turned(model.with_effects(forces), rate=500.0)
    assert 1.0 < float(np.ptp(record.output[:, 0])) / (2.0 * np.pi) < 2.0
    step = evaluated(model, record)
    assert step.names == (named,)
    values = step.tied[0].fit.model.values
    if named == "periodic_force@axis":
        assert values["periodic_force@axis.period"] == pytest.approx(0.4304, rel=1e-3)
        assert values["periodic_force@axis.amplitude"] == pytest.approx(0.08, rel=0.05)
    else:
        assert values["cogging@axis.harmonic"] in (14.0, 15.0)


def test_predictions_weigh_sensors_and_splits():
    model = load_model("axis")
    alone = unbalanced(model, None, {})
    assert "compliance@axis" in alone
    assert "sensor_delay@position[axis]" in alone
    assert "input_delay@input" in alone  # the balance finds the time at which commands act by itself
    assert not {"coulomb_friction@axis", "dead_zone@input"} & set(alone)


def test_an_effect_beside_a_curve_is_judged_by_what_it_adds(start: Model):
    record = record_of(load_model("axis").with_effects(["coulomb_friction@axis(level=0.1)"]), 3)
    step = evaluated(start, record)
    assert not step.beside  # no curve explains far more than the friction itself
    friction = next(one for one in step.evaluated if one.names == ("coulomb_friction@axis",))
    over_velocity = next(c for c in step.residual_curves if c.text == "a force over the velocity")
    assert over_velocity.beside(friction).evidence.difference < 0.5 * friction.evidence.difference
    over_position = next(c for c in step.residual_curves if c.text == "a force over the position")
    assert over_position.beside(friction).evidence.difference > 0.5 * friction.evidence.difference


def test_held_out_records_that_move_otherwise_do_not_hide_an_effect():
    """Their errors are larger, for the model lacks more there; they are smaller with the effect all the same."""
    machine = load_model("axis").with_effects(["load_torque@axis(torque=0.1)"])
    rough = machine.with_effects(["coulomb_friction@axis(level=0.03)"])
    estimation = prepare_estimation(load_model("axis"), [turned(machine, 1)], "prediction")
    held_out = prepare(load_model("axis"), [turned(rough, 2)])
    step = ForceView(estimation, Options(effects=["load_torque"]), held_out).evaluate(
        requested_force_fit(load_model("axis"), estimation, {})
    )
    assert step.names == ("load_torque@axis",)
    assert step.tied[0].held_out is not None
    assert step.tied[0].held_out > 0.0


def test_a_standstill_in_held_out_records_speaks_for_the_friction_that_holds_the_body():
    """Its windows count by their motion, which says less than a command where the body moves at steady speeds."""
    light = TWO_BODIES.replace("inertia: {value: 0.01}", "inertia: {value: 0.0002}")
    model = build_model(read_model_file(light, "light.yaml"), "light.yaml")
    machine = model.with_effects(["coulomb_friction@motor(level=0.2)", "imbalance@motor(amplitude=0.1,phase=0.5)"])
    time = np.arange(0.0, 12.0, 0.004)

    def stepped(levels: list[float], name: str) -> Record:
        command = np.repeat(levels, len(time) // len(levels))
        output = simulated(machine, time, command)
        names, units = tuple(o.name for o in machine.outputs), tuple(o.unit for o in machine.outputs)
        return Record(name, time, command, time, output, "motor.effort", "N·m", names, units)

    estimation = prepare_estimation(model, [stepped([1.0, -0.5, 0.75, 1.0, -1.0, 0.5], "fitted")], "prediction")
    held_out = prepare(model, [stepped([0.9, -0.7, 0.0, 0.0, 0.0, 0.0], "held-out")])
    view = ForceView(estimation, Options(effects=["coulomb_friction@motor"]), held_out)
    step = view.evaluate(requested_force_fit(model, estimation, {}))
    friction = next(one for one in step.evaluated if one.names == ("coulomb_friction@motor",))
    assert friction.held_out is not None
    assert friction.held_out > 0.5 * step.improvement(friction)


@pytest.mark.parametrize(("level", "named"), [(0.001, False), (0.05, True)])
def test_a_balance_that_leaves_less_than_its_own_errors_names_nothing(level: float, named: bool):
    machine = replace(load_model("axis"), outputs=tuple(replace(o, noise=1e-7) for o in load_model("axis").outputs))
    record = turned(machine.with_effects([f"coulomb_friction@axis(level={level})"]))
    step = evaluated(machine, record, ["coulomb_friction"])
    assert bool(step.tied) is named
    assert ("errors of the balance itself" in step.passed_over.get("coulomb_friction@axis", "")) is not named


def test_an_effect_that_held_out_records_do_not_have_is_not_named():
    machine = load_model("axis").with_effects(["load_torque@axis(torque=0.1)"])
    estimation = prepare_estimation(load_model("axis"), [turned(machine, 1)], "prediction")
    held_out = prepare(load_model("axis"), [turned(load_model("axis"), 2)])
    step = ForceView(estimation, Options(effects=["load_torque"]), held_out).evaluate(
        requested_force_fit(load_model("axis"), estimation, {})
    )
    assert not step.tied
    assert "does not carry over" in step.passed_over["load_torque@axis"]


@pytest.fixture(scope="module")
def steps_of_torque(data_dir, tmp_path_factory) -> tuple[Model, list[Record], list[Record]]:
    """A measured motor: model, records, and one to hold out.

    With an offset alone that one has smaller errors than any other, and with friction errors like theirs.
    """
    folder = data_dir / "hsm150"
    if not folder.is_dir():
        pytest.skip(f"no {folder}: set IDLOOP_DATA to the folder of the measured data")
    model, bags, records = load_model(folder / "model.yaml"), tmp_path_factory.mktemp("bags"), {}
    for source in sorted(folder.glob("*.csv")):
        import_bag(source, bags / source.stem, str(folder / "map.yaml"))
        records[source.stem] = read_record(bags / source.stem, model)
    held_out = [records.pop("neg_0.045_1")]
    return model, list(records.values()), held_out


def test_one_held_out_record_whose_errors_happen_to_be_small_does_not_hide_friction(steps_of_torque):
    model, records, held_out = steps_of_torque
    estimation = prepare_estimation(model, records, "prediction")
    view = ForceView(estimation, Options(), prepare(model, held_out))
    step = view.evaluate(requested_force_fit(model, estimation, {}))
    assert step.names == ("coulomb_friction@motor",)
    assert step.tied[0].names in (
        ("coulomb_friction@motor", "input_offset@input"),
        ("coulomb_friction@motor", "load_torque@motor"),
    )


@pytest.mark.slow
def test_nor_does_it_hide_an_effect_from_the_ladder(steps_of_torque):
    model, records, held_out = steps_of_torque
    ladder = refine(model, records, held_out)
    assert ladder.added[:2] in (
        ("coulomb_friction@motor", "load_torque@motor"),
        ("coulomb_friction@motor", "input_offset@input"),
    )
    assert not {"cable_spring@motor", "compliance@motor"} & set(ladder.added)
    assert ladder.model.values["coulomb_friction@motor.level"] == pytest.approx(0.0242, rel=0.15)


def test_a_limit_that_held_out_records_do_not_reach_is_judged_without_them():
    machine = load_model("axis").with_effects(["saturation@input(limit=1.2)"])
    estimation = prepare_estimation(load_model("axis"), [turned(machine, 1)], "prediction")
    gentle = turned(machine, 2)
    gentle = replace(gentle, input=0.5 * gentle.input, output=simulated(machine, gentle.time, 0.5 * gentle.input))
    held_out = prepare(load_model("axis"), [gentle])
    step = ForceView(estimation, Options(effects=["saturation"]), held_out).evaluate(
        requested_force_fit(load_model("axis"), estimation, {})
    )
    assert step.names == ("saturation@input",)
    assert step.tied[0].held_out is None


def test_a_pair_whose_second_effect_takes_the_place_of_the_first_acts_on_held_out_records():
    model = load_model("axis")
    machine = model.with_effects(["coulomb_friction@axis(level=0.1)"])
    estimation = prepare_estimation(model, [turned(machine, 1)], "prediction")
    parent = requested_force_fit(model, estimation, {})
    evaluator = Evaluator(estimation, parent, parent, prepare(model, [turned(machine, 2)]))
    (first,) = proposals(model, ["coulomb_friction"])
    (second,) = proposals(first.model({"level": 0.1}), ["asymmetric_friction"])
    fit = requested_force_fit(second.model({"level": 0.1, "ratio": 0.1}), estimation, {})
    assert "coulomb_friction@axis" not in fit.model.effect_names
    assert evaluator._can_improve((first, second), fit) > 0.1


WORM = ["load_torque@axis(torque=0.25)", "coulomb_friction@axis(level=0.03)", "load_dependent_friction@axis(ratio=0.3)"]


def test_the_friction_of_a_worm_gear_shows_more_beside_a_load_than_beside_an_offset() -> None:
    """An offset of the command is a part of the force that arrives in the gear; a load on the axis is none."""
    record = turned(load_model("axis").with_effects(WORM))
    model = load_model("axis").with_effects(["input_offset@input(offset=0.3)", "coulomb_friction@axis(level=0.1)"])
    model = model.with_free([*load_model("axis").free, "input_offset@input.offset", "coulomb_friction@axis.level"])
    estimation = prepare_estimation(model, [record], "prediction")
    view = ForceView(estimation, Options(effects=["load_dependent_friction", "load_torque", "cable_spring"]))
    offset = requested_force_fit(model, estimation, {})
    assert view.leaves_model_error(offset)
    load = view.exchanged(offset, "input_offset@input", "load_torque@axis")
    assert load is not None
    assert load.log_likelihood == pytest.approx(offset.log_likelihood, abs=1.0)
    (beside_offset,), (beside_load,) = (view.evaluate(one).tied for one in (offset, load))
    assert beside_load.names == ("load_dependent_friction@axis",)
    assert beside_load.gain > 2.0 * beside_offset.gain
    # What explains less is not exchanged.
    assert view.exchanged(offset, "coulomb_friction@axis", "load_torque@axis") is None


SLOW_JOINT = """\
schema: idloop/model/1
name: joint
input: {kind: measured, topic: command, joint: axis, field: effort, unit: A}
outputs:
  - {topic: states, joint: axis, field: position, unit: rad, noise: 1.0e-4}
  - {topic: states, joint: axis, field: velocity, unit: rad/s, noise: 1.0e-3}
bodies:
  - {name: axis, inertia: 1.0, viscous_friction: {value: 1.0, min: 0.0}}
drive: {gain: {value: 1.0}}
"""


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_traces_are_taken_beside_the_values_of_the_coarse_windows(seed):
    """On a slow joint the inertia hardly shows: the values of two sets of windows differ by a factor of five."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 90.0, 0.01)
    waves = [(0.3, 0.05, 0.0), (0.2, 0.11, 1.0), (0.1, 0.23, 2.0)]
    velocity = sum(size * np.cos(2.0 * np.pi * rate * time + phase) for size, rate, phase in waves)
    position = sum(
        size / (2.0 * np.pi * rate) * np.sin(2.0 * np.pi * rate * time + phase) for size, rate, phase in waves
    )
    current = 0.33 * velocity + 0.24 * np.sign(velocity) + 0.03 * np.gradient(velocity, 0.01)
    noise = rng.normal(size=(3, len(time))) * [[0.01], [1e-4], [1e-3]]
    model = build_model(read_model_file(SLOW_JOINT, "joint.yaml"), "joint.yaml")
    measured = {"axis.position": position + noise[1], "axis.velocity": velocity + noise[2]}
    record = Record.from_arrays(time, current + noise[0], measured, model)
    estimation = prepare_estimation(model, [record], "prediction")
    fit = requested_force_fit(model, estimation, {})
    assert fit is not None
    step = ForceView(estimation, Options()).evaluate(fit)
    assert [one.names for one in step.tied] == [("coulomb_friction@axis",)]


def test_a_limit_that_friction_cancels_is_not_evaluated(data_dir, tmp_path):
    """Torque steps of two heights: a limit at the level of the friction leaves a hundredth of the inertia."""
    folder = data_dir / "hsm150"
    if not folder.is_dir():
        pytest.skip(f"no {folder}: set IDLOOP_DATA to the folder of the measured data")
    model = load_model(folder / "model.yaml").with_effects(
        ["coulomb_friction@motor(level=0.0244)", "input_offset@input(offset=-0.0089)"]
    )
    records = []
    for name in ("neg_0.045_1", "neg_0.045_2", "pos_0.065_1", "pos_0.065_2"):
        import_bag(folder / f"{name}.csv", tmp_path / name, str(folder / "map.yaml"))
        records.append(read_record(tmp_path / name, model))
    estimation = prepare_estimation(model, records, "prediction")
    step = ForceView(estimation, Options(effects=["speed_limit_voltage", "saturation"])).evaluate(
        requested_force_fit(model, estimation, {})
    )
    assert step.evaluated == ()


def test_a_limit_is_found_where_the_gain_is_free_and_the_inertia_is_not():
    # A gain that grows without bound makes up for a limit near zero, as far as its slope at the start tells.
    axis = axis_by_current(noise=1e-4)
    rng = np.random.default_rng(1)
    time = np.arange(0.0, 20.0, 0.002)
    command = 0.4 * rng.normal(size=101)[(5.0 * time).astype(int)]
    position = simulated(axis.with_effects(["saturation@input(limit=0.45)"]), time, command)
    record = Record("run", time, command, time, position, "command", "A", ("axis.position",), ("rad",))
    step = evaluated(axis, record, ["saturation", "speed_limit_voltage"])
    assert step.names == ("saturation@input",)
    assert step.tied[0].fit.model.values["saturation@input.limit"] == pytest.approx(0.45, rel=0.02)


DRAG_BESIDE_SOMETHING = ["asymmetric_viscous_friction@axis(coefficient=0.02)", "imbalance@axis(amplitude=0.05)"]


def test_an_effect_whose_model_was_only_ranked_is_reported_with_intervals():
    machine = load_model("axis").with_effects(["coulomb_friction@axis(level=0.1)"])
    step = evaluated(load_model("axis"), record_of(machine, 1, seconds=20.0), ["coulomb_friction"])
    (named,) = step.tied
    ranked = named.fit.along(named.fit.form)
    assert np.all(np.isnan(ranked.covariance))
    found = diagnosis_of(replace(step, evaluated=(replace(named, fit=ranked),), settled_fits={}))
    assert found.best.name == "coulomb_friction@axis"
    assert 0.0 < found.best.parameters["level"]["stderr"] < 0.02


@pytest.mark.parametrize(
    ("effects", "named"),
    [
        (DRAG_BESIDE_SOMETHING, "asymmetric_viscous_friction@axis"),
        (["load_torque@axis(torque=0.05)"], "load_torque@axis"),
    ],
)
def test_an_effect_that_can_imitate_a_constant_is_named_where_it_explains_more(effects, named):
    """At a speed that varies little but in its sign, beside something else, a constant load explains most of a drag."""
    machine = load_model("axis").with_effects(effects)
    time = np.arange(0.0, 20.0, 0.002)
    level = 0.4 + 0.1 * np.sin(0.9 * time)
    command = level * np.clip(4.0 * np.sin(1.2 * time), -1.0, 1.0)
    noise = np.random.default_rng(3).normal(size=(len(time), 2)) * [1e-5, 1e-4]
    output = simulate(machine, time, command, time, noise=noise).output
    names, units = machine.output_names, tuple(o.unit for o in machine.outputs)
    record = Record("run", time, command, time, output, "axis.effort", machine.input.unit, names, units)
    step = evaluated(load_model("axis"), record, ["load_torque", "asymmetric_viscous_friction"])
    assert step.names == (named,)


@pytest.mark.parametrize(("torque", "named"), [(0.016, False), (0.03, True)])
def test_an_effect_must_explain_a_part_of_what_no_noise_accounts_for(torque: float, named: bool):
    """Beside a friction that no candidate describes: 4 % and 13 % of the power of the errors."""
    machine = load_model("axis").with_effects(
        [f"load_torque@axis(torque={torque})", "coulomb_friction@axis(level=0.12)"]
    )
    step = evaluated(load_model("axis"), turned(machine, 1, rate=250.0, seconds=100.0), ["load_torque"])
    (one,) = step.evaluated
    assert step.conclusive(one.evidence)
    assert step.improvement(one) > step.minimum_improvement
    assert step.names == (("load_torque@axis",) if named else ())
    if not named:
        assert "of the errors beyond the sensors' noise" in step.passed_over["load_torque@axis"]


def test_what_free_parameters_can_imitate_takes_no_place_of_other_effects(monkeypatch):
    """Beside a command of two levels a dead zone or a limit is a gain, and its trace promises anything."""
    effects = ["coulomb_friction@axis(level=0.03)", "input_offset@input(offset=-0.02)"]
    machine = load_model("axis").with_effects(effects)
    model = load_model("axis").with_free(["axis.viscous_friction", "drive.gain"])
    record = turned(machine, rate=250.0)
    command = np.where(np.sin(2.0 * np.pi * 0.5 * record.time) > 0.0, 1.0, -1.0)
    record = replace(record, input=command, output=simulated(machine, record.time, command))
    monkeypatch.setattr(force_view, "_MOST_FITS", 5)
    step = evaluated(model, record)
    assert step.gate.why["dead_zone@input"] == "on this data the free parameters can do the same"
    assert "input_offset@input" in {name for one in step.evaluated for name in one.names}


@pytest.mark.parametrize(("stiffness", "simpler"), [(1e4, True), (0.5, False)])
def test_an_effect_goes_where_the_simpler_one_that_it_contains_explains_as_much(stiffness: float, simpler: bool):
    model = load_model("axis").with_effects([f"presliding_friction@axis(level=0.2, stiffness={stiffness})"])
    record = turned(model)
    estimation = prepare_estimation(model, [record], "prediction")
    view = ForceView(estimation, Options())
    smaller = view.without(requested_force_fit(model, estimation, {}), "presliding_friction@axis")
    assert (smaller is not None) is simpler
