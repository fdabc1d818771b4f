"""Networks as JSON files that load again."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from idloop.documents import MOST_JSON, read_json, read_text
from idloop.errors import IdloopError, InputError
from idloop.estimation.networks.model import NarxModel

SCHEMA = "idloop/narx-model/1"


def save(model: NarxModel, path: Path | str) -> Path:
    """Write a network.

    Parameters
    ----------
    model : NarxModel
    path : Path or str
        With the suffix ``.json``.

    Returns
    -------
    Path

    Raises
    ------
    InputError
        Another suffix.
    IdloopError
        The file cannot be written.
    """
    path = check_suffix(Path(path))
    document = {"schema": SCHEMA, **_plain(model.to_dict())}
    try:
        path.write_text(json.dumps(document, ensure_ascii=False, allow_nan=False) + "\n", encoding="utf-8")
    except OSError as error:
        raise IdloopError(f"cannot write {path}: {error.strerror or error}") from error
    return path


def load(path: Path | str) -> NarxModel:
    """Read what `save` wrote.

    Raises
    ------
    InputError
        No such file, or not one of a network.
    """
    path = check_suffix(Path(path))
    content = read_json(read_text(path, MOST_JSON), str(path))
    if not isinstance(content, dict) or content.get("schema") != SCHEMA:
        raise InputError(f"{path}: no network in it; its schema must be {SCHEMA}")
    try:
        return NarxModel.from_dict(content)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def check_suffix(path: Path) -> Path:
    """Return `path` when it ends with ``.json``."""
    if path.suffix.lower() != ".json":
        raise InputError(f"{path}: a network is a file with the suffix .json")
    return path


def _plain(value: Any) -> Any:
    """Nested lists of arrays, with null for what is not finite."""
    if isinstance(value, dict):
        return {key: _plain(one) for key, one in value.items()}
    if isinstance(value, np.ndarray | list | tuple):
        return [_plain(one) for one in (value.tolist() if isinstance(value, np.ndarray) else value)]
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    return value.item() if isinstance(value, np.integer) else value
