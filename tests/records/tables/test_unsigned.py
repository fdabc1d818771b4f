"""Integers that lost their sign get it back."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idloop.errors import InputError
from idloop.records.tables.signals import sign_magnitude, twos_complement

BITS = {"int8": 8, "int16": 16, "int32": 32}


@given(st.sampled_from(list(BITS)), st.data())
def test_twos_complement_inverts_the_cast(kind, data):
    half = 2 ** (BITS[kind] - 1)
    true = np.array(data.draw(st.lists(st.integers(-half, half - 1), max_size=20)), dtype=float)
    np.testing.assert_array_equal(twos_complement(np.mod(true, 2.0 ** BITS[kind]), kind), true)


@given(st.integers(1, 30), st.data())
def test_sign_magnitude_inverts_its_encoding(bit, data):
    true = np.array(data.draw(st.lists(st.integers(-(2**bit) + 1, 2**bit - 1), max_size=20)), dtype=float)
    np.testing.assert_array_equal(sign_magnitude(np.abs(true) + 2.0**bit * (true < 0), bit), true)


def test_unmeasured_stays_unmeasured_and_wrong_columns_are_refused():
    assert np.isnan(twos_complement(np.array([np.nan, 1.0]), "int16")[0])
    for bad in (0.5, 70_000.0):
        with pytest.raises(InputError, match="no such integer"):
            twos_complement(np.array([bad]), "int16")
        with pytest.raises(InputError, match="no such integer"):
            sign_magnitude(np.array([bad]), 15)
