import numpy as np
import pytest

from idloop.errors import InputError
from idloop.estimation.subspace import n4sid, pbsid, select_order, singular_value_plot
from idloop.estimation.subspace.order import significant


@pytest.mark.parametrize("method", ["n4sid", "moesp", "cva"])
def test_selection_shows_the_gap(method, true, made):
    found = select_order(made(true, 3000, 0.2), method)
    assert found.order == 3
    assert found.singular_values[2] > 2.0 * found.singular_values[3]
    assert found.correlations[2] > found.threshold > found.correlations[3]
    assert found.to_dict()["order"] == 3
    top, bottom = found.plot()
    assert top.get_ylabel() == "singular value [-]"
    assert bottom.get_ylabel() == "canonical correlation [-]"


def test_canonical_correlations_of_variates_weights_are_the_singular_values(true, made):
    found = select_order(made(true, 3000, 0.2), "cva", horizon=10)
    np.testing.assert_allclose(found.singular_values[:8], found.correlations[:8], atol=1e-8)


def test_unrelated_data_stay_below_the_threshold():
    rng = np.random.default_rng(0)
    for _ in range(20):
        past, future = (np.linalg.qr(rng.normal(size=(2000, size)))[0] for size in (40, 20))
        order, threshold = significant(np.linalg.svd(past.T @ future)[1], 40, 20, 2000)
        assert order == 1
        assert np.linalg.svd(past.T @ future)[1][0] < threshold


def test_singular_value_plot(true, made):
    axes = singular_value_plot(n4sid(made(true, 1000, 0.1), 3))
    assert axes.get_yscale() == "log"
    assert len(axes.lines[0].get_xdata()) == 3
    assert singular_value_plot(pbsid(made(true, 1000, 0.1), 3)).get_title() == "pbsid, order 3"


def test_other_models_have_no_singular_values(true, made):
    from dataclasses import replace

    model = replace(n4sid(made(true, 1000, 0.1), 3), singular_values=None, method="oe")
    with pytest.raises(InputError, match="model oe has no singular values"):
        singular_value_plot(model)
