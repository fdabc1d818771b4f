"""The weight of an arm is `gravity` where it hangs at the sensor's zero; elsewhere it is an imbalance."""

import pytest

from idloop.diagnosis import diagnose, refine
from idloop.physics import Model, load_model

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
