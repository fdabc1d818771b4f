import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from idloop.errors import InputError
from idloop.validation import fit_percent, measures, nrmse, rmse

SERIES = arrays(float, 30, elements=st.floats(-100.0, 100.0))


def test_fit_and_nrmse_of_a_known_error() -> None:
    y = np.array([[0.0], [2.0], [0.0], [2.0]])
    assert rmse(y, y + 0.5) == pytest.approx([0.5])
    assert nrmse(y, y + 0.5) == pytest.approx([0.5])
    assert fit_percent(y, y + 0.5) == pytest.approx([50.0])


def test_mean_has_fit_zero() -> None:
    y = np.array([1.0, 2.0, 6.0])
    assert fit_percent(y, np.full(3, 3.0)) == pytest.approx([0.0])


@given(SERIES, SERIES)
def test_missing_samples_count_as_if_cut_out(y: np.ndarray, y_hat: np.ndarray) -> None:
    holes = y.copy()
    holes[::3] = np.nan
    keep = np.arange(30) % 3 != 0
    assert rmse(holes, y_hat) == pytest.approx(rmse(y[keep], y_hat[keep]))


@given(SERIES, SERIES, st.floats(0.01, 100.0), st.floats(-10.0, 10.0))
def test_nrmse_knows_no_units(y: np.ndarray, y_hat: np.ndarray, scale: float, shift: float) -> None:
    if np.std(y) < 1e-3:
        return
    assert nrmse(scale * y + shift, scale * y_hat + shift) == pytest.approx(nrmse(y, y_hat), rel=1e-6)


def test_constant_output_missed_is_infinite_and_json_gets_none() -> None:
    table = measures(("a", "b"), np.ones((4, 2)), np.column_stack([np.ones(4), np.zeros(4)]))
    assert table["nrmse"] == {"a": 0.0, "b": None}
    assert table["rmse"]["b"] == 1.0


def test_never_measured_output_is_nan() -> None:
    assert np.isnan(rmse(np.full((5, 1), np.nan), np.zeros((5, 1)))[0])


def test_shapes_must_agree() -> None:
    with pytest.raises(InputError, match="simulate the model at the measurement times"):
        rmse(np.zeros(3), np.zeros(4))
