"""Words of users for effects, and effects without a site, are answered with what to write."""

from __future__ import annotations

import pytest

from idloop.cli._inputs import effect_text
from idloop.errors import InputError
from idloop.physics import load_model

MODEL = load_model("axis")


@pytest.mark.parametrize(
    ("text", "written"),
    [
        ("dead_zone@input(width=0.1)", "dead_zone@input(width=0.1)"),
        ("dead zone@input", "dead_zone@input"),
        (" dead-zone @input", "dead_zone@input"),
    ],
)
def test_blanks_and_dashes_of_a_name(text, written):
    assert effect_text(text, MODEL) == written
    assert MODEL.with_effects([effect_text(text, MODEL)]).effects[0].name == "dead_zone@input"


@pytest.mark.parametrize(
    ("text", "cure"),
    [
        ("gravity", "give the site as well: gravity@axis"),
        ("Dead zone", "give the site as well: dead_zone@input"),
        ("stiction", "coulomb_friction@axis"),
        ("play", "backlash@position[axis]"),
        ("delay(delay=0.1)", "input_delay@input"),
        ("magnetism", "unknown effect 'magnetism'"),
        ("hardening_stiffness", "model axis has no site at which hardening_stiffness acts"),
    ],
)
def test_a_name_without_a_site(text, cure):
    with pytest.raises(InputError) as refused:
        effect_text(text, MODEL)
    assert cure in str(refused.value)
