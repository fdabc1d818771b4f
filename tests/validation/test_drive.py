"""The drive side: the force that a motion needs beside the one that was applied."""

import numpy as np
import pytest

from idloop.diagnosis.model_errors import model_errors
from idloop.physics import Model, load_model
from idloop.physics.simulation import simulate
from idloop.records import Record
from idloop.validation.drive import force_error


def moved(model: Model, factor: float, seed: int = 0) -> Record:
    """Random steps, measured with a multiple of the sensors' own noise."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 15.0, 0.005 if len(model.bodies) == 1 else 0.001)
    command = rng.normal(size=61)[(4.0 * time).astype(int)]
    noise = np.column_stack([factor * rng.normal(size=len(time)) * float(o.noise or 0.0) for o in model.outputs])
    output = simulate(model, time, command, time, noise=noise).output
    names, units = tuple(o.name for o in model.outputs), tuple(o.unit for o in model.outputs)
    return Record("run", time, command, time, output, model.input.name, model.input.unit, names, units)


@pytest.mark.parametrize(
    ("name", "factor"), [("axis", 1.0), ("axis", 10.0), ("axis", 30.0), ("torsion", 1.0), ("torsion", 10.0)]
)
def test_the_true_model_misses_the_force_by_what_the_sensors_noise_makes(name: str, factor: float) -> None:
    model = load_model(name)
    found = force_error(model, moved(model, factor))
    quiet = force_error(model, moved(model, 0.0), cutoff=found.cutoff)
    beyond = np.sqrt(max(found.relative**2 - quiet.relative**2, 0.0))
    assert found.noise == pytest.approx(beyond, rel=0.35)


def test_motion_under_a_white_command_is_not_taken_for_noise() -> None:
    model, rng = load_model("dc_motor"), np.random.default_rng(3)
    time = np.arange(0.0, 30.0, 0.01)
    command = 2.0 * rng.normal(size=len(time))
    noise = 0.1 * rng.normal(size=(len(time), 2)) * [float(o.noise or 0.0) for o in model.outputs]
    output = simulate(model, time, command, time, noise=noise).output
    units = tuple(o.unit for o in model.outputs)
    record = Record("run", time, command, time, output, model.input.name, model.input.unit, model.output_names, units)
    found = force_error(model, record)
    assert found.trusted
    assert found.noise <= found.relative < 0.1


def test_a_force_error_that_is_the_sensors_own_is_not_told() -> None:
    model = load_model("axis")
    quiet, loud = model_errors(model, [moved(model, 1.0)]), model_errors(model, [moved(model, 300.0)])
    assert quiet["force"] is not None
    assert quiet["force"] < 0.02
    assert loud["force"] is None


@pytest.mark.parametrize("factor", [1.0, 3.0, 10.0])
def test_a_command_that_dry_friction_holds_is_no_error(factor: float) -> None:
    plain = load_model("axis")
    right = plain.with_effect("coulomb_friction", "axis", level=0.7)
    record = moved(right, factor)
    quiet = moved(right, 0.0)
    stands = np.mean(quiet.output[:, 1] == 0.0)
    found, without = force_error(right, record), force_error(plain, record)
    assert stands > 0.3
    # Beside the noise: what the filters make of the moments at which the machine sticks.
    assert found.relative < found.noise + 0.03
    assert without.relative > 0.4


def test_the_level_of_friction_is_no_error_at_rest_and_what_exceeds_it_is() -> None:
    plain = load_model("axis")
    right = plain.with_effect("coulomb_friction", "axis", level=0.7)
    record = moved(right, 1.0)
    errors = [
        force_error(plain.with_effect("coulomb_friction", "axis", level=level), record).relative
        for level in (0.5, 0.7, 0.9)
    ]
    assert errors[1] < 0.5 * errors[0]
    assert errors[1] < 0.5 * errors[2]
    # Three standard deviations of the sensor, of which the filter may take a part.
    assert 0.01 < force_error(right, record).rest_speed < 0.032


def test_an_effect_at_the_command_that_the_machine_has_makes_the_force_error_smaller() -> None:
    plain = load_model("dc_motor")
    right = plain.with_effect("dead_zone", "input", width=0.3)
    rng = np.random.default_rng(3)
    time = np.arange(0.0, 20.0, 0.01)
    # Every command another one: an effect must act on each of them, not on the mean of two.
    command = 3.0 * rng.normal(size=len(time))
    output = simulate(right, time, command, time).output
    names, units = tuple(o.name for o in plain.outputs), tuple(o.unit for o in plain.outputs)
    record = Record("run", time, command, time, output, plain.input.name, plain.input.unit, names, units)
    true, others = force_error(right, record), [
        force_error(plain.with_values({"drive.gain": factor * plain.values["drive.gain"]}), record)
        for factor in (0.8, 0.9, 1.0)
    ]  # fmt: skip
    assert true.relative < 0.02
    assert all(one.relative > 2.0 * true.relative for one in others)


def test_no_model_changes_what_the_force_error_is_a_part_of() -> None:
    plain = load_model("axis")
    record = moved(plain, 1.0)
    off = force_error(plain.with_effect("saturation", "input", limit=1e-9), record)
    strong = force_error(plain.with_values({"drive.gain": 2.0 * plain.values["drive.gain"]}), record)
    as_it_is = force_error(plain, record)
    # A model that switches the command off misses all of the force, not many times of what it leaves.
    assert off.relative == pytest.approx(1.0, abs=0.05)
    np.testing.assert_allclose(off.commanded, as_it_is.commanded)
    np.testing.assert_allclose(strong.commanded, 2.0 * as_it_is.commanded)
