"""The weight of an arm is `gravity` where it hangs at the sensor's zero; elsewhere it is an imbalance."""

from dataclasses import replace

import numpy as np
import pytest

from idloop.diagnosis import diagnose, refine
from idloop.physics import Model, load_model
from idloop.physics.simulation import simulate
from idloop.records import Record

from .conftest import record_of


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("disturbance", [0.0, 0.05])
def test_gravity_is_found_under_its_own_name(start: Model, disturbance: float, seed: int) -> None:
    machine = load_model("axis").with_effects(["gravity@axis(moment=0.15)"])
    found = diagnose(start, [record_of(machine, seed, disturbance=disturbance)])
    assert "gravity@axis" in found.set
    assert found.best is not None
    assert found.best.name in ("gravity@axis", "imbalance@axis")


@pytest.mark.slow
def test_an_imbalance_at_another_angle_is_no_gravity(start: Model) -> None:
    machine = load_model("axis").with_effects(["imbalance@axis(amplitude=0.15, phase=0.9)"])
    assert refine(start, [record_of(machine, 1)]).added == ("imbalance@axis",)


def test_a_given_lowest_position_is_held() -> None:
    model = load_model("axis").with_effect("gravity", "axis", moment=0.1, lowest=0.5)
    assert "gravity@axis.moment" in model.free


def held_pendulum(seconds: float, seed: int) -> tuple[Model, Record]:
    """A pendulum under a position loop, read by an encoder that counts down to whole pulses, and its model without.

    Its friction acts as a spring in less time than a window of the force balance.
    """
    model = load_model("axis")
    model = replace(model, outputs=tuple(one for one in model.outputs if one.field == "position"))
    machine = model.with_values({"axis.inertia": 0.05, "axis.viscous_friction": 0.03}).with_effects(
        ["gravity@axis(moment=1.2)", "presliding_friction@axis(level=0.1, stiffness=500)"]
    )
    chance, time, quantum = np.random.default_rng(seed), np.arange(0.0, seconds, 0.01), 2.0 * np.pi / 4096
    sines = [np.sin(2.0 * np.pi * (f * time + chance.uniform())) for f in np.geomspace(0.05, 1.0, 25)]
    aim = 0.23 * np.sum(sines, axis=0)
    # What moves the pendulum along the aim, but for what its friction does.
    speed = np.gradient(aim, time)
    command = 0.05 * np.gradient(speed, time) + 0.03 * speed + 1.2 * np.sin(aim) + 0.1 * np.sign(speed)
    read = np.floor(simulate(machine, time, command, time).output / quantum) * quantum
    return model, Record(str(seed), time, command, time, read, "axis.effort", "N·m", ("axis.position",), ("rad",))


@pytest.mark.slow
def test_half_a_quantum_names_nothing_beside_the_weight() -> None:
    model, record = held_pendulum(20.0, 4)
    found = refine(model, [record])
    assert "gravity@axis" in found.added
    assert set(found.added) <= {"gravity@axis", "presliding_friction@axis", "sensor_quantisation@position[axis]"}
