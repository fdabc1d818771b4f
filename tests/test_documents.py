"""Documents that ask for more than there is are refused in one line, whichever reader gets them."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idloop import documents
from idloop.control.controller_file import load_controller
from idloop.documents import MOST_DEPTH, MOST_DIGITS, read_json, read_npz, read_text, read_yaml
from idloop.errors import InputError
from idloop.estimation.linear import model_file as linear_file
from idloop.estimation.networks import model as network_file
from idloop.graph.description import load_graph
from idloop.parameter_table import read_mapping
from idloop.physics import load_model
from idloop.records import Record, write_bag
from idloop.records.bags.bag import Bag
from idloop.records.tables.mapping import load_mapping
from idloop.records.tables.table_files import read_table
from idloop.reporting.ladder_folder import read_ladder

LAUGH = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 10)}]\n" for k in range(1, 10)
)
TOO_DEEP, TOO_LONG = f"more than {MOST_DEPTH} deep", f"a number of more than {MOST_DIGITS} digits"
YAML = {
    "aliases of aliases": (LAUGH, "with those that aliases stand for"),
    "one long text, again and again": (
        f"a: &a {'x' * 200_000}\nb: [{', '.join(['*a'] * 100)}]\n",
        "with those that aliases stand for",
    ),
    "an alias within itself": ("a: &a [1, *a]\n", "the alias *a is recursive"),
    "an alias within a second one of its name": ("b: &a 1\na: &a [1, *a]\n", "the alias *a is recursive"),
    "a chain of aliases": ("a0: &a0 [x]\n" + "".join(f"a{k}: &a{k} [*a{k - 1}]\n" for k in range(1, 300)), TOO_DEEP),
    "brackets": ("a: " + "[" * 5_000, TOO_DEEP),
    "braces": ("{a: " * 5_000, TOO_DEEP),
    "lists in lines": ("- " * 5_000, TOO_DEEP),
    "digits": ("a: " + "9" * 5_000, TOO_LONG),
    "hexadecimal digits": ("a: 0x" + "f" * 5_000, TOO_LONG),
    "octal digits": ("a: 0o" + "7" * 5_000, TOO_LONG),
    "binary digits": ("%YAML 1.1\n---\na: 0b" + "1" * 5_000, TOO_LONG),
    "sexagesimal digits": ("%YAML 1.1\n---\na: 1" + ":59" * 2_000, TOO_LONG),
    "digits of a fraction": ("a: 0." + "1" * 5_000, TOO_LONG),
    "digits of the version": ("%YAML " + "9" * 5_000 + ".1\n---\na: 1\n", "not valid YAML"),
    "the 45th of a month": ("a: 2024-01-45\n", "'2024-01-45' is not a valid value (day"),
    "25 o'clock": ("a: 2024-01-05T25:00:00\n", "is not a valid value (hour"),
    "half a character": ('a: "\\ud800"\n', "half of a surrogate pair"),
    "a word as a number": ("a: !!int one\n", "line 1: not valid YAML: 'one' is not a valid value"),
    "a word as a truth": ("a: !!bool maybe\n", "line 1: not valid YAML: 'maybe' is not a valid value"),
    "something to run": ("a: !!python/object/apply:os.getpid []\n", "could not determine a constructor"),
}
JSON = {
    "brackets": ('{"a": ' + "[" * 5_000, TOO_DEEP),
    "brackets that are closed": ('{"a": ' + "[" * 100 + "]" * 100 + "}", TOO_DEEP),
    "braces": ('{"a": ' * 5_000, TOO_DEEP),
    "digits": ('{"a": ' + "9" * 5_000 + "}", TOO_LONG),
    "half a character": ('{"a": "\\ud800"}', "half of a surrogate pair"),
    "half a character in a name": ('{"\\udfff": 1}', "half of a surrogate pair"),
}


def _bag(path: Path) -> object:
    time = np.arange(1.0, 20.0) * 0.01
    columns = np.zeros((19, 1))
    record = Record("run", time, -time, time, columns, "axis.effort", "V", ("axis.position",), ("rad",))
    bag = write_bag(path.parent / "bag", record)
    metadata = bag / "metadata.yaml"
    text = path.read_text()
    head = text[: text.index("---\n") + 4] if text.startswith("%") else ""
    metadata.write_text(head + metadata.read_text() + text[len(head) :])
    with Bag(bag) as opened:
        return opened.topics


def _experiment(path: Path) -> object:
    return pytest.importorskip("idloop_nodes.excitation.experiment").read_experiment(path.read_text(), "effort", 0.01)


def _ladder(path: Path) -> object:
    return read_ladder(path.rename(path.with_name("ladder.json")).parent)


YAML_READERS: dict[str, Callable[[Path], object]] = {
    "model": load_model,
    "controller": load_controller,
    "mapping": load_mapping,
    "launch file": lambda path: load_graph(str(path)),
    "line of parameters": lambda path: read_mapping(path.read_text(), "--controller", "{a: 1}"),
    "experiment": _experiment,
    "metadata of a bag": _bag,
}
JSON_READERS: dict[str, Callable[[Path], object]] = {
    "table": read_table,
    "ladder": _ladder,
    "linear model": linear_file.load,
    "network": network_file.load,
}


def _refused(read: Callable[[Path], object], path: Path, text: str) -> str:
    path.write_text(text)
    with pytest.raises(InputError) as refused:
        read(path)
    line = str(refused.value)
    assert "\n" not in line
    assert len(line) < 2_000
    return line


@pytest.mark.parametrize("kind", YAML)
@pytest.mark.parametrize("reader", YAML_READERS)
def test_yaml_beyond_a_limit_is_one_line(reader: str, kind: str, tmp_path: Path) -> None:
    text, said = YAML[kind]
    line = _refused(YAML_READERS[reader], tmp_path / "a.yaml", text)
    # What does not fit what is above it in the file is refused where it begins.
    assert said in line or reader == "metadata of a bag"


@pytest.mark.parametrize("kind", JSON)
@pytest.mark.parametrize("reader", JSON_READERS)
def test_json_beyond_a_limit_is_one_line(reader: str, kind: str, tmp_path: Path) -> None:
    text, said = JSON[kind]
    assert said in _refused(JSON_READERS[reader], tmp_path / "a.json", text)


@pytest.mark.parametrize("reader", ["model", "controller", "mapping", "launch file"])
def test_a_file_without_an_end_is_one_line(reader: str, tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    with path.open("wb") as file:
        file.truncate(1 << 40)
    with pytest.raises(InputError, match=r"longer than 4,194,304 bytes"):
        YAML_READERS[reader](path)


@pytest.mark.parametrize("reader", JSON_READERS)
def test_a_json_file_without_an_end_is_one_line(reader: str, tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    with path.open("wb") as file:
        file.truncate(1 << 40)
    with pytest.raises(InputError, match=r"longer than [\d,]+ bytes"):
        JSON_READERS[reader](path)


def test_what_an_honest_document_has_is_read() -> None:
    text = "base: &base {kp: 1.0, ki: 0x10}\nlist: [*base, *base]\nmerged: {<<: *base, kp: 2}\nwhen: 2024-02-29\n"
    read = read_yaml(text, "a.yaml")
    assert read["list"] == [{"kp": 1.0, "ki": 16}] * 2
    assert read["merged"] == {"kp": 2, "ki": 16}
    assert str(read["when"]) == "2024-02-29"
    assert read_yaml("a: " + "9" * MOST_DIGITS, "a.yaml") == {"a": int("9" * MOST_DIGITS)}
    assert float(read_yaml("0x" + "f" * (MOST_DIGITS - 2), "a.yaml")) > 1e290
    nested = "[" * MOST_DEPTH + "]" * MOST_DEPTH
    assert read_yaml(nested, "a.yaml") == read_json(nested, "a.json")
    assert read_json('"\\ud83d\\ude00"', "a.json") == "\N{GRINNING FACE}"


@pytest.mark.slow
def test_the_metadata_of_a_recording_in_a_thousand_files_are_read() -> None:
    one = {"path": "run_{}.mcap", "starting_time": {"nanoseconds_since_epoch": 1}, "duration": {"nanoseconds": 2}}
    files = [{**one, "path": f"run_{k}.mcap", "message_count": k} for k in range(1_000)]
    text = "files:\n" + "".join(f"- {json.dumps(file)}\n" for file in files)
    assert read_yaml(text, "metadata.yaml")["files"] == files


def test_an_anchor_that_is_there_twice_is_no_warning(capfd: pytest.CaptureFixture[str]) -> None:
    assert read_yaml("- &a 1\n- &a 2\n- *a\n", "a.yaml") == [1, 2, 2]
    assert capfd.readouterr().err == ""


DEPTH = st.recursive(st.none() | st.booleans() | st.integers(-9, 9) | st.text('aß\\"[{:,# ', max_size=3), st.lists)


@pytest.mark.slow
@given(DEPTH)
def test_what_json_writes_is_read_as_json_and_as_yaml(content: Any) -> None:
    text = json.dumps(content, ensure_ascii=False)
    assert read_json(text, "a.json") == content
    assert read_yaml(text, "a.yaml") == content


def test_a_text_is_read_as_far_as_the_limit(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_bytes(b"1234")
    assert read_text(path, 4) == "1234"
    with pytest.raises(InputError, match="longer than 3 bytes"):
        read_text(path, 3)
    path.write_bytes(b"\xff")
    with pytest.raises(InputError, match="not a text file in UTF-8"):
        read_text(path)


@pytest.mark.slow
def test_a_document_of_a_message_is_read_as_far_as_the_limit() -> None:
    assert read_yaml("1" + "\n" * (documents.MOST_YAML - 1), "a.yaml") == 1
    with pytest.raises(InputError, match=r"a\.yaml: not valid YAML: longer than 4,194,304 characters"):
        read_yaml("1" + "\n" * documents.MOST_YAML, "a.yaml")
    assert read_json("[1]", "a.json", 3) == [1]
    with pytest.raises(InputError, match=r"a\.json: longer than 3 characters"):
        read_json("[1] ", "a.json", 3)


def test_too_many_lists_are_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(documents, "MOST_LISTS", 3)
    assert read_json("[[], {}]", "a.json") == [[], {}]
    with pytest.raises(InputError, match=r"a\.json: more than 3 lists"):
        read_json("[[], [], {}]", "a.json")


def test_arrays_that_unpack_to_more_are_one_line(tmp_path: Path) -> None:
    np.savez_compressed(tmp_path / "a.npz", t=np.zeros(2_000_000))
    assert (tmp_path / "a.npz").stat().st_size < 30_000
    assert read_npz(tmp_path / "a.npz", 16_001_000)["t"].size == 2_000_000
    with pytest.raises(InputError, match=r"unpacks to 0\.0149 GiB"):
        read_npz(tmp_path / "a.npz", 15_000_000)
    with pytest.raises(InputError, match="check the path"):
        read_npz(tmp_path / "b.npz", 1)
