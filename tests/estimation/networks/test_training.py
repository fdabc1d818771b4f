import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import least_squares

from idloop.errors import InputError
from idloop.estimation.networks import Division, TrainingRules, narx_neural
from idloop.estimation.networks.network import ahead, parameters, with_parameters
from idloop.estimation.networks.neural import nguyen_widrow
from idloop.estimation.networks.training import mean_squares, train
from idloop.estimation.networks.training_data import TrainingData, divide


def training_data(data, purpose=None, first=2):
    rows = len(data) - first
    purpose = np.zeros(rows, dtype=np.int64) if purpose is None else purpose
    return TrainingData([(data.input, data.output)], purpose, first)


@given(rows=st.lists(st.integers(20, 90), min_size=1, max_size=3), by=st.sampled_from(["random", "blocks"]))
def test_each_row_serves_one_purpose(rows, by):
    split = divide(Division(by=by), rows, np.random.default_rng(0))
    every = np.concatenate([split.train, split.validation, split.test])
    np.testing.assert_array_equal(np.sort(every), np.arange(sum(rows)))
    assert split.validation.size == pytest.approx(0.15 * sum(rows), abs=1.6)
    purpose = split.purposes(sum(rows))
    np.testing.assert_array_equal(np.flatnonzero(purpose == 1), split.validation)
    if by == "blocks":
        # Of each experiment the first part trains and the last tests.
        starts = np.cumsum([0, *rows[:-1]])
        assert np.all(np.isin(starts, split.train))
        assert np.all(np.isin(np.cumsum(rows) - 1, split.test))


@given(hidden=st.integers(1, 30), inputs=st.integers(1, 8), seed=st.integers(0, 5))
def test_nguyen_and_widrows_start(hidden, inputs, seed):
    weight, bias = nguyen_widrow(hidden, inputs, np.random.default_rng(seed))
    np.testing.assert_allclose(np.linalg.norm(weight, axis=1), 1.4 * hidden ** (1 / inputs))
    assert np.all(np.abs(bias) <= 1.4 * hidden ** (1 / inputs) + 1e-12)
    if hidden > 1:
        # The planes are spread evenly.
        np.testing.assert_allclose(
            np.diff(np.sort(bias * np.sign(weight[:, 0]))), 2.8 * hidden ** (1 / inputs) / (hidden - 1)
        )


@pytest.mark.slow
def test_a_teacher_is_found_again(plant):
    """A network of the same size, noise-free data: nothing is left over."""
    rough = narx_neural(plant.narx(0), hidden=2, rules=TrainingRules(epochs=5))
    u = plant.levels(7, 1500)
    taught = plant.pack(u, rough.simulate(plant.pack(u, np.zeros(1500)), "zero"))
    model = narx_neural(taught, hidden=2, restarts=3, rules=TrainingRules(min_gradient=1e-12, max_fail=50))
    assert model.history.test[model.history.best] < 1e-12
    np.testing.assert_allclose(model.simulate(taught), taught.output, atol=1e-4)


@pytest.mark.parametrize("parallel", [False, True])
def test_no_other_method_gets_further_down(plant, parallel):
    made = plant.narx(1, 400)
    data = training_data(made)
    start = narx_neural(made, hidden=3, rules=TrainingRules(epochs=2)).network
    ours, history = train(start, data, TrainingRules(epochs=300), parallel=parallel)
    bound = np.full(1, np.inf)

    def residual(values):
        net = with_parameters(start, values, with_linear=False)
        run = ahead(net, made.input, made.output, 2, 400 if parallel else 1, -bound, bound)
        return ((made.output - run) / net.output_width)[2:, 0]

    theirs = least_squares(residual, parameters(ours, with_linear=False), max_nfev=50)
    assert 2 * theirs.cost / theirs.fun.size == pytest.approx(history.train[-1], rel=0.01)
    assert history.train[-1] < 0.5 * history.train[0]


def test_the_damping_follows_the_rules(plant):
    rules = TrainingRules(epochs=30, mu=1e-2, mu_decrease=0.5, mu_increase=4.0)
    history = narx_neural(plant.narx(0), rules=rules).history
    steps = np.log2(history.mu / 1e-2)
    # After each step one halving and some quadruplings.
    change = np.diff(steps) + 1
    np.testing.assert_allclose(change / 2, np.rint(change / 2), atol=1e-6)
    assert np.all(np.diff(history.train) < 0)


def test_validation_stops_and_the_best_network_is_kept(plant):
    model = narx_neural(plant.narx(0, 300, noise=0.1), hidden=15, rules=TrainingRules(max_fail=4))
    history = model.history
    assert history.stop == "validation"
    assert history.best == np.argmin(history.validation)
    assert len(history.train) - 1 == history.best + 4
    data = training_data(plant.narx(0, 300, noise=0.1), model.split.purposes(298))
    kept = mean_squares(model.network, data, parallel=False)
    np.testing.assert_allclose(
        kept, [history.train[history.best], history.validation[history.best], history.test[history.best]]
    )


@pytest.mark.parametrize("parallel", [False, True])
def test_without_validation_data_training_ends_where_only_noise_is_left_to_gain(plant, parallel):
    data = training_data(plant.narx(0, 1000))
    start = narx_neural(plant.narx(0, 1000), rules=TrainingRules(epochs=1)).network
    _, history = train(start, data, TrainingRules(max_fail=4), parallel=parallel)
    assert history.stop == "gain"
    share = -np.diff(history.train) / history.train[:-1]
    assert np.all(share[-4:] < TrainingRules().min_gain)
    assert share[-5] >= TrainingRules().min_gain
    assert history.best == len(share)
    # What more would come is little.
    _, longer = train(start, data, TrainingRules(epochs=len(share) + 50, min_gain=0.0), parallel=parallel)
    assert longer.train[-1] > 0.97 * history.train[-1]


@pytest.mark.parametrize(
    ("rules", "stop"),
    [
        ({"epochs": 3}, "3 epochs"),
        ({"goal": 0.05}, "goal"),
        ({"min_gradient": 1e-2}, "gradient"),
        ({"mu": 1e-15, "mu_max": 1e-15, "max_fail": 10_000}, "damping"),
    ],
)
def test_every_way_to_stop(plant, rules, stop):
    assert narx_neural(plant.narx(0), rules=TrainingRules(**rules)).history.stop == stop


def test_a_free_run_that_overflows_at_the_start_is_told(plant):
    data = plant.narx(0)
    net = narx_neural(data, rules=TrainingRules(epochs=1)).network
    wild = net._replace(linear=np.array([[1e3, 0.0, 0.0, 0.0]]))
    same, history = train(wild, training_data(data), TrainingRules(), parallel=True)
    assert history.stop == "the free run diverges at the start"
    assert same is wild


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: TrainingRules(epochs=-1), "epochs"),
        (lambda: TrainingRules(max_fail=0), "validation checks"),
        (lambda: TrainingRules(min_gain=1.0), "gain of 1 "),
        (lambda: TrainingRules(mu=0.0), "mu = 0"),
        (lambda: TrainingRules(mu_decrease=2.0), "factors"),
        (lambda: Division(0.7, 0.7, 0.15), "add up"),
        (lambda: Division(0.0, 0.5, 0.5), "add up"),
        (lambda: Division(by="stripes"), "stripes"),
    ],
)
def test_bad_rules_are_one_line(make, message):
    with pytest.raises(InputError, match=message) as caught:
        make()
    assert "\n" not in str(caught.value)
