"""Checksums say whether a recording is the one that a result was made from."""

from __future__ import annotations

import hashlib

from idloop.reporting.provenance import checksum, provenance


def test_a_file_has_the_checksum_that_every_tool_shows(tmp_path):
    path = tmp_path / "bag.mcap"
    path.write_bytes(b"measured")
    assert checksum(path) == {"bytes": 8, "sha256": hashlib.sha256(b"measured").hexdigest()}


def test_a_folder_changes_with_every_name_and_every_byte(tmp_path):
    def folder(name, files):
        made = tmp_path / name
        made.mkdir()
        for file, content in files.items():
            (made / file).write_bytes(content)
        return checksum(made)["sha256"]

    same = [folder(name, {"a": b"1", "b": b"2"}) for name in ("one", "two")]
    assert same[0] == same[1]
    others = [folder("name", {"a": b"1", "c": b"2"}), folder("byte", {"a": b"1", "b": b"3"})]
    assert len({same[0], *others}) == 3


def test_a_recording_that_is_gone_is_said(tmp_path):
    assert checksum(tmp_path / "gone") == {"bytes": None, "sha256": None}


def test_where_a_result_comes_from(tmp_path):
    path = tmp_path / "train"
    path.write_bytes(b"x")
    found = provenance([path], [path], commands=["idloop refine"], seed=3)
    assert [bag["use"] for bag in found["bags"]] == ["fitted", "unseen"]
    assert found["seed"] == 3
    assert {"idloop", "python", "numpy"} <= set(found["versions"])
    assert found == provenance([path], [path], commands=["idloop refine"], seed=3)
