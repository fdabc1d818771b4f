"""The prefilter stands by itself: both the polynomial and the state-space methods use it."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from idloop.errors import InputError
from idloop.estimation.black_box.prefilter import prefiltered
from idloop.estimation.black_box.sampled import SampledData


@pytest.mark.parametrize(
    "first", ["black_box.prefilter", "polynomial", "linear", "linear.prediction_error", "subspace"]
)
def test_whatever_is_imported_first(first):
    code = (
        f"import idloop.estimation.{first}; from idloop.estimation.black_box.prefilter import prefiltered;"
        "from idloop.estimation.linear import prediction_error; from idloop.estimation.polynomial import arx"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_both_sides_are_filtered_alike_and_the_transient_is_cut_off():
    random = np.random.default_rng(0)
    data = SampledData("record", random.normal(size=(200, 1)), random.normal(size=(200, 2)), 0.01,
                       output_names=("a", "b"), output_units=("-", "-"))  # fmt: skip
    (found,) = prefiltered([data], ([1.0], [1.0, -0.5]))
    whole = np.zeros((200, 1))
    for k in range(200):
        whole[k] = data.input[k] + (0.5 * whole[k - 1] if k else data.input[0])
    cut = 200 - len(found)
    assert cut > 5
    np.testing.assert_allclose(found.input, whole[cut:], atol=1e-12)
    assert prefiltered([data], None) == [data]


def test_an_unstable_filter_is_one_line():
    data = SampledData("record", np.ones((50, 1)), np.ones((50, 1)), 0.01)
    with pytest.raises(InputError, match="prefilter"):
        prefiltered([data], ([1.0], [1.0, -1.1]))
