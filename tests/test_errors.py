"""Whatever an error quotes, it is one line that a terminal can print."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from idloop.errors import LONGEST_LINE, IdloopError, InputError


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("m.yaml: unknown key 'a\n b'", "m.yaml: unknown key 'a b'"),
        ("no joint 'a\x1b[31m'", "no joint 'a\\x1b[31m'"),
        ("no file '\udcff.csv'", "no file '\\udcff.csv'"),
        ("a\u2028b\rc", "a b c"),
        ("5 N·m, 3 °", "5 N·m, 3 °"),
    ],
)
def test_what_is_quoted_can_be_printed(text: str, line: str) -> None:
    assert str(InputError(text)) == line


def test_a_line_has_an_end_and_both_of_its_ends_are_shown() -> None:
    line = str(IdloopError("m.yaml: " + "x" * 10**6 + ": mend it"))
    assert len(line) < LONGEST_LINE
    assert line.startswith("m.yaml: xxx")
    assert line.endswith("xxx: mend it")


@given(st.text())
def test_any_text_is_one_line(text: str) -> None:
    line = str(IdloopError(text))
    assert line.isprintable()
    line.encode("utf-8")
