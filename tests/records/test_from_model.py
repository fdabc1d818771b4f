"""A record has the names, units and clock of the model whose machine it is of."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.errors import InputError
from idloop.physics import load_model
from idloop.records import record_from_model

MODEL = load_model("dc_motor")
TIME = np.arange(5) * 0.01
COMMAND = np.array([0.0, 1.0, 2.0, 1.0, 0.0])
OUTPUT = np.column_stack([0.1 * TIME, np.full(5, 0.1)])


def test_names_and_units_are_the_models():
    record = record_from_model("swing", MODEL, TIME, COMMAND, OUTPUT)
    assert (record.name, record.input_name, record.input_unit) == ("swing", "motor.effort", "V")
    assert record.output_names == ("motor.position", "motor.velocity")
    assert record.output_units == ("rad", "rad/s")
    np.testing.assert_array_equal(record.input, COMMAND)
    np.testing.assert_array_equal(record.output, OUTPUT)
    assert record.input_time is record.time is TIME
    assert record.reference is record.reference_time is None


def test_a_reference_is_on_the_same_clock():
    reference = np.column_stack([COMMAND, np.full(5, np.nan)])
    record = record_from_model("followed", MODEL, TIME, COMMAND, OUTPUT, reference)
    assert record.reference is reference
    assert record.reference_time is TIME


def test_samples_that_do_not_fit_the_model_are_refused():
    with pytest.raises(InputError, match="swing: output"):
        record_from_model("swing", MODEL, TIME, COMMAND, OUTPUT[:, :1])
