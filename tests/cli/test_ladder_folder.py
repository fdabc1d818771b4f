"""A folder of a ladder whose files are damaged."""

import json
from pathlib import Path
from types import SimpleNamespace

import pytest

from idloop.errors import InputError
from idloop.reporting.ladder_folder import read_next_experiment

WHOLE = {
    "signal": {"name": "triangle"},
    "adds_to": "command",
    "duration": 4.0,
    "discrimination": 40.0,
    "outcomes": [],
    "text": "t",
    "limits": {"command": 2.0, "position": [-1.0, 1.0], "velocity": None, "rate": None},
    "start": 0.0,
    "controller": None,
    "sample_time": 0.01,
    "rivals": [],
    "noise": [0.1],
    "against_first": False,
}


def read(folder: Path, document: object) -> object:
    (folder / "next.json").write_text(json.dumps(document))
    ladder = SimpleNamespace(suggested_experiment={"text": "t"})
    return read_next_experiment(folder, SimpleNamespace(ladder=ladder, folder=None))


@pytest.mark.parametrize(
    "change",
    [
        {"limits": {**WHOLE["limits"], "position": [-1.0]}},
        {"limits": {**WHOLE["limits"], "position": "x"}},
        {"limits": None},
        {"outcomes": [{"rival": "a"}]},
        {"rivals": [{"label": "a"}]},
    ],
)
def test_a_damaged_next_experiment_is_told_in_one_line(tmp_path: Path, change: dict[str, object]) -> None:
    assert read(tmp_path, WHOLE) is not None
    with pytest.raises(InputError, match=r"next\.json: not a whole experiment"):
        read(tmp_path, {**WHOLE, **change})
