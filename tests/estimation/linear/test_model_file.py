"""Linear models survive their files, and python-control users need nothing of ours to read them."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import control
from idloop.errors import IdloopError, InputError
from idloop.estimation.linear import Coefficient, LinearModel, load, save

MODEL = LinearModel(
    method="oe", a=np.array([[0.9, 0.1], [0.0, 0.8]]), b=np.array([[0.0], [1.0]]), c=np.array([[1.0, 0.0]]),
    d=np.zeros((1, 1)), gain=np.array([[0.2], [0.1]]), covariance=np.array([[0.3]]), sample_time=0.01,
    input_names=("motor.effort",), input_units=("V",), output_names=("motor.velocity",), output_units=("rad/s",),
    samples=500, free=4, coefficients=(Coefficient("f1", -1.7, 0.01), Coefficient("f2", 0.72)), notes=("ä note",),
    start="arx",
)  # fmt: skip


@pytest.mark.parametrize("suffix", (".json", ".npz"))
def test_what_is_saved_is_loaded(suffix, tmp_path):
    path = save(MODEL, tmp_path / f"model{suffix}")
    again = load(path)
    for name in ("a", "b", "c", "d", "gain", "covariance"):
        np.testing.assert_array_equal(getattr(again, name), getattr(MODEL, name))
    for name in ("method", "sample_time", "input_names", "input_units", "output_names", "output_units", "samples",
                 "free", "notes", "bic", "start"):  # fmt: skip
        assert getattr(again, name) == getattr(MODEL, name)
    assert again.coefficients[0] == MODEL.coefficients[0]
    assert np.isnan(again.coefficients[1].stderr)
    assert again.system.input_labels == ["motor_effort"]


@pytest.mark.parametrize("suffix", (".json", ".npz"))
def test_a_gain_without_states_is_loaded(suffix, tmp_path):
    still = replace(
        MODEL, a=np.zeros((0, 0)), b=np.zeros((0, 1)), c=np.zeros((1, 0)), d=np.array([[2.0]]), gain=np.zeros((0, 1))
    )
    again = load(save(still, tmp_path / f"model{suffix}"))
    assert (again.order, again.d[0, 0], again.c.shape) == (0, 2.0, (1, 0))


def test_python_control_reads_the_file_without_us(tmp_path):
    m = json.loads(save(MODEL, tmp_path / "model.json").read_text(encoding="utf-8"))
    system = control.ss(m["a"], m["b"], m["c"], m["d"], m["sample_time"])
    np.testing.assert_allclose(system.poles(), MODEL.system.poles())
    assert system.dt == 0.01


def test_wrong_files_are_one_line(tmp_path):
    with pytest.raises(InputError, match=r"suffix \.json or \.npz"):
        save(MODEL, tmp_path / "model.mat")
    with pytest.raises(InputError, match="check the path"):
        load(tmp_path / "none.json")
    with pytest.raises(IdloopError, match="cannot write"):
        save(MODEL, tmp_path / "no folder" / "model.json")
    for name, content in (("a.json", b"{}"), ("b.json", b"nonsense"), ("c.npz", b"PK nonsense"), ("d.npz", b"")):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(InputError, match=name) as caught:
            load(tmp_path / name)
        assert "\n" not in str(caught.value)
    cut = json.loads(save(MODEL, tmp_path / "cut.json").read_text(encoding="utf-8"))
    cut["b"] = [[1.0]]
    (tmp_path / "cut.json").write_text(json.dumps(cut), encoding="utf-8")
    with pytest.raises(InputError, match="b has shape"):
        load(tmp_path / "cut.json")
