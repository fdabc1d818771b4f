"""A recording cut off anywhere gives back what was written before the cut."""

import sqlite3
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from idloop.errors import IdloopError, InputError
from idloop.records import read_streams, write_bag
from idloop.records.bags.recover import recover_bag
from idloop.records.bags.write import make_stream

STAMPS = np.arange(1, 20_001, dtype=np.int64) * 10_000_000


@pytest.fixture(params=["mcap", "sqlite3"])
def bag(tmp_path: Path, request: pytest.FixtureRequest) -> Path:
    stream = make_stream("joint_states", STAMPS, {"motor": {"position": np.sin(np.arange(20_000.0))}})
    return write_bag(tmp_path / "whole", [stream], storage=request.param)


def file_of(bag: Path) -> Path:
    return next(one for one in bag.iterdir() if one.suffix in (".mcap", ".db3"))


def test_a_whole_bag_is_copied_whole(bag: Path, tmp_path: Path) -> None:
    result = recover_bag(bag, tmp_path / "saved")
    assert (result.messages, result.cut) == (20_000, ())
    before, after = read_streams(bag)["/joint_states"], read_streams(tmp_path / "saved")["/joint_states"]
    np.testing.assert_array_equal(after.stamp_ns, before.stamp_ns)
    np.testing.assert_array_equal(after.position, before.position)


@pytest.mark.slow
@settings(max_examples=15, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(part=st.floats(0.6, 0.95))
def test_what_is_saved_of_a_cut_bag_is_its_beginning(bag: Path, tmp_path_factory, part: float) -> None:
    folder = tmp_path_factory.mktemp("cut")
    whole = file_of(bag)
    cut = folder / f"cut{whole.suffix}"
    cut.write_bytes(whole.read_bytes()[: int(part * whole.stat().st_size)])
    result = recover_bag(cut, folder / "saved")
    assert result.cut == (cut,)
    saved = read_streams(folder / "saved")["/joint_states"]
    assert 0 < result.messages <= 20_000  # all of them where only the index is cut
    np.testing.assert_array_equal(saved.stamp_ns, STAMPS[: result.messages])


def test_a_message_with_a_damaged_time_is_kept_at_the_time_before_it(tmp_path: Path) -> None:
    stamps = STAMPS[:100]
    stream = make_stream("joint_states", stamps, {"motor": {"position": np.arange(100.0)}})
    file = file_of(write_bag(tmp_path / "whole", [stream], storage="sqlite3"))
    with sqlite3.connect(file) as connection:
        connection.execute("UPDATE messages SET timestamp = ? WHERE timestamp = ?", (-5, int(stamps[40])))
    connection.close()
    result = recover_bag(file, tmp_path / "saved")
    assert (result.messages, result.cut) == (100, (file,))
    assert result.duration == pytest.approx(0.99)
    saved = read_streams(tmp_path / "saved")["/joint_states"]
    np.testing.assert_array_equal(np.sort(saved.position[:, 0]), np.arange(100.0))


def test_nothing_readable_is_said_and_leaves_nothing(bag: Path, tmp_path: Path) -> None:
    whole = file_of(bag)
    cut = tmp_path / f"cut{whole.suffix}"
    cut.write_bytes(whole.read_bytes()[:2000])
    with pytest.raises(IdloopError, match="no message"):
        recover_bag(cut, tmp_path / "saved")
    assert not (tmp_path / "saved").exists()


def test_an_existing_bag_is_never_written_over(bag: Path) -> None:
    with pytest.raises(InputError, match="not overwritten"):
        recover_bag(bag, bag)


def test_a_folder_without_a_recording_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no recording"):
        recover_bag(tmp_path, tmp_path / "new")


def test_a_bag_of_many_files_keeps_its_order(tmp_path: Path) -> None:
    from mcap.stream_reader import StreamReader

    bag = tmp_path / "bag"
    bag.mkdir()
    stamps = np.arange(1, 121, dtype=np.int64) * 10**9
    for number in range(12):
        part = stamps[10 * number : 10 * number + 10]
        one = write_bag(tmp_path / "one", [make_stream("joint_states", part, {"m": {"position": part * 1e-9}})])
        next(one.glob("*.mcap")).rename(bag / f"bag_{number}.mcap")
        (one / "metadata.yaml").unlink()
        one.rmdir()
    recover_bag(bag, tmp_path / "saved")
    with next((tmp_path / "saved").glob("*.mcap")).open("rb") as stream:
        written = [one.log_time for one in StreamReader(stream).records if hasattr(one, "publish_time")]
    assert written == stamps.tolist()
