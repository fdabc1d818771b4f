"""What a reader in a process of its own returns, raises, or leaves behind when it ends."""

from __future__ import annotations

import os
import time
from pathlib import Path

import numpy as np
import pytest

from idloop.errors import InputError
from idloop.records.formats import isolated
from idloop.records.formats.isolated import read_isolated


@pytest.fixture
def path(tmp_path):
    (tmp_path / "log").write_bytes(b"x")
    return tmp_path / "log"


def test_arrays_texts_and_numbers(path):
    content = {
        "u": np.arange(6.0).reshape(2, 3),
        "n": np.arange(3, dtype=np.int16),
        "texts": np.array(["a", "bc"]),
        "none": np.empty((0, 2)),
        "inner": [{"x": np.array(2.5)}, {"y": ["a", None, 1.5]}],
        "gain": 2.5,
        "name": "motor",
    }
    found = read_isolated(path, "test", lambda: content)
    assert list(found) == list(content)
    for name in ("u", "n", "texts", "none"):
        np.testing.assert_array_equal(found[name], content[name])
        assert found[name].dtype == content[name].dtype
    assert found["inner"][0]["x"] == 2.5
    assert found["inner"][1] == {"y": ["a", None, 1.5]}
    assert (found["gain"], found["name"]) == (2.5, "motor")


def test_an_array_of_texts_and_arrays_is_sent_and_what_is_neither_is_not(path):
    several = np.array(["a", np.arange(3.0), object()], dtype=object)
    found = read_isolated(path, "test", lambda: {"several": several, "o": np.array([[{}]], dtype=object), "c": 1j})
    assert (found["o"], found["c"]) == (None, None)
    assert found["several"].dtype == object
    text, array, nothing = found["several"]
    assert (text, nothing) == ("a", None)
    np.testing.assert_array_equal(array, np.arange(3.0))


def test_its_error_is_raised(path):
    def read():
        raise InputError("what is wrong")

    with pytest.raises(InputError, match=r"^what is wrong$"):
        read_isolated(path, "test", read)


def _children():
    """Processes of this one, those of other tests of the same worker included."""
    return set(Path(f"/proc/self/task/{os.getpid()}/children").read_text().split())


def _end():
    os.kill(os.getpid(), 11)


def _raise():
    raise ValueError


def _take_memory():
    return np.ones(1 << 34)


@pytest.mark.parametrize(
    ("read", "said"),
    [
        (_end, "not a readable test file .its reader broke off."),
        (_raise, "not a readable test file .ValueError."),
        (_take_memory, "its values take more than"),
    ],
)
def test_its_end_is_one_line(path, read, said):
    with pytest.raises(InputError, match=said):
        read_isolated(path, "test", read)


def test_no_answer_is_one_line(path, monkeypatch):
    monkeypatch.setattr(isolated, "LONGEST", 0.1)
    with pytest.raises(InputError, match="its reader does not come to an end"):
        read_isolated(path, "test", lambda: time.sleep(60))


def test_no_process_is_left(path):
    before = _children()
    read_isolated(path, "test", lambda: 1)
    assert _children() <= before
