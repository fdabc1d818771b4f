import numpy as np
import pytest

from idloop.estimation.networks import TappedDelays
from idloop.estimation.networks.network import (
    SCALING,
    SIGMOID,
    WAVELET,
    Network,
    activations,
    ahead,
    parameters,
    slopes,
    with_parameters,
)
from idloop.estimation.networks.training_data import regressors

BOUND = np.full(2, np.inf)


def network(kinds=(SIGMOID, SCALING, WAVELET, SIGMOID), seed=0):
    """Two inputs, two outputs, uneven delays."""
    random = np.random.default_rng(seed)
    source, lag = TappedDelays((2, 1), (1, 3), (1, 0)).taps(2, 2)
    r, h = source.size, len(kinds)
    return Network(
        source, lag, random.normal(size=r), random.uniform(1.0, 2.0, r), np.array(kinds, dtype=np.int64),
        0.5 * random.normal(size=(h, r)), random.uniform(0.3, 0.8, h), 0.3 * random.normal(size=(2, h)),
        random.normal(size=2), 0.1 * random.normal(size=(2, r)), random.normal(size=2), random.uniform(0.5, 1.5, 2),
    )  # fmt: skip


def by_definition(net, z):
    total = net.constant + net.linear @ z
    for kind, direction, scale, weight in zip(net.kind, net.direction, net.scale, net.weight.T, strict=True):
        if kind == SIGMOID:
            value = np.tanh(direction @ z + scale)
        else:
            square = scale**2 * np.sum((z - direction) ** 2)
            value = np.exp(-square / 2) * (1.0 if kind == SCALING else z.size - square)
        total = total + weight * value
    return net.output_center + net.output_width * total


def signals(samples=40, seed=3):
    random = np.random.default_rng(seed)
    return random.normal(size=(samples, 2)), random.normal(size=(samples, 2))


def test_one_step_by_its_definition():
    net, (u, y) = network(), signals()
    found = ahead(net, u, y, 2, 1, -BOUND, BOUND)
    np.testing.assert_array_equal(found[:2], y[:2])
    for k in range(2, 40):
        x = np.array([y[k - 1, 0], y[k - 2, 0], y[k - 1, 1], u[k - 1, 0], u[k, 1], u[k - 1, 1], u[k - 2, 1]])
        np.testing.assert_allclose(found[k], by_definition(net, (x - net.center) / net.width), rtol=1e-12)
    rows = regressors(net.source, net.lag, u, y)
    np.testing.assert_array_equal(rows[-1], x)


def test_free_run_feeds_its_own_outputs_back():
    net, (u, y) = network(), signals()
    run = ahead(net, u, y, 2, len(y), -BOUND, BOUND)
    np.testing.assert_allclose(ahead(net, u, run, 2, 1, -BOUND, BOUND), run, rtol=1e-12)


@pytest.mark.parametrize("steps", [2, 3, 7])
def test_steps_ahead_are_free_runs_from_each_measurement(steps):
    net, (u, y) = network(), signals()
    found = ahead(net, u, y, 2, steps, -BOUND, BOUND)
    for k in (2, 5, 20, 39):
        origin = max(k - steps + 1, 2)
        run = ahead(net, u[: k + 1], y[: k + 1], origin, k + 1, -BOUND, BOUND)
        np.testing.assert_allclose(found[k], run[k], rtol=1e-12)


def test_activations_are_those_of_the_output():
    net, (u, y) = network(), signals()
    z = (regressors(net.source, net.lag, u, y) - net.center) / net.width
    from_units = net.constant + z @ net.linear.T + activations(net, z) @ net.weight.T
    found = ahead(net, u, y, 2, 1, -BOUND, BOUND)[2:]
    np.testing.assert_allclose(net.output_center + net.output_width * from_units, found, rtol=1e-12)


@pytest.mark.parametrize("feedback", [False, True])
@pytest.mark.parametrize("with_linear", [False, True])
def test_slopes_against_differences(feedback, with_linear):
    net, (u, y) = network(), signals()
    point = parameters(net, with_linear)
    steps = len(y) if feedback else 1

    def run(values):
        return ahead(with_parameters(net, values, with_linear), u, y, 2, steps, -BOUND, BOUND) / net.output_width

    past = run(point) * net.output_width if feedback else y
    carry = np.zeros((2, 2, point.size))
    # In two blocks, as a long record is.
    found = np.concatenate([slopes(net, with_linear, u, past, a, b, carry, feedback) for a, b in ((2, 13), (13, 40))])
    unit = 1e-6 * np.eye(point.size)
    expected = np.stack([(run(point + one) - run(point - one))[2:] / 2e-6 for one in unit], axis=-1)
    np.testing.assert_allclose(found, expected, atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("with_linear", [False, True])
def test_parameters_come_back(with_linear):
    net = network()
    values = parameters(net, with_linear)
    again = with_parameters(net, values + 1.0, with_linear)
    np.testing.assert_array_equal(parameters(again, with_linear), values + 1.0)
    np.testing.assert_array_equal(again.linear, net.linear + float(with_linear))
