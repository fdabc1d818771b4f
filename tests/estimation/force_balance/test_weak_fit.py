"""Fits by force balance: one result from every start, and no gain by switching forces off."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from idloop.estimation import fit
from idloop.estimation.dataset import prepare
from idloop.estimation.force_balance import window_width
from idloop.estimation.force_balance.weak_fit import WeakFit, fit_weak
from idloop.estimation.force_balance.weak_form import NARROWEST, weak_form
from idloop.estimation.force_balance.weak_likelihood import NormalisedErrors, cost_at
from idloop.estimation.force_balance.window_width import _off_limits, fit_by_force
from idloop.estimation.optimisation.caching_engine import CachingEngine
from idloop.physics import Model, load_model
from idloop.physics.simulation import simulate
from idloop.records import Record

from .test_weak_form import form_of, recorded

MACHINE = load_model("axis").with_effects(["coulomb_friction@axis(level=0.2)"])


@pytest.mark.parametrize("factor", [1.0 / 30.0, 0.3, 30.0])
@pytest.mark.parametrize("name", ["axis.inertia", "axis.viscous_friction"])
def test_a_start_far_off_gives_the_same_answer(name: str, factor: float) -> None:
    record = recorded(MACHINE)
    start = MACHINE.with_values({name: factor * MACHINE.values[name], "coulomb_friction@axis.level": 0.0})
    near, far = (fit_by_force(CachingEngine(m), prepare(m, [record]), m.theta) for m in (MACHINE, start))
    assert near is not None
    assert far is not None
    np.testing.assert_allclose(far.theta, near.theta, rtol=1e-3, atol=1e-6)
    np.testing.assert_allclose(far.theta, MACHINE.theta, rtol=0.05)


@pytest.mark.parametrize(
    "effect",
    ["saturation@input(limit=0.001)", "dead_zone@input(width=30.0)", "load_dependent_friction@axis(ratio=0.99)",
     "actuator_lag@input(time_constant=10.0)"],
)  # fmt: skip
def test_switching_the_command_off_explains_nothing(effect: str) -> None:
    plain = load_model("axis")
    form = form_of(plain, recorded(MACHINE))
    parent = fit_weak(form, plain.theta)
    model = plain.with_theta(parent.theta).with_effects([effect])
    weak = model.with_values({"axis.inertia": 1e-5 * model.values["axis.inertia"], "axis.viscous_friction": 0.0})
    for one in (model, weak):
        cost = cost_at(form.with_engine(CachingEngine(one)), one.theta)
        assert cost > cost_at(form, parent.point)


def turning_often(noise: float, seed: int) -> Record:
    """Ten seconds in which the speed changes by half of its size from sample to sample."""
    model = load_model("axis")
    machine = model.with_values({"axis.inertia": 0.01, "axis.viscous_friction": 0.05, "drive.gain": 1.0})
    machine = machine.with_effects(["coulomb_friction@axis(level=0.15)"])
    rng, time = np.random.default_rng(seed), np.arange(0.0, 10.0, 0.004)
    lines, phases = np.arange(0.1, 30.0, 0.1), rng.uniform(0.0, 2.0 * np.pi, 299)
    command = np.sum(np.cos(2.0 * np.pi * np.outer(time, lines) + phases), axis=1)
    command *= 1.5 / np.max(np.abs(command))
    output = simulate(machine, time, command, time).output
    output = output + noise * rng.normal(size=output.shape) * [2e-4, 4e-3]
    names, units = tuple(o.name for o in model.outputs), tuple(o.unit for o in model.outputs)
    return Record("run", time, command, time, output, "axis.effort", model.input.unit, names, units)


def test_where_every_width_shows_another_inertia_the_narrowest_windows_are_used(monkeypatch) -> None:
    """A force that is missing, not noise, then makes the inertia of the wide ones."""
    monkeypatch.setattr(window_width, "_underestimates_inertia", lambda *found, noisy: True)
    plain = load_model("axis")
    engine, data = CachingEngine(plain), prepare(plain, [recorded(MACHINE)])
    found = fit_by_force(engine, data, plain.theta, accept_noise=True)
    assert found is not None
    assert found.form.width == NARROWEST
    assert fit_by_force(engine, data, plain.theta) is None


@pytest.mark.parametrize(("wide", "shown"), [((2.0, 3.0), True), ((1.0, 2.0), False), ((2.0, 1.0), None)])
def test_inertia_that_moves_between_bodies_is_none_that_noise_hides(monkeypatch, wide, shown) -> None:
    def fit_of(*inertia: float) -> SimpleNamespace:
        form = SimpleNamespace(inertia=lambda _: np.array(inertia), gain=lambda _: 1.0, starts=[0, 10], rest_speed=0.0)
        form.engine = form.data = None
        form.width, form.with_rest_speed = NARROWEST, lambda _: form
        return SimpleNamespace(form=form, theta=None, point=None, log_likelihood=0.0)

    monkeypatch.setattr(window_width, "_windows", lambda *_: fit_of(*wide).form)
    monkeypatch.setattr(window_width, "draft_windows", lambda form: form)
    monkeypatch.setattr(window_width, "_off_limits", lambda *_: None)
    monkeypatch.setattr(window_width, "fit_weak", lambda *_, tolerance: fit_of(*wide))
    monkeypatch.setattr(window_width, "cost_at", lambda *_: 100.0)
    assert window_width._shows_more_inertia(fit_of(1.0, 2.0), None, {}, 2.5, noisy=False) is shown


def test_a_timing_at_its_limit_takes_no_certainty_from_the_others() -> None:
    """The command of the record acts five samples late, which is more than the timing may be."""
    record = recorded(MACHINE)
    late = replace(record, input_time=record.input_time - 5.0 * (record.time[1] - record.time[0]))
    form = form_of(MACHINE, late)
    found = fit_weak(form, MACHINE.theta)
    assert found.shift > 0.0
    assert np.isnan(found.covariance[-1, -1])
    without = found.jacobian.copy()
    without[:, -1] = 0.0
    np.testing.assert_allclose(found.covariance, replace(found, jacobian=without).covariance)
    assert np.all(np.isfinite(np.diag(found.covariance)[:-1]))


def test_a_search_leaves_a_limit_from_the_start() -> None:
    engine = CachingEngine(MACHINE)
    found = fit_by_force(engine, prepare(MACHINE, [recorded(MACHINE)]), MACHINE.theta)
    assert found is not None
    np.testing.assert_array_equal(_off_limits(found, MACHINE.theta), found.theta)
    place = engine.free.index("axis.inertia")
    lost = replace(found, point=found.point.copy())
    lost.point[place] = MACHINE.bounds[0][place]
    left = _off_limits(lost, MACHINE.theta)
    assert left[place] == MACHINE.theta[place]
    np.testing.assert_array_equal(np.delete(left, place), np.delete(found.theta, place))


@pytest.mark.parametrize("noise", [0.01, 1.0, 10.0])
@pytest.mark.parametrize("width", [0, 28, 56])
def test_friction_does_not_depend_on_the_width_of_the_windows(noise: float, width: int) -> None:
    errors = []
    for seed in range(3):
        record = turning_often(noise, seed)
        model = load_model("axis").with_effects(["coulomb_friction@axis(level=0.15)"])
        model = model.with_values({"axis.inertia": 0.01, "axis.viscous_friction": 0.05, "drive.gain": 1.0})
        engine, data = CachingEngine(model), prepare(model, [record])
        form = weak_form(engine, data, width) if width else None
        found = fit_weak(form, model.theta) if form else fit_by_force(engine, data, model.theta, accept_noise=True)
        assert found is not None
        errors.append(found.theta / model.theta - 1.0)
    inertia, viscous, dry = np.mean(errors, axis=0)
    assert abs(inertia) < 0.015
    assert abs(viscous) < 0.05
    assert abs(dry) < 0.03


@pytest.mark.slow
def test_intervals_hold_the_truth_as_often_as_they_say() -> None:
    plain = load_model("axis")
    rng = np.random.default_rng(5)
    inside, count = np.zeros(len(plain.theta)), 60
    for seed in range(count):
        record = recorded(plain, seed)
        noisy = replace(record, output=record.output + rng.normal(size=record.output.shape) * (1e-3, 5e-2))
        found = fit_weak(form_of(plain, noisy, 41), plain.theta)
        spread = np.sqrt(np.diag(found.covariance))[: len(plain.theta)]
        inside += np.abs(found.theta - plain.theta) < 1.96 * spread
    # 95 % of 60: fewer than 51 or none outside in all has a chance of one in a hundred each.
    assert np.all(inside >= 51), inside


def test_a_fit_reports_the_unexplained_force() -> None:
    plain = load_model("axis")
    result = fit(plain, [recorded(MACHINE)])
    assert result.criterion == "force"
    assert "of the drive force" in result.why
    assert result.residuals[0].names == ("force[axis]",)
    assert len(result.residuals[0].time) == len(result.residuals[0].value) == result.samples


def test_a_limit_far_below_the_command_explains_the_motion_beyond_it() -> None:
    machine = load_model("axis").with_effects(["saturation@input(limit=0.5)"])
    record, plain = recorded(machine), load_model("axis")
    assert np.mean(np.abs(record.input) > 0.5) > 0.3
    parent = fit_weak(form_of(plain, record), plain.theta)
    found = fit_weak(form_of(machine, record), machine.theta)
    assert np.sum(found.log_densities()) > np.sum(parent.log_densities()) + 100.0
    assert found.model.values["saturation@input.limit"] == pytest.approx(0.5, rel=0.02)
    assert found.model.values["axis.inertia"] == pytest.approx(plain.values["axis.inertia"], rel=0.02)


def test_friction_is_determined_by_the_standstill_of_its_body() -> None:
    """A dead zone stops the drive, a friction the body: they differ where the body stands."""
    record = recorded(MACHINE)
    dead = load_model("axis").with_effects(["dead_zone@input(width=0.2)"])
    stuck, free = (fit_weak(form_of(model, record), model.theta) for model in (MACHINE, dead))
    assert np.sum(stuck.log_densities()) > np.sum(free.log_densities()) + 30.0


def test_the_reliability_is_the_share_of_the_acceleration_without_noise() -> None:
    plain = load_model("axis")
    rng, record = np.random.default_rng(3), recorded(load_model("axis"))
    shares = []
    for level in (1e-3, 1e-1, 3.0):
        noisy = replace(record, output=record.output + level * rng.normal(size=record.output.shape))
        shares.append(form_of(plain, noisy).reliability)
    assert shares[0] > 0.99
    assert shares[0] > shares[1] > shares[2]
    assert shares[2] < 0.5


def with_sensors_apart(record: Record, lag: np.ndarray | float) -> Record:
    """The position read so many seconds late, the velocity at its time."""
    position = np.interp(record.time - lag, record.time, record.output[:, 0])
    return replace(record, output=np.column_stack([position, record.output[:, 1]]))


def test_jitter_of_one_sensor_hides_no_missing_force() -> None:
    plain = load_model("axis")
    record = recorded(MACHINE, seconds=30.0)
    samples = np.repeat(np.random.default_rng(4).integers(-1, 2, len(record.time) // 25 + 1), 25)[: len(record.time)]
    lag = 0.3 * float(record.time[1] - record.time[0]) * samples
    found = fit_by_force(CachingEngine(plain), prepare(plain, [with_sensors_apart(record, lag)]), plain.theta)
    assert found is not None
    assert found.form.disagreement > 0.02
    assert found.model_error_dominates
    assert found.usable


@pytest.mark.parametrize("machine", [load_model("axis"), MACHINE])
def test_sensors_that_disagree_by_more_than_is_left_make_no_balance(machine: Model) -> None:
    record = recorded(machine)
    gained = replace(record, output=record.output * (1.0, 1.4))
    found = fit_by_force(CachingEngine(machine), prepare(machine, [gained]), machine.theta)
    assert found is None or (found.form.disagreement > 0.02 and not found.reliable)


TRUE_INERTIA = load_model("axis").values["axis.inertia"]


def recorded_with(noise: np.ndarray) -> Record:
    machine = load_model("axis").with_effects(["coulomb_friction@axis(level=0.05)"])
    record = recorded(replace(machine, outputs=machine.outputs[:1]))
    return replace(record, output=record.output + noise[: len(record.time), None])


def noisy(noise: np.ndarray) -> WeakFit | None:
    """The balance of an axis of which only the position is measured, with noise of its own."""
    plain = load_model("axis")
    plain = replace(plain, outputs=plain.outputs[:1])
    return fit_by_force(CachingEngine(plain), prepare(plain, [recorded_with(noise)]), plain.theta)


def wandering(memory: float, size: float) -> np.ndarray:
    """Noise of a sensor that keeps a part of itself from sample to sample."""
    rng, noise = np.random.default_rng(2), np.zeros(5000)
    for k in range(1, len(noise)):
        noise[k] = memory * noise[k - 1] + size * rng.normal()
    return noise


@pytest.mark.parametrize(("memory", "size"), [(0.0, 2e-4), (0.8, 1e-3), (0.95, 1e-3)])
def test_windows_are_wide_enough_for_the_inertia_to_be_right(memory: float, size: float) -> None:
    found = noisy(noise := wandering(memory, size))
    assert found is not None
    assert found.reliable
    narrow = fit_weak(form_of(found.form.engine.model, recorded_with(noise)), found.point)
    assert found.form.width > narrow.form.width
    assert found.theta[0] == pytest.approx(TRUE_INERTIA, rel=0.05)
    assert abs(narrow.theta[0] / TRUE_INERTIA - 1.0) > abs(found.theta[0] / TRUE_INERTIA - 1.0)


@pytest.mark.parametrize("memory", [0.0, 0.8, 0.95, 0.99])
@pytest.mark.parametrize("size", [3e-3, 1e-2, 3e-2, 1e-1])
def test_no_balance_is_reliable_with_an_inertia_from_sensor_noise(memory: float, size: float) -> None:
    found = noisy(wandering(memory, size))
    assert found is None or not found.reliable or found.theta[0] == pytest.approx(TRUE_INERTIA, rel=0.2)


def test_noise_takes_no_inertia_away_beside_a_weight_that_the_model_lacks() -> None:
    """A pendulum under a torque that changes fast: its weight hides the inertia of the plain model at any width."""
    plain = load_model("axis")
    plain = replace(plain, outputs=plain.outputs[:1])
    machine = plain.with_values({"axis.inertia": 0.18, "axis.viscous_friction": 0.03})
    machine = machine.with_effects(["gravity@axis(moment=3.5)"])
    time = 0.005 * np.arange(2000)
    command = np.sign(np.random.default_rng(2).normal(size=len(time))) + 0.6 * np.sign(np.sin(4.3 * time))
    position = simulate(machine, time, command, time).output[:, 0] + wandering(0.9, 2e-3)[: len(time)]
    names, units = plain.output_names, tuple(one.unit for one in plain.outputs)
    record = Record("swing", time, command, time, position[:, None], "axis.effort", "N·m", names, units)
    found = fit_by_force(CachingEngine(plain), prepare(plain, [record]), plain.theta)
    assert found is None


@pytest.mark.parametrize("memory", [0.9, 0.95])
@pytest.mark.parametrize("share", [0.02, 0.05, 0.1])
def test_noise_of_a_velocity_that_has_a_memory_takes_no_inertia_away(memory: float, share: float) -> None:
    plain = load_model("axis")
    plain = replace(plain, outputs=plain.outputs[1:])
    record = recorded(plain)
    noise = share * float(np.std(record.output)) * wandering(memory, 1.0)[: len(record.time)]
    record = replace(record, output=record.output + noise[:, None])
    found = fit_by_force(CachingEngine(plain), prepare(plain, [record]), plain.theta)
    assert found is None or found.theta[0] == pytest.approx(TRUE_INERTIA, rel=0.1)


def test_a_prediction_with_a_force_in_its_disturbance_is_contradicted() -> None:
    plain = load_model("axis")
    balance = fit_by_force(CachingEngine(plain), prepare(plain, [recorded(MACHINE)]), plain.theta)
    assert balance is not None
    assert balance.usable
    assert not balance.contradicts(balance.model)
    assert balance.contradicts(plain.with_values({"axis.inertia": 30.0 * balance.model.values["axis.inertia"]}))


def held_at_two_speeds(seed: int) -> Record:
    """A loop that holds the speed against a friction which wanders: the command tells it, the acceleration does not."""
    rng, model = np.random.default_rng(seed), load_model("axis")
    inertia, viscous = model.values["axis.inertia"], model.values["axis.viscous_friction"]
    step, count, substeps = 0.002, 5000, 5
    velocity = position = integral = wander = 0.0
    command, output = np.zeros(count), np.zeros((count, 2))
    for k in range(count):
        error = 2.0 * (-1) ** (k // 500) - velocity
        output[k] = position, velocity
        integral += error * step
        command[k] = inertia * (60.0 * error + 600.0 * integral)
        wander = 0.99 * wander + 0.02 * rng.normal()
        for _ in range(substeps):
            free = velocity + (command[k] - viscous * velocity) / inertia * step / substeps
            velocity = np.sign(free) * max(abs(free) - (0.3 + wander) / inertia * step / substeps, 0.0)
            position += velocity * step / substeps
    time, names, units = step * np.arange(count), [o.name for o in model.outputs], [o.unit for o in model.outputs]
    return Record("held", time, command, time, output, "axis.effort", model.input.unit, tuple(names), tuple(units))


@pytest.mark.parametrize("seed", range(2))
def test_a_loop_that_holds_the_speed_does_not_make_it_likely_that_the_command_is_cut_off(seed: int) -> None:
    record = held_at_two_speeds(seed)
    limited = load_model("axis").with_effects(["coulomb_friction@axis(level=0.3)", "saturation@input(limit=0.3)"])
    form = form_of(limited, record)
    starts = [limited.with_values({"saturation@input.limit": limit}).theta for limit in (0.05, 0.2, 0.4)]
    best = max((fit_weak(form, start) for start in starts), key=lambda found: found.log_likelihood)
    assert best.model.values["saturation@input.limit"] > 0.5


def test_a_fit_to_some_windows_is_no_worse_in_them() -> None:
    """A soft spring far off is a load: the data determine the product of its parameters, in which a step is long."""
    record = recorded(load_model("axis").with_effects(["load_torque@axis(torque=0.3)"]))
    model = load_model("axis").with_effects(["cable_spring@axis(stiffness=1e-5, rest=3e4)"])
    whole = fit_by_force(CachingEngine(model), prepare(model, [record]), model.theta, accept_noise=True)
    assert whole is not None
    for rows in np.array_split(np.arange(len(whole.residual)), 4):
        part = whole.refitted(rows)
        assert np.linalg.norm(part.residual[rows]) <= np.linalg.norm(whole.residual[rows]) * (1.0 + 1e-9)


@pytest.mark.parametrize(
    "effects",
    [
        [],
        ["dead_zone@input(width=0.1)"],
        ["coulomb_friction@axis(level=0.2)", "load_torque@axis(torque=0.05)"],
        ["coulomb_friction@axis(level=0.2)", "input_offset@input(offset=0.05)"],
    ],
)
def test_the_errors_that_a_search_reduces_depend_on_the_point_alone(effects: list[str]) -> None:
    model = load_model("axis").with_effects(effects)
    form = form_of(model, recorded(MACHINE))
    search = NormalisedErrors(form)
    start = np.append(model.theta, 0.0) if form.free_timing else model.theta
    for place in range(len(start)):
        point = start.copy()
        point[place] += 1e-3
        np.testing.assert_array_equal(search(point), NormalisedErrors(form)(point))


@pytest.mark.parametrize("memory", [0.8, 0.9])
@pytest.mark.parametrize("size", [2e-5, 5e-5])
def test_jitter_of_the_stamps_does_not_take_the_inertia_away(memory: float, size: float) -> None:
    """A fast motor whose encoder is read early or late, for some samples in turn: noise that follows the speed."""
    plain = load_model("axis")
    plain = replace(plain, outputs=plain.outputs[:1])
    time, rate, speed = 1e-3 * np.arange(5000), 2.0 * np.pi * 0.9, 150.0
    velocity = speed * np.sin(rate * time)
    forces = TRUE_INERTIA * speed * rate * np.cos(rate * time) + plain.values["axis.viscous_friction"] * velocity
    position = -speed / rate * np.cos(rate * (time + wandering(memory, size)))
    units = tuple(one.unit for one in plain.outputs)
    record = Record(
        "jitter",
        time,
        forces + np.sign(velocity),
        time,
        position[:, None],
        "axis.effort",
        "N·m",
        plain.output_names,
        units,
    )
    found = fit_by_force(CachingEngine(plain), prepare(plain, [record]), plain.theta)
    assert found is not None
    assert found.theta[0] == pytest.approx(TRUE_INERTIA, rel=0.2)
