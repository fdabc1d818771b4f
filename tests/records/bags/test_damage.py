"""Bags with bytes that are changed, missing or twice give a result or one line, whatever their form."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from idloop.errors import IdloopError, InputError
from idloop.records import read_streams, write_bag
from idloop.records.bags.publishers import find_publishers
from idloop.records.bags.recover import recover_bag
from idloop.records.bags.storage.storage_files import storage_files
from idloop.records.bags.write import make_stream
from idloop.records.recognition.bag_table import bag_table

FORMS = ["mcap", "sqlite3", "mcap.zstd", "sqlite3.zstd", "bag", "metadata"]


@pytest.fixture(params=FORMS)
def seed(request: pytest.FixtureRequest, tmp_path: Path, ros1_bag: Callable[..., Path]) -> tuple[Path, Path]:
    """A bag, and the one of its files that is damaged."""
    from backports import zstd

    if request.param == "bag":
        path = ros1_bag(tmp_path / "run.bag")
        return path, path
    storage, _, packed = request.param.partition(".")
    stamps = np.arange(1, 61, dtype=np.int64) * 10**7
    stream = make_stream("joint_states", stamps, {"j": {"position": np.sin(np.arange(60.0))}})
    bag = write_bag(tmp_path / "bag", [stream], storage="mcap" if storage == "metadata" else storage)
    (file,) = storage_files(bag)
    if storage == "metadata":
        return bag, bag / "metadata.yaml"
    (bag / "metadata.yaml").unlink()
    if packed:
        whole, file = file, file.with_name(file.name + ".zstd")
        file.write_bytes(zstd.compress(whole.read_bytes()))
        whole.unlink()
    return bag, file


def damages(size: int) -> st.SearchStrategy[Callable[[bytes], bytes]]:
    """Changes of a file: bytes changed, a stretch missing or twice, the end cut off."""
    place = st.integers(0, size - 1)

    def change(at: int, value: int) -> Callable[[bytes], bytes]:
        return lambda data: data[:at] + bytes([value]) + data[at + 1 :]

    def leave_out(at: int, length: int) -> Callable[[bytes], bytes]:
        return lambda data: data[:at] + data[at + length :]

    def repeat(at: int, length: int) -> Callable[[bytes], bytes]:
        return lambda data: data[: at + length] + data[at:]

    lengths = st.sampled_from([1, 4, 64, 4096])
    return st.one_of(
        st.builds(change, place, st.integers(0, 255)),
        st.builds(leave_out, place, lengths),
        st.builds(repeat, place, lengths),
        st.builds(lambda at: lambda data: data[:at], place),
    )


def attempt(use: Callable[[], Any], refusal: type[IdloopError] = InputError) -> Any:
    """Result of a reader, None where it refuses in one line."""
    line = ""
    try:
        return use()
    except refusal as error:
        line = str(error)
    assert line
    assert "\n" not in line
    return None


@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_result_or_one_line(seed: tuple[Path, Path], tmp_path_factory: pytest.TempPathFactory, data: Any) -> None:
    bag, file = seed
    whole = file.read_bytes()
    content = whole
    for damage in data.draw(st.lists(damages(len(whole)), min_size=1, max_size=3)):
        content = damage(content)
    folder = tmp_path_factory.mktemp("damaged")
    if bag.is_dir():
        place = Path(shutil.copytree(bag, folder / "bag"))
        (place / file.name).write_bytes(content)
    else:
        place = folder / file.name
        place.write_bytes(content)
    attempt(lambda: bag_table(place))
    for stream in (attempt(lambda: read_streams(place)) or {}).values():
        find_publishers(stream)
    saved = folder / "saved"
    result = attempt(lambda: recover_bag(place, saved), IdloopError)
    assert saved.exists() == (result is not None)
    if result is not None:
        assert sum(map(len, read_streams(saved).values())) <= result.messages
    shutil.rmtree(folder)


def test_the_reason_of_a_cut_bag_is_a_sentence(tmp_path: Path, ros1_bag: Callable[..., Path]) -> None:
    path = ros1_bag(tmp_path / "run.bag")
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) - 200])
    with pytest.raises(InputError) as caught:
        read_streams(path)
    assert "cannot be read as a bag" in str(caught.value)
    assert "('" not in str(caught.value)
    assert "idloop recover" in str(caught.value)
