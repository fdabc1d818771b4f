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


@pytest.fixture
def small(tmp_path: Path) -> Path:
    return write_bag(
        tmp_path / "small", [make_stream("joint_states", STAMPS[:50], {"motor": {"position": STAMPS[:50]}})]
    )


def file_of(bag: Path) -> Path:
    return next(one for one in bag.iterdir() if one.suffix in (".mcap", ".db3"))


def test_a_whole_bag_is_copied_whole(bag: Path, tmp_path: Path) -> None:
    result = recover_bag(bag, tmp_path / "saved")
    assert (result.messages, result.cut) == (20_000, ())
    before, after = read_streams(bag)["/joint_states"], read_streams(tmp_path / "saved")["/joint_states"]
    np.testing.assert_array_equal(after.stamp_ns, before.stamp_ns)
    np.testing.assert_array_equal(after.position, before.position)


@pytest.mark.slow
@settings(max_examples=6, suppress_health_check=[HealthCheck.function_scoped_fixture])
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
    cut.write_bytes(whole.read_bytes()[:500])
    with pytest.raises(IdloopError, match="no message"):
        recover_bag(cut, tmp_path / "saved")
    assert not (tmp_path / "saved").exists()


def test_an_existing_bag_is_never_written_over(bag: Path) -> None:
    with pytest.raises(InputError, match="not overwritten"):
        recover_bag(bag, bag)


def test_a_folder_without_a_recording_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="without a bag"):
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


# ------------------------------------------------------------------ what is said about it


def test_messages_that_do_not_fit_their_type_are_left_out_and_counted(tmp_path: Path) -> None:
    stream = make_stream("joint_states", STAMPS[:100], {"motor": {"position": np.arange(100.0)}})
    file = file_of(write_bag(tmp_path / "whole", [stream], storage="sqlite3"))
    with sqlite3.connect(file) as connection:
        connection.execute("UPDATE messages SET data = x'00010203' WHERE id IN (7, 8)")
    connection.close()
    result = recover_bag(file, tmp_path / "saved")
    assert (result.messages, result.left_out) == (98, {"/joint_states": 2})
    assert (
        result.state == "1 file(s) cut off or damaged; 2 damaged message(s) left out; every saved message was read back"
    )
    assert len(read_streams(tmp_path / "saved")["/joint_states"]) == 98


def test_a_whole_bag_is_said_to_be_whole_only_with_all_its_messages(tmp_path: Path) -> None:
    stream = make_stream("joint_states", STAMPS[:100], {"motor": {"position": np.arange(100.0)}})
    bag = write_bag(tmp_path / "whole", [stream], storage="sqlite3")
    assert recover_bag(bag, tmp_path / "first").state == "the recording was whole; every saved message was read back"
    with sqlite3.connect(file_of(bag)) as connection:
        connection.execute("DELETE FROM messages WHERE id > 90")
    connection.close()
    result = recover_bag(bag, tmp_path / "second")
    assert result.missing == {"/joint_states": 10}
    assert "whole" not in result.state


def test_a_new_bag_that_cannot_be_read_is_an_error_and_is_not_kept(
    small: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from idloop.records.bags import recover

    class Refusing:
        def __init__(self, path: Path) -> None:
            raise InputError(f"{path}: cannot be read")

    monkeypatch.setattr(recover, "Bag", Refusing)
    with pytest.raises(IdloopError, match="makes no bag that can be read") as caught:
        recover_bag(small, tmp_path / "saved")
    assert not isinstance(caught.value, InputError)
    assert not (tmp_path / "saved").exists()


def test_a_new_bag_that_holds_less_is_an_error_and_is_not_kept(
    small: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from idloop.records.bags import recover

    class Short(recover.Bag):
        def messages(self, topics):
            return iter(list(super().messages(topics))[1:])

    monkeypatch.setattr(recover, "Bag", Short)
    with pytest.raises(IdloopError, match=r"49 of 50"):
        recover_bag(small, tmp_path / "saved")
    assert not (tmp_path / "saved").exists()


def test_a_type_that_nobody_describes_is_kept_and_said(tmp_path: Path) -> None:
    stream = make_stream("joint_states", STAMPS[:20], {"motor": {"position": np.arange(20.0)}})
    file = file_of(write_bag(tmp_path / "whole", [stream], storage="sqlite3"))
    with sqlite3.connect(file) as connection:
        connection.execute("UPDATE topics SET type = 'gone_msgs/msg/Gone'")
        connection.execute("DELETE FROM message_definitions")
    connection.close()
    result = recover_bag(file, tmp_path / "saved")
    assert (result.messages, result.unchecked) == (20, ("/joint_states",))
    assert result.state.endswith(
        "every saved message was read back, without their content on 1 topic(s) of unknown type"
    )


def test_a_ros_1_bag_whose_index_was_never_written(ros1_bag, tmp_path: Path) -> None:
    whole = ros1_bag(tmp_path / "whole.bag").read_bytes()
    index = whole.index(b"\x04\x00\x00\x00op=\x07", whole.index(b"op=\x04"))  # connections behind the chunk
    cut = tmp_path / "cut.bag"
    cut.write_bytes(whole[: index - 8])
    with pytest.raises(InputError, match="idloop recover"):
        read_streams(cut)
    result = recover_bag(cut, tmp_path / "saved")
    assert (result.messages, result.cut) == (80, (cut,))
    np.testing.assert_array_equal(read_streams(tmp_path / "saved")["/joint_states"].position[:, 0], np.arange(40) / 8)


def test_a_packed_file_that_was_cut(tmp_path: Path) -> None:
    from backports import zstd

    rng = np.random.default_rng(1)
    stream = make_stream("joint_states", STAMPS, {"motor": {"position": rng.normal(size=STAMPS.size)}})
    packed = zstd.compress(file_of(write_bag(tmp_path / "whole", [stream], storage="sqlite3")).read_bytes())
    cut = tmp_path / "cut.db3.zstd"
    cut.write_bytes(packed[: len(packed) * 3 // 4])
    result = recover_bag(cut, tmp_path / "saved")
    assert result.cut == (cut,)
    assert 5_000 < result.messages < STAMPS.size
