import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idloop.errors import InputError
from idloop.estimation.black_box.sampled import SampledData
from idloop.estimation.polynomial import arx, arx_structures, estimate_delay, select_order


def delayed(samples, seed, delays, noise=0.3):
    rng = np.random.default_rng(seed)
    u = rng.normal(size=(samples, len(delays)))
    y = np.zeros(samples)
    for t in range(1, samples):
        y[t] = 0.8 * y[t - 1] + noise * rng.normal()
        y[t] += sum(u[t - k, i] for i, k in enumerate(delays) if t >= k)
    names = ("u", "v")[: len(delays)]
    return SampledData("delayed", u, y[:, None], 0.01, names, ("V",) * len(delays), ("y",), ("rad",))


@given(na=st.integers(0, 4), nb=st.integers(1, 4), nk=st.integers(0, 3))
def test_each_loss_of_the_table_is_that_of_the_model_itself(made, na, nb, nk):
    data = made(150)
    table = arx_structures(data, range(5), range(1, 5), range(4))
    index = [(o.na, o.nb[0], o.nk[0]) for o in table.structures].index((na, nb, nk))
    # The table fits every structure to the rows that the largest can use.
    model = arx(data.part(6 - max(na, nb + nk - 1), 150), na, nb, nk)
    assert table.loss[index] == pytest.approx(model.loss, rel=1e-9)
    assert table.criterion("fpe")[index] == pytest.approx(model.fpe, rel=1e-9)
    assert table.criterion("bic")[index] == pytest.approx(model.bic, rel=1e-9)
    assert table.criterion("aic")[index] == pytest.approx(model.aic, rel=1e-9)


def test_validation_loss_is_the_prediction_error_on_the_other_data(made):
    table = arx_structures(made(300), [2], [2], [1], validation=made(200, 1))
    p = arx(made(300), 2, 2).polynomials[0]
    y, u = made(200, 1).output[:, 0], made(200, 1).input[:, 0]
    errors = y[2:] + p.a[1] * y[1:-1] + p.a[2] * y[:-2] - p.b[0][0] * u[1:-1] - p.b[0][1] * u[:-2]
    assert table.validation_loss[0] == pytest.approx(np.mean(errors**2), rel=1e-9)


@pytest.mark.slow
def test_the_true_structure_is_found_more_surely_in_longer_records(made):
    def hits(samples):
        chosen = [
            select_order(arx_structures(made(samples, s), range(1, 6), range(1, 6), range(4)), "bic") for s in range(40)
        ]
        return sum((o.na, o.nb, o.nk) == (2, (2,), (1,)) for o in chosen)

    assert hits(100) < hits(2000)
    assert hits(2000) >= 36


def test_validation_is_the_default_judge(made):
    table = arx_structures(made(500), range(1, 5), range(1, 5), validation=made(500, 1))
    assert select_order(table) == select_order(table, "validation")
    assert select_order(table).na in {2, 3}
    assert select_order(table, "loss").size == 8


@given(first=st.integers(1, 12), second=st.integers(1, 12), seed=st.integers(20, 30))
def test_each_input_has_its_own_delay(first, second, seed):
    found = estimate_delay(delayed(1000, seed, (first, second)), longest=15)
    assert found.delay == (first, second)
    assert found.seconds[0] == pytest.approx(0.01 * (first - 1))


def test_delay_is_found_under_feedback():
    rng = np.random.default_rng(1)
    e, r = rng.normal(size=(2, 5000))
    y, u = np.zeros(5000), np.zeros(5000)
    for t in range(5000):
        if t >= 4:
            y[t] = 0.7 * y[t - 1] + 0.5 * u[t - 4] + e[t]
        u[t] = r[t] - 0.4 * y[t]
    assert estimate_delay(SampledData("loop", u[:, None], y[:, None], 0.1)).delay == (4,)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda d: arx_structures(d, []), "no structures"),
        (lambda d: arx_structures(d, 90, 90), "largest structure"),
        (lambda d: select_order(arx_structures(d), "validation"), "no validation data"),
        (lambda d: select_order(arx_structures(d), "gut"), "'gut' is unknown"),
        (lambda d: estimate_delay(d, longest=0), "shortest <= longest"),
        (lambda d: estimate_delay(d, longest=80), "record longer"),
    ],
)
def test_bad_input_is_one_line(made, call, message):
    with pytest.raises(InputError, match=message):
        call(made(150))
