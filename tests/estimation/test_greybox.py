from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from idloop.errors import IdloopError, InputError
from idloop.estimation import fit
from idloop.estimation.force_balance.weak_fit import WeakFit
from idloop.estimation.observer.innovations import InnovationCriterion
from idloop.physics import Model, Plant, load_model
from idloop.physics.model_file import from_text
from idloop.physics.simulation import simulate
from idloop.records import Record

Make = Callable[..., Record]
WRONG = {"drive.gain": 5.0, "motor.viscous_friction": 1.0, "coulomb_friction@motor.level": 0.0}


@pytest.mark.slow
@pytest.mark.parametrize("criterion", ["prediction", "simulation"])
def test_noise_free_data_give_the_truth(motor: Model, experiment: Make, criterion: str) -> None:
    result = fit(motor.with_values(WRONG), [experiment(motor, noise=False)], criterion)
    for name in motor.free:
        assert result.model.values[name] == pytest.approx(motor.values[name], rel=1e-3), name


@pytest.mark.slow
def test_a_long_record_fitted_from_its_opening_gives_what_all_of_it_gives(
    motor: Model, experiment: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    record, start = experiment(motor, samples=9000, seed=8), motor.with_values(WRONG)
    quick = fit(start, [record], "simulation")
    monkeypatch.setattr("idloop.estimation.greybox.opening_segments", lambda data: None)
    plain = fit(start, [record], "simulation")
    assert quick.converged
    assert plain.converged
    assert np.all(np.abs(quick.values - plain.values) < 0.1 * plain.stderr)
    assert quick.stderr == pytest.approx(plain.stderr, rel=0.05)


def test_intervals_and_report_under_noise(motor: Model, experiment: Make) -> None:
    result = fit(motor.with_values(WRONG), [experiment(motor, seed=4)])
    assert result.criterion == "prediction"
    assert "measurement noise" in result.why
    error = result.values - motor.theta
    assert np.all(np.abs(error) < 4.0 * result.stderr)
    assert result.covariance == pytest.approx(result.covariance.T)
    assert np.diag(result.correlation) == pytest.approx(1.0)
    assert result.fpe > result.loss > 0.0
    low, high = result.interval("drive.gain")
    assert low < result.model.values["drive.gain"] < high
    assert all(name in result.summary() for name in motor.free)
    assert set(result.to_dict()["parameters"]) == set(motor.free)
    assert result.model.parameter("drive.gain").stderr == pytest.approx(result.stderr[result.names.index("drive.gain")])
    # A motor with viscous friction: an integrator, and the pole of the friction over the inertia.
    fast = -result.model.values["motor.viscous_friction"] / result.model.values["motor.inertia"]
    assert sorted(result.system.poles().real) == pytest.approx([fast, 0.0], abs=1e-9)


@pytest.mark.parametrize("criterion", ["prediction", "simulation"])
def test_a_known_quantisation_does_not_narrow_the_intervals(motor: Model, experiment: Make, criterion: str) -> None:
    # Slopes of a rounded reading are its jumps: they say that everything is known to a thousandth of what it is.
    record = experiment(motor, seed=4)
    start = motor.with_values(WRONG)
    rounded = start.with_entry("sensor_quantisation", "position[motor]", {"resolution": 0.05})
    plain, known = fit(start, [record], criterion), fit(rounded, [record], criterion)
    assert known.values == pytest.approx(plain.values, rel=1e-6)
    assert known.stderr == pytest.approx(plain.stderr, rel=1e-6)


def test_same_data_same_answer(motor: Model, experiment: Make) -> None:
    record = experiment(motor, seed=5, samples=600)
    first, second = fit(motor, [record]), fit(motor, [record])
    assert np.array_equal(first.values, second.values)
    assert np.array_equal(first.stderr, second.stderr)


def test_more_records_give_smaller_intervals(motor: Model, experiment: Make) -> None:
    records = [experiment(motor, seed=s, samples=800) for s in range(3)]
    one, three = fit(motor, records[:1]), fit(motor, records)
    assert np.all(three.stderr < one.stderr)
    assert three.samples > 2 * one.samples


def test_missing_samples_and_missing_output(motor: Model, experiment: Make) -> None:
    record = experiment(motor, seed=6)
    output = record.output.copy()
    output[::3, 0] = np.nan
    output[5:9] = np.nan
    sparse = fit(motor, [experiment(motor, seed=6, output=output)])
    assert np.all(np.abs(sparse.values - motor.theta) < 5.0 * sparse.stderr)
    output[:, 0] = np.nan
    speed_only = fit(motor, [experiment(motor, seed=6, output=output)])
    assert np.all(np.abs(speed_only.values - motor.theta) < 5.0 * speed_only.stderr)


def test_gain_and_inertia_together_are_named_as_tied(motor: Model, experiment: Make) -> None:
    free = ["drive.gain", "motor.inertia", "motor.viscous_friction", "coulomb_friction@motor.level"]
    result = fit(motor.with_free(free), [experiment(motor, seed=7, samples=800)])
    (tied,) = [w for w in result.warnings if "only the ratios" in w]
    assert "drive.gain" in tied
    assert "motor.inertia" in tied


def test_absent_friction_ends_on_its_bound(motor: Model, experiment: Make) -> None:
    smooth = motor.with_values({"coulomb_friction@motor.level": 0.0})
    result = fit(motor, [experiment(smooth, seed=8)])
    level = result.values[result.names.index("coulomb_friction@motor.level")]
    assert level >= 0.0
    assert level < 4.0 * result.stderr[result.names.index("coulomb_friction@motor.level")]


def test_a_parameter_without_influence_is_named(motor: Model, experiment: Make) -> None:
    limited = motor.with_effect("saturation", "input", limit=100.0)
    result = fit(limited, [experiment(motor, seed=9, samples=600)])
    assert any("saturation@input.limit has no effect" in w for w in result.warnings)
    assert np.isnan(result.stderr[result.names.index("saturation@input.limit")])
    assert limited.parameter("saturation@input.limit").stderr is None


def test_progress_runs_from_start_to_end(motor: Model, experiment: Make) -> None:
    seen: list[float] = []
    fit(motor, [experiment(motor, samples=400)], progress=lambda share, text: seen.append(share))
    assert seen == sorted(seen)
    assert seen[0] == 0.0
    assert seen[-1] >= 0.95


def test_a_model_without_an_observer_is_simulated(
    motor: Model, experiment: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    def none(*given: Any) -> None:
        raise IdloopError("no observer could be designed for this model and data; try the simulation criterion")

    record = experiment(motor, samples=600)
    monkeypatch.setattr(InnovationCriterion, "retune", none)
    result = fit(motor, [record])
    assert result.criterion == "simulation"
    assert "no observer could be designed" in result.why
    assert np.array_equal(result.values, fit(motor, [record], "simulation").values)
    with pytest.raises(IdloopError, match="no observer"):
        fit(motor, [record], "prediction")


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"input": np.ones(1500)}, "command never changes"),
        ({"output": np.full((1500, 2), np.nan)}, "measures none"),
        ({"output": np.full((1500, 2), np.inf)}, "infinite"),
        ({"input": np.full(1500, np.nan)}, "NaN or infinite"),
    ],
)
def test_unsuitable_records(motor: Model, experiment: Make, change: dict[str, np.ndarray], text: str) -> None:
    with pytest.raises(InputError, match=text):
        fit(motor, [experiment(motor, **change)])


def test_other_bad_requests(motor: Model, experiment: Make) -> None:
    record = experiment(motor)
    with pytest.raises(InputError, match="no record"):
        fit(motor, [])
    with pytest.raises(InputError, match="unknown"):
        fit(motor, [record], "best")
    with pytest.raises(InputError, match="nothing to estimate"):
        fit(motor.with_free([]), [record])
    with pytest.raises(InputError, match="at least 20"):
        fit(motor, [record.cut(0.0, 0.03)])


def test_force_balance_of_a_tight_loop() -> None:
    # A quiet sensor, a reference that is followed, and a disturbance that no model knows.
    axis = load_model("emps").with_effects(["coulomb_friction@axis(level=20)"])
    plant = Plant(axis, seed=3, noise=False, disturbance_std=4.0, disturbance_time_constant=0.2)
    time = np.asarray(np.arange(0.0, 12.0, 1e-3), dtype=np.float64)
    reference = 0.1 * np.sin(2 * np.pi * 0.4 * time) + 0.01 * np.sin(2 * np.pi * 2.3 * time)
    rng = np.random.default_rng(3)
    output, command = np.empty((len(time), 1)), np.empty(len(time))
    speed = before = 0.0
    for k, t in enumerate(time):
        output[k] = plant.measure() + 2e-8 * rng.normal()
        speed = 0.8 * speed + 0.2 * (output[k, 0] - before) / 1e-3
        before = output[k, 0]
        command[k] = np.clip(160.0 * 243.0 * (reference[k] - before) - 243.0 * speed, -10.0, 10.0)
        plant.step(command[k], t + 1e-3)
    record = Record(
        "loop", time, command, time, output, axis.input.name, "V", axis.output_names, ("m",),
        reference_time=time, reference=np.column_stack([reference, np.full(len(time), np.nan)]),
    )  # fmt: skip
    start = axis.with_values({"axis.inertia": 60.0, "coulomb_friction@axis.level": 0.0})
    result = fit(start, [record])
    assert result.criterion == "force"
    assert "model error limits the fit" in result.why
    assert np.all(np.abs(result.values - axis.theta) < 4.0 * result.stderr)
    assert np.all(result.stderr < 0.1 * axis.theta)
    blind = fit(start, [replace(record, reference=None, reference_time=None)])
    assert blind.criterion == "force", "a balance along the measured motion asks for no reference"
    np.testing.assert_array_equal(blind.values, result.values)


SERVO = """\
schema: idloop/model/1
name: servo
input: {joint: axis, field: position, unit: rad}
outputs: [{joint: axis, field: position, unit: rad}]
bodies: [{name: axis, inertia: 1.0, viscous_friction: 0.0}]
drive: {kind: position_loop, unit: "-", proportional: {value: 800.0, min: 0.0}, derivative: {value: 45.0, min: 0.0}}
effects:
  - {effect: coulomb_friction, at: axis, level: {value: 8.0}}
  - {effect: input_delay, at: input, delay: {value: 0.001}}
"""


def test_a_balance_that_an_unknown_gain_of_the_drives_own_loop_scales_does_not_decide(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Where it leaves much of the force it explains that by a large gain and a delay, and no inertia."""
    monkeypatch.setattr(WeakFit, "model_error_dominates", True)
    model = from_text(SERVO, None)
    time = np.arange(0.0, 15.0, 0.002)
    random = np.random.default_rng(3)
    levels = np.interp(time, np.arange(0.0, 16.0), random.uniform(-0.5, 0.5, 16))
    command = levels + 0.1 * np.sin(2.0 * np.pi * 1.3 * time) + 0.03 * np.sin(2.0 * np.pi * 4.1 * time)
    position = simulate(model.with_effect("actuator_lag", "input", time_constant=0.006), time, command, time).output
    counts = 2.0 * np.pi / 4096
    record = Record(
        "run", time, command, time, np.floor(position / counts) * counts, "axis.position", "rad", ("axis.position",),
        ("rad",),
    )  # fmt: skip
    result = fit(model, [record])
    assert result.criterion != "force"
    assert "own loop" in result.why
    assert fit(from_text(SERVO.replace("{value: 800.0, min: 0.0}", "800.0"), None), [record]).criterion == "force"
