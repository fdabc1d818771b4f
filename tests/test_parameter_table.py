"""Validation of declarative parameter tables."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idloop.errors import InputError
from idloop.parameter_table import REQUIRED, ParameterSpec, check_values, read_mapping
from idloop.spelling import did_you_mean

TABLE = (
    ParameterSpec("gain", "float", REQUIRED, "Gain.", unit="V", minimum=0.0, exclusive=True),
    ParameterSpec("count", "int", 3, "Count.", minimum=1, maximum=9),
    ParameterSpec("mode", "str", "slow", "Mode.", choices=("slow", "fast")),
    ParameterSpec("wide", "bool", False, "Wide."),
    ParameterSpec("block.offset", "float", 0.0, "Offset."),
    ParameterSpec("points", "floats", None, "Points.", maximum=1.0),
    ParameterSpec("a", "matrix", None, "Matrix."),
    ParameterSpec("ratio", "float", 1.0, "Ratio.", nonzero=True),
)


def test_defaults_are_filled_in_table_order():
    values = check_values(TABLE, {"gain": 2}, "here")
    assert list(values) == [spec.name for spec in TABLE]
    assert values["gain"] == 2.0
    assert isinstance(values["gain"], float)
    assert values["count"] == 3
    assert values["points"] is None


def test_nested_and_dotted_names_mean_the_same():
    nested = check_values(TABLE, {"gain": 1.0, "block": {"offset": 0.5}}, "here")
    dotted = check_values(TABLE, {"gain": 1.0, "block.offset": 0.5}, "here")
    assert nested == dotted
    assert check_values(TABLE, {"gain": 1.0, "block": None}, "here")["block.offset"] == 0.0


def test_numpy_numbers_become_plain_ones():
    values = check_values(TABLE, {"gain": np.float32(1.5), "count": np.int64(4)}, "here")
    assert type(values["gain"]) is float
    assert type(values["count"]) is int


@pytest.mark.parametrize(
    ("given_values", "words"),
    [
        ({}, "here: gain is missing"),
        ({"gain": 0.0}, "gain is 0 but must be > 0"),
        ({"gain": math.nan}, "gain is nan; give a finite number in V"),
        ({"gain": math.inf}, "gain is inf"),
        ({"gain": "2"}, "gain must be a number in V, got str '2'"),
        ({"gain": True}, "gain must be a number in V, got bool True"),
        ({"gain": None}, "gain must be a number in V, got nothing"),
        ({"gain": [1.0]}, "gain must be a number"),
        ({"gain": 1.0, "count": 2.5}, "count must be a whole number, got float 2.5"),
        ({"gain": 1.0, "count": 10}, "count is 10 but must be >= 1, <= 9"),
        ({"gain": 1.0, "mode": "fats"}, "did you mean 'fast'"),
        ({"gain": 1.0, "mode": 3}, "mode must be a text"),
        ({"gain": 1.0, "wide": 1}, "wide must be true or false"),
        ({"gain": 1.0, "ratio": 0}, "ratio is 0 but must be not 0"),
        ({"gain": 1.0, "points": [0.0, 2.0]}, "points is 2 but must be <= 1"),
        ({"gain": 1.0, "points": 0.5}, "points must be a list of numbers"),
        ({"gain": 1.0, "a": [[1.0], [1.0, 2.0]]}, "rows of a differ in length"),
        ({"gain": 1.0, "a": [1.0]}, "a must be a list of rows"),
        ({"gian": 1.0}, "unknown parameter 'gian' (did you mean 'gain'?)"),
        ({"gain": 1.0, "block": {"ofset": 1.0}}, "(did you mean 'block.offset'?)"),
    ],
)
def test_bad_values_are_refused_in_one_line(given_values, words):
    with pytest.raises(InputError) as error:
        check_values(TABLE, given_values, "here")
    assert words in str(error.value)
    assert "\n" not in str(error.value)


@given(st.recursive(st.none() | st.booleans() | st.floats() | st.text(), st.lists, max_leaves=5))
def test_any_value_is_taken_or_refused_and_what_is_taken_stays(value):
    for spec in TABLE:
        try:
            taken = spec.check(value, "here")
        except InputError:
            continue
        assert spec.check(taken, "here") == taken


def test_range_text_and_ros_type():
    assert TABLE[0].range_text == "> 0"
    assert TABLE[2].range_text == "slow | fast"
    assert [spec.ros_type for spec in TABLE[:4]] == ["double", "integer", "string", "bool"]
    assert TABLE[0].required
    assert not TABLE[1].required


def test_no_suggestion_where_nothing_is_near():
    assert did_you_mean("zzz", ["gain", "count"]) == ""


def test_parameters_in_a_line_of_yaml():
    assert read_mapping("{type: pid, kp: 1.0}", "controller", "{...}") == {"type": "pid", "kp": 1.0}


@pytest.mark.parametrize(("text", "said"), [("[1", "line 1: not valid YAML: "), ("3.0", "no mapping such as {a: 1}")])
def test_what_is_no_line_of_parameters_is_one_line(text, said):
    with pytest.raises(InputError, match="controller: ") as caught:
        read_mapping(text, "controller", "{a: 1}")
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
