"""Tensors become columns; a pickle that names anything else is refused and never run."""

from __future__ import annotations

import os
import pickle

import numpy as np
import pytest
from tests.records.formats.writers import torch_archive, torch_legacy

from idloop.errors import InputError
from idloop.records.tables.table_files import read_table

T, U = np.arange(5) * 0.01, np.array([1.0, -1.0, 0.5, 0.0, 2.0], dtype=np.float32)


@pytest.mark.parametrize("write", [torch_archive, torch_legacy])
def test_tensors_by_key(tmp_path, write):
    path = tmp_path / "log.pt"
    path.write_bytes(write({"t": T, "u": U, "y": np.arange(10.0).reshape(5, 2), "n": np.arange(5), "gain": 2.5,
                            "name": "motor", "runs": [{"q": T}, {"q": U}]}))  # fmt: skip
    table = read_table(path)
    np.testing.assert_array_equal(table.numbers("t"), T)
    np.testing.assert_array_equal(table.numbers("u"), U)
    np.testing.assert_array_equal(table.numbers("y[1]"), np.arange(1.0, 10.0, 2.0))
    np.testing.assert_array_equal(table.numbers("n"), np.arange(5))
    assert table.attributes == {"gain": 2.5, "name": "motor"}
    assert {"runs[0].q", "runs[1].q"} <= set(table.columns)


def test_a_transposed_tensor_and_the_other_types(tmp_path):
    turned = np.arange(8.0).reshape(2, 4).T
    others = {code: np.array([0, 1, 1, 0], dtype=code) for code in ("f2", "i4", "i2", "i1", "u1", "b1")}
    (tmp_path / "a.pth").write_bytes(torch_archive({"y": turned} | others))
    table = read_table(tmp_path / "a.pth")
    np.testing.assert_array_equal(table.numbers("y[1]"), turned[:, 1])
    for code in others:
        np.testing.assert_array_equal(table.numbers(code), [0, 1, 1, 0])


def test_a_single_matrix_and_a_list_of_samples(tmp_path):
    (tmp_path / "a.pt").write_bytes(torch_archive(np.arange(12.0).reshape(6, 2)))
    (tmp_path / "b.pt").write_bytes(torch_archive([{"t": 0.0, "u": 1.0}, {"t": 0.1, "u": 2.0}]))
    assert len(read_table(tmp_path / "a.pt").columns) == 2
    np.testing.assert_array_equal(read_table(tmp_path / "b.pt").numbers("u"), [1.0, 2.0])


class _Runs:
    def __init__(self, target):
        self.target = target

    def __reduce__(self):
        return os.mkdir, (self.target,)


@pytest.mark.parametrize("protocol", [0, 1, 2, 3, 4, 5])
def test_a_pickle_that_would_run_something_is_refused(tmp_path, protocol):
    target = str(tmp_path / "made")
    (tmp_path / "a.pt").write_bytes(torch_archive(None, pickle.dumps({"u": [1.0], "x": _Runs(target)}, protocol)))
    with pytest.raises(InputError, match=r"holds an object of posix\.mkdir, which is not read") as caught:
        read_table(tmp_path / "a.pt")
    assert "\n" not in str(caught.value)
    assert not os.path.exists(target)  # noqa: PTH110


def _aliases(levels):
    value = []
    for _ in range(levels):
        value = [value, value]
    return value


BAD = {
    "values that stand for billions": (pickle.dumps(_aliases(40)), "more than 200,000 values beside its tensors"),
    "cut off": (pickle.dumps({"t": [1.0, 2.0]})[:-6], "it is damaged|it is cut off"),
    "an unknown opcode": (b"\x80\x02\xff.", "it is damaged"),
    "a memo of four billion entries": (b"\x80\x02Nr\xff\xff\xff\xff.", "it is damaged"),
    "a key that is a tuple": (b"\x80\x02}))s.", "there are no rows of data"),
    "a number as a function": (b"\x80\x02K\x01)R.", "it is damaged"),
    "an extension": (b"\x80\x02\x82\x01.", "it is damaged|which is not read"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_files(tmp_path, name):
    pickled, words = BAD[name]
    (tmp_path / "a.pt").write_bytes(torch_archive(None, pickled))
    with pytest.raises(InputError, match=words) as caught:
        read_table(tmp_path / "a.pt")
    assert "\n" not in str(caught.value)


def test_a_tensor_that_is_larger_than_its_storage(tmp_path):
    whole = torch_legacy({"u": U})
    shape = b"(J\x05\x00\x00\x00t(J\x01"
    assert whole.count(shape) == 1
    (tmp_path / "a.pt").write_bytes(whole.replace(shape, shape.replace(b"\x05", b"\x06")))
    with pytest.raises(InputError, match="a tensor beyond its storage"):
        read_table(tmp_path / "a.pt")


def test_a_legacy_file_that_is_cut_off(tmp_path):
    (tmp_path / "a.pt").write_bytes(torch_legacy({"u": U})[:-3])
    with pytest.raises(InputError, match="it is cut off"):
        read_table(tmp_path / "a.pt")
