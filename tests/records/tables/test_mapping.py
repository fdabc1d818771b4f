"""Mapping files: the shipped ones are valid, mistakes are named with their cure."""

from __future__ import annotations

import pytest

from idloop.errors import InputError
from idloop.records.tables.mapping import load_mapping, parse_mapping, ready_mappings

GOOD = {
    "schema": "idloop/mapping/1",
    "name": "x",
    "joint": "motor",
    "time": {"period": 0.01},
    "command": "u",
    "position": "y",
}


def test_shipped_mappings_are_valid():
    assert {"emps", "dcmotor_fra233", "bam", "silverbox", "ced", "backlash_sts3215"} <= set(ready_mappings())
    for name in ready_mappings():
        mapping = load_mapping(name)
        assert mapping.name == name
        for part in mapping.parts or [None]:
            signals = mapping.for_part(part)
            assert signals.command
            assert signals.position or signals.velocity


def test_short_forms():
    mapping = parse_mapping(GOOD | {"position": ["a", {"column": "b", "joint": "load"}]}, "x")
    assert [(channel.column, channel.joint) for channel in mapping.position] == [("a", None), ("b", "load")]


@pytest.mark.parametrize("bare", ["r", {"column": "r"}, ["r"]])
def test_a_bare_reference_is_its_position(bare):
    mapping = parse_mapping(GOOD | {"reference": bare}, "x")
    assert [channel.column for channel in mapping.reference.position] == ["r"]
    assert mapping.reference.velocity == []


def test_a_part_replaces_only_what_it_says():
    mapping = parse_mapping(GOOD | {"parts": {"a": {"command": "u2"}, "b": {"rows": {"start": 5}}}}, "x")
    assert mapping.for_part("a").command[0].column == "u2"
    assert mapping.for_part("a").position[0].column == "y"
    assert mapping.for_part("b").rows.start == 5
    assert mapping.for_part("b").command[0].column == "u"
    with pytest.raises(InputError, match="choose one with --part: a, b"):
        mapping.for_part(None)
    with pytest.raises(InputError, match="no part 'c'"):
        mapping.for_part("c")
    with pytest.raises(InputError, match="leave --part"):
        parse_mapping(GOOD, "x").for_part("a")


BAD = {
    "unknown key": ({"comand": "u"}, "unknown key comand (did you mean 'command'"),
    "unknown key with a capital": ({"Infinity": 1}, "unknown key Infinity"),
    "unknown key of a channel": ({"command": {"column": "u", "scael": 2}}, "did you mean 'scale'"),
    "unknown key of a part": ({"parts": {"a": {"velocty": "v"}}}, "did you mean 'velocity'"),
    "key of another place": ({"time": {"scale": 2}}, "unknown key time.scale (known: column, unit,"),
    "key of another place, beside a near one": ({"reference": {"postion": "r"}}, "did you mean 'position'"),
    "bare and by name": (
        {"reference": {"column": "r", "position": "r"}},
        "reference.column (known: position, velocity)",
    ),
    "excitation of nothing": ({"excitation": {"column": "e"}}, "name what the signal is added to"),
    "no schema": ({"schema": "idloop/model/1"}, "must be idloop/mapping/1"),
    "two sources of time": ({"time": {"period": 0.1, "column": "t"}}, "give one of column, period"),
    "a formula of dates": ({"time": {"compute": "t + 1", "unit": "iso8601"}}, "gives numbers, not dates"),
    "no formula of time": ({"time": {"compute": "t +"}}, "is no formula"),
    "negative period": ({"time": {"period": -1}}, "time.period"),
    "column and topic": ({"command": {"column": "u", "topic": "t"}}, "give either one of column"),
    "unknown decode": ({"command": {"column": "u", "decode": "int12"}}, "command.0.decode"),
    "delimiter of two characters": ({"csv": {"delimiter": "::"}}, "csv.delimiter: must be one character"),
    "no delimiter": ({"csv": {"delimiter": ""}}, "csv.delimiter: must be one character"),
    "quotes as delimiter": ({"csv": {"delimiter": '"'}}, "csv.delimiter: must be one character"),
    "skips more than there is": ({"csv": {"skip_rows": 10**200}}, "csv.skip_rows"),
    "period below a stamp's": ({"time": {"period": 1e-300}}, "time.period"),
    "rate above a stamp's": ({"time": {"rate": 1e300}}, "time.rate"),
    "joint of a million letters": ({"joint": "j" * 10**6}, "joint: string should have at most 255 characters"),
    "topic of a million letters": ({"command": {"topic": "t" * 10**6, "field": "x"}}, "at most 255 characters"),
    "more channels than joints": ({"position": ["y"] * 101}, "position: list should have at most 100 items"),
    "infinite scale": ({"command": {"column": "u", "scale": float("inf")}}, "command.0.scale"),
}


@pytest.mark.parametrize("name", BAD)
def test_mistakes(name):
    change, words = BAD[name]
    with pytest.raises(InputError) as caught:
        parse_mapping(GOOD | change, "my.yaml")
    assert str(caught.value).startswith("my.yaml: ")
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_files(tmp_path):
    with pytest.raises(InputError, match="did you mean 'emps'"):
        load_mapping("emsp")
    (tmp_path / "a.yaml").write_text("schema: [")
    with pytest.raises(InputError, match="line 1: not valid YAML"):
        load_mapping(tmp_path / "a.yaml")
    (tmp_path / "a.yaml").write_text("- 1")
    with pytest.raises(InputError, match="starts with `schema"):
        load_mapping(tmp_path / "a.yaml")
    (tmp_path / "a.yaml").write_text("schema: idloop/mapping/1\n")
    with pytest.raises(InputError, match="key name is missing"):
        load_mapping(tmp_path / "a.yaml")
