"""What a file says in degrees or millivolts comes out in the units of the topics, and nothing else is guessed."""

from __future__ import annotations

from math import pi

import pytest

from idloop.errors import InputError
from idloop.physics.units import FORCES, INPUT_UNITS
from idloop.records.tables.base_units import base_unit, known_unit


@pytest.mark.parametrize(
    ("unit", "field", "base", "factor"),
    [
        ("deg", "position", "rad", pi / 180),
        ("°", "position", "rad", pi / 180),
        ("rev", "position", "rad", 2 * pi),
        ("mm", "position", "m", 1e-3),
        ("rpm", "velocity", "rad/s", 2 * pi / 60),
        ("mm/min", "velocity", "m/s", 1e-3 / 60),
        ("mV", "effort", "V", 1e-3),
        ("mA", "effort", "A", 1e-3),
        ("mNm", "effort", "N·m", 1e-3),
        ("%", "effort", "-", 0.01),
        ("", "position", "", 1.0),
    ],
)
def test_known_units(unit, field, base, factor):
    found, times = base_unit(unit, field, "here")
    assert found == base
    assert times == pytest.approx(factor, rel=1e-15)


@pytest.mark.parametrize("unit", INPUT_UNITS)
def test_every_command_of_a_model_can_be_imported_as_it_is(unit):
    assert base_unit(unit, "effort", "here") == (unit, 1.0)


@pytest.mark.parametrize("unit", FORCES)
def test_every_motion_of_a_model_can_be_imported_as_it_is(unit):
    assert base_unit(unit, "position", "here") == (unit, 1.0)
    assert base_unit(f"{unit}/s", "velocity", "here") == (f"{unit}/s", 1.0)


@pytest.mark.parametrize(
    ("unit", "field", "said"),
    [
        ("furlong", "position", "unknown unit 'furlong'"),
        ("degs", "position", "did you mean"),
        ("deg/s", "position", "deg/s is not a unit of a position"),
        ("rad", "velocity", "rad is not a unit of a velocity"),
        ("counts", "position", "give `scale:`"),
    ],
)
def test_others_are_refused_in_one_line(unit, field, said):
    with pytest.raises(InputError) as caught:
        base_unit(unit, field, "mapping x: joint_states position")
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["tr/min", "Tr/min", "giri/min", "U/min", "Umdr/min", "obr/min", "min⁻¹"])
def test_revolutions_per_minute_in_several_languages(text):
    assert known_unit(text) == "rpm"
