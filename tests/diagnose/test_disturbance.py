"""A second summit: a strong disturbance beside a whitening, where the present noise has neither."""

from collections.abc import Callable

import numpy as np
import pytest

from idloop.diagnose import disturbance
from idloop.diagnose.disturbance import second_summit
from idloop.diagnose.setting import Setting, prepare_setting
from idloop.estimate.problem import Problem
from idloop.physics import Model, load_model
from idloop.physics.simulation import simulate
from idloop.records import Record

# Decades of intensity and of memory.
HERE = 0.2, 2.0
# Orders of the whitening beside a weak disturbance and beside a strong one.
PLAIN, WHITENED = [0], [8]


@pytest.fixture(scope="module")
def model() -> Model:
    return load_model("axis")


@pytest.fixture(scope="module")
def setting(model: Model) -> Setting:
    rng = np.random.default_rng(0)
    time = 0.01 * np.arange(300)
    command = rng.normal(size=12).repeat(25)
    output = simulate(model, time, command, time, noise=0.01 * rng.normal(size=(300, 2))).output
    names, units = tuple(o.name for o in model.outputs), tuple(o.unit for o in model.outputs)
    record = Record("run", time, command, time, output, "axis.effort", model.input.unit, names, units)
    return prepare_setting(model, [record], "prediction")


def landscape(
    monkeypatch: pytest.MonkeyPatch, height: Callable[[float], float], orders: Callable[[float], list[int]]
) -> None:
    """A log-likelihood by the decades of the intensity, instead of a record's."""

    def weigh(problem: Problem, point: np.ndarray, given: list[int] | None = None) -> float:
        problem.orders = orders(float(point[-2])) if given is None else given
        return height(float(point[-2]))

    monkeypatch.setattr(disturbance, "weigh", weigh)


def hills(second: float, at: float) -> Callable[[float], float]:
    """One summit of height 0 at the present disturbance, another of some height elsewhere."""
    return lambda exponent: max(-400.0 * (exponent - HERE[0]) ** 2, second - 400.0 * (exponent - at) ** 2)


def test_a_summit_of_a_stronger_disturbance_with_a_whitening_is_found(
    monkeypatch: pytest.MonkeyPatch, setting: Setting, model: Model
) -> None:
    landscape(monkeypatch, hills(-5.0, 1.2), lambda exponent: WHITENED if exponent > 0.7 else PLAIN)
    found = second_summit(setting, model, model.theta, HERE, PLAIN)
    assert found is not None
    (exponent, memory), orders = found
    assert exponent == pytest.approx(1.2, abs=0.13)
    assert (memory, orders) == (HERE[1], WHITENED)


@pytest.mark.parametrize(
    ("second", "at", "orders"),
    [
        pytest.param(-1e4, 1.2, WHITENED, id="too low for the parameters to make up for"),
        pytest.param(-5.0, HERE[0], WHITENED, id="no other summit"),
        pytest.param(-5.0, 9.0, WHITENED, id="out of reach"),
        pytest.param(-5.0, 1.2, PLAIN, id="no whitening beside it"),
    ],
)
def test_nothing_is_found_where_there_is_no_such_summit(
    monkeypatch: pytest.MonkeyPatch, setting: Setting, model: Model, second: float, at: float, orders: list[int]
) -> None:
    landscape(monkeypatch, hills(second, at), lambda exponent: orders if exponent > 0.7 else PLAIN)
    assert second_summit(setting, model, model.theta, HERE, PLAIN) is None
