"""A bag whose metadata do not fit its messages is refused in one line, and its messages can still be saved."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from idloop.errors import InputError
from idloop.records import read_streams, write_bag
from idloop.records.bags.recover import recover_bag
from idloop.records.bags.write import make_stream
from idloop.records.inspection.excitation import analyse_command
from idloop.records.inspection.inspection import inspect_bag

STAMPS = np.arange(1, 201, dtype=np.int64) * 5_000_000


@pytest.fixture(params=["mcap", "sqlite3"])
def bag(tmp_path: Path, request: pytest.FixtureRequest) -> Path:
    stream = make_stream("joint_command", STAMPS, {"axis": {"effort": np.sign(np.sin(0.1 * np.arange(200.0)))}})
    return write_bag(tmp_path / "whole", [stream], storage=request.param, custom={"note": "x"})


@pytest.mark.parametrize(
    ("old", "new"),
    [(r"custom_data:\n    .*\n", "custom_data: [a, b]\n"), (r"- message_count: 200\n", "- message_count: many\n")],
)
@pytest.mark.parametrize("read", [inspect_bag, read_streams])
def test_metadata_of_another_shape(bag: Path, tmp_path: Path, old: str, new: str, read) -> None:
    metadata = bag / "metadata.yaml"
    changed, count = re.subn(old, new, metadata.read_text())
    assert count == 1
    metadata.write_text(changed)
    with pytest.raises(InputError) as caught:
        read(bag)
    assert "\n" not in str(caught.value)
    assert recover_bag(bag, tmp_path / "saved").messages == 200


def test_messages_that_are_said_to_be_there(bag: Path) -> None:
    metadata = bag / "metadata.yaml"
    metadata.write_text(metadata.read_text().replace("/joint_command", "/joint_kommand"))
    with pytest.raises(InputError, match=r"and has none|cannot be read as a bag"):
        read_streams(bag)


@pytest.mark.filterwarnings("ignore:overflow")
def test_values_beyond_all_measure_have_a_spectrum() -> None:
    time = 0.01 * np.arange(100)
    found = analyse_command(time, 1e300 * np.sin(9.0 * time))
    assert found.maximum == pytest.approx(1e300, rel=0.01)
