import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idloop.estimation.networks.network import SIGMOID, Network
from idloop.estimation.networks.training import InOrder, OneStep
from idloop.estimation.networks.training_data import TrainingData


@given(
    seed=st.integers(0, 999), outputs=st.integers(1, 2), inputs=st.integers(1, 2), units=st.integers(1, 4),
    linear=st.booleans(), skipped=st.integers(0, 3),
)  # fmt: skip
def test_all_at_once_is_one_after_another(seed, outputs, inputs, units, linear, skipped):
    rng = np.random.default_rng(seed)
    source = rng.integers(0, outputs + inputs, 5)
    lag = rng.integers(1, 4, 5)
    shapes = {"direction": (units, 5), "scale": (units,), "weight": (outputs, units), "constant": (outputs,)}
    shapes |= {"linear": (outputs, 5), "center": (5,), "output_center": (outputs,)}
    numbers = {name: rng.normal(size=shape) for name, shape in shapes.items()}
    network = Network(
        source=source, lag=lag, kind=np.full(units, SIGMOID), width=rng.uniform(0.5, 2.0, 5),
        output_width=rng.uniform(0.5, 2.0, outputs), **numbers,
    )  # fmt: skip
    first = int(np.max(lag)) + skipped
    lengths = rng.integers(first + 1, 60, 2)
    experiments = [(rng.normal(size=(n, inputs)), rng.normal(size=(n, outputs))) for n in lengths]
    purpose = rng.integers(0, 3, int(np.sum(lengths)) - 2 * first)
    purpose[0] = 0
    data = TrainingData(experiments, purpose, first)
    at_once, in_order = OneStep.of(network, data), InOrder(data, parallel=False)
    assert at_once.errors(network) == pytest.approx(in_order.errors(network), abs=1e-12)
    expected = np.concatenate(list(in_order.rows(network, linear)))
    assert np.concatenate(list(at_once.rows(network, linear))) == pytest.approx(expected, abs=1e-12)
