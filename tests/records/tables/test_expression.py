"""Formulas over columns: right values, and nothing but arithmetic."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idloop.errors import InputError
from idloop.records.tables.expression import Expression, in_backquotes

COLUMNS = {
    "arm.q": np.array([3.0, 4.0]),
    "theta": np.array([1.0, 2.0]),
    "alpha": np.array([0.5, -2.0]),
    "speed [rpm]": np.array([30.0, 60.0]),
}

GOOD = {
    "theta + alpha": [1.5, 0.0],
    "theta - alpha": [0.5, 4.0],
    "-2 * theta * alpha": [-1.0, 8.0],
    "`speed [rpm]` * 2 * pi / 60": [np.pi, 2 * np.pi],
    "abs(alpha) ** 2": [0.25, 4.0],
    "deg2rad(180) * theta": [np.pi, 2 * np.pi],
    "arm.q - theta": [2.0, 2.0],
    "theta / (alpha + 2)": [0.4, np.nan],
}


@pytest.mark.parametrize("text", GOOD)
def test_values(text):
    np.testing.assert_allclose(Expression(text).evaluate(COLUMNS), GOOD[text])


def test_its_columns_are_named_once():
    assert Expression("theta * `speed [rpm]` + theta - pi").columns == ["theta", "speed [rpm]"]


@pytest.mark.parametrize(
    ("text", "right"),
    [
        ("0/1023 * 2", "`0/1023` * 2"),
        ("speed [rpm] / 30", "`speed [rpm]` / 30"),
        ("`speed [rpm]` / 30", "`speed [rpm]` / 30"),
        ("a-b + a - b", "`a-b` + a - b"),
        ("10/1023 + theta", "10/1023 + theta"),
        ("arm.q * 1", "arm.q * 1"),
        ("-speed [rpm] - speed", "-`speed [rpm]` - speed"),
    ],
)
def test_names_that_need_backquotes_get_them(text, right):
    assert in_backquotes(text, [*COLUMNS, "0/1023", "a-b", "a", "b", "speed", "1"]) == right


BAD = {
    "theta +": "is no formula",
    "__import__('os')": "no function '__import__'",
    "sin(theta).real": "holds more than columns",
    "theta[0]": "holds more than columns",
    "open(theta)": "no function 'open'",
    "sin(theta, 2)": "holds more than columns",
    "lambda: 1": "holds more than columns",
    "theta if alpha else 2": "holds more than columns",
    "theta < 1": "holds more than columns",
    "'a' * 3": "holds more than columns",
    "True + theta": "no formula of numbers",
    "(" * 60 + "theta" + ")" * 60 + "+" * 2000: "characters",
    "-" * 80 + "theta": "nested too deeply",
}


@pytest.mark.parametrize("text", BAD)
def test_what_is_no_formula(text):
    with pytest.raises(InputError) as caught:
        Expression(text)
    assert BAD[text] in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_column_is_named():
    with pytest.raises(InputError, match=r"no column 'thta'.*did you mean 'theta'"):
        Expression("thta + alpha").evaluate(COLUMNS)


@given(st.text(alphabet="thea+-*/()`_.[]019 ,:='\"lmbdfor\\\n", max_size=40))
def test_any_text_is_a_formula_or_one_line(text):
    try:
        shape = Expression(text).evaluate(COLUMNS).shape
    except InputError:
        return
    assert shape in {(), (2,)}
