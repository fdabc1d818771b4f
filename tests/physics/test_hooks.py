"""Equations of effects as machine code."""

import ctypes
import math

import pytest

from idloop.physics.hooks import hook


def ratio(a, b, c, elapsed, state, parameters):
    return a / b


def test_a_division_by_nothing_is_infinite_and_no_error_inside_the_simulator():
    address = hook(ratio).address
    number = ctypes.c_double
    compiled = ctypes.CFUNCTYPE(number, number, number, number, number, ctypes.c_void_p, ctypes.c_void_p)(address)
    assert compiled(6.0, 2.0, 0.0, 0.0, None, None) == pytest.approx(3.0)
    assert compiled(1.0, 0.0, 0.0, 0.0, None, None) == math.inf
    assert math.isnan(compiled(0.0, 0.0, 0.0, 0.0, None, None))
