"""A controller is read from a model file, from a file of its own, or refused in one line."""

import pytest

from idloop.control.controller_file import load_controller
from idloop.errors import InputError
from idloop.physics import load_model

SECTION = "{type: p, output: motor.position, kp: 0.3, sample_time: 0.005}"
LAW = {"type": "p", "output": "motor.position", "kp": 0.3, "sample_time": 0.005}


def test_a_controller_is_read_from_any_file_that_holds_one(tmp_path):
    for text in (f"controller: {SECTION}", SECTION):
        (tmp_path / "c.yaml").write_text(text)
        assert load_controller(tmp_path / "c.yaml") == LAW
    whole = load_model("lead_screw").to_yaml().replace("controller: null", f"controller: {SECTION}")
    (tmp_path / "m.yaml").write_text(whole)
    assert load_controller(tmp_path / "m.yaml") == LAW
    assert load_controller("axis") == load_model("axis").controller


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("gains: [1]", "neither a model file nor a controller"),
        ("controller: {type: foo}", "unknown type 'foo'"),
        ("controller: null", "no controller"),
        ("schema: idloop/mapping/1", "must be 'idloop/model/1'"),
        ("[1]", "must be a mapping"),
    ],
)
def test_what_is_no_controller(tmp_path, text, words):
    (tmp_path / "c.yaml").write_text(text)
    with pytest.raises(InputError) as caught:
        load_controller(tmp_path / "c.yaml")
    assert words in str(caught.value)
    assert "c.yaml" in str(caught.value)
    assert "\n" not in str(caught.value)
