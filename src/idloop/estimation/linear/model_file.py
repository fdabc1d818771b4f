"""Linear models as files that anything reads: JSON, or NPZ for NumPy."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from idloop.documents import MOST_JSON, NOT_WHOLE, read_json, read_npz, read_text
from idloop.errors import InputError
from idloop.estimation.linear.model import Coefficient, LinearModel
from idloop.json_values import to_json
from idloop.output_files import write_text, writing

SCHEMA = "idloop/linear-model/1"
SUFFIXES = (".json", ".npz")

_OURS = {"kalman_gain": "gain", "innovation_covariance": "covariance"}
_NAMES = ("input_names", "input_units", "output_names", "output_units", "notes")


def save(model: LinearModel, path: Path | str) -> Path:
    """Write a linear model.

    The keys ``a``, ``b``, ``c``, ``d`` and ``sample_time`` are the arguments of ``control.ss``.

    Parameters
    ----------
    path : Path or str
        The suffix chooses the format: ``.json`` or ``.npz``.

    Raises
    ------
    InputError
        Another suffix.
    IdloopError
        The file cannot be written.
    """
    path = check_suffix(Path(path))
    content: dict[str, Any] = {
        "schema": SCHEMA,
        "method": model.method,
        "start": model.start,
        "sample_time": float(model.sample_time),
        "samples": int(model.samples),
        "free": int(model.free),
        **{name: list(getattr(model, name)) for name in _NAMES},
        **{name: getattr(model, name) for name in ("a", "b", "c", "d")},
        "kalman_gain": model.gain,
        "innovation_covariance": np.atleast_2d(model.covariance),
        "coefficient_names": [c.name for c in model.coefficients],
        "coefficient_values": np.array([c.value for c in model.coefficients]),
        "coefficient_stderr": np.array([c.stderr for c in model.coefficients]),
    }
    if path.suffix.lower() == ".npz":
        arrays: dict[str, Any] = {key: np.asarray(value) for key, value in content.items()}
        # Given as an open file, NumPy leaves the name as it is.
        with writing(path), path.open("wb") as file:
            np.savez_compressed(file, **arrays)
    else:
        write_text(path, json.dumps(to_json(content), indent=2, ensure_ascii=False) + "\n")
    return path


def load(path: Path | str) -> LinearModel:
    """Read what `save` wrote; ``load(path).system`` is a python-control StateSpace.

    Raises
    ------
    InputError
        No such file, or not one of a linear model.
    """
    path = check_suffix(Path(path))
    try:
        content = _content(path)
        matrices = _matrices(content)
        names: dict[str, Any] = {name: tuple(map(str, content[name])) for name in _NAMES}
        coefficients = zip(
            content["coefficient_names"], content["coefficient_values"], content["coefficient_stderr"], strict=True
        )
        return LinearModel(
            method=str(content["method"]),
            start=str(content.get("start", "")),
            **matrices,
            sample_time=float(content["sample_time"]),
            samples=int(content["samples"]),
            free=int(content["free"]),
            coefficients=tuple(Coefficient(str(n), _number(v), _number(e)) for n, v, e in coefficients),
            **names,
        )
    except NOT_WHOLE as error:
        raise InputError(f"{path}: damaged, or not a linear model ({' '.join(str(error).split())})") from None


def check_suffix(path: Path) -> Path:
    """Return `path` when its suffix is one of `SUFFIXES`."""
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"{path}: a linear model is a file with the suffix {' or '.join(SUFFIXES)}")
    return path


def _content(path: Path) -> dict[str, Any]:
    if path.suffix.lower() == ".npz":
        content: Any = {key: array.tolist() for key, array in read_npz(path, MOST_JSON).items()}
    else:
        content = read_json(read_text(path, MOST_JSON), str(path))
    if not isinstance(content, dict) or content.get("schema") != SCHEMA:
        raise InputError(f"{path}: no linear model in it; its schema must be {SCHEMA}")
    return dict(content)


def _matrices(content: dict[str, Any]) -> dict[str, Any]:
    """Matrices by their names in `LinearModel`."""
    n, m, p = len(content["a"]), len(content["input_names"]), len(content["output_names"])
    shapes: dict[str, tuple[int, int]] = {
        "a": (n, n), "b": (n, m), "c": (p, n), "d": (p, m), "kalman_gain": (n, p), "innovation_covariance": (p, p),
    }  # fmt: skip
    found: dict[str, Any] = {}
    for name, shape in shapes.items():
        rows = [[_number(value) for value in row] for row in content[name]]
        # A model without states has rows without numbers, which have lost their shape.
        matrix = np.array(rows, dtype=float)
        if matrix.size != shape[0] * shape[1]:
            raise ValueError(f"{name} has shape {matrix.shape}, not {shape}")
        found[_OURS.get(name, name)] = matrix.reshape(shape)
    return found


def _number(value: Any) -> float:
    return float("nan") if value is None else float(value)
