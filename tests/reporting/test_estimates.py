"""Numbers with as many digits as their interval lets stand."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from idloop.cli._outputs import print_blocks
from idloop.diagnosis import Candidate, Ladder, Step
from idloop.diagnosis.candidate import effect_parameters
from idloop.diagnosis.screening.proposals import proposals
from idloop.physics import load_model
from idloop.reporting.estimates import (
    held_parameters,
    not_determined,
    parameter_rows,
    read_off_parameters,
    with_interval,
)
from idloop.reporting.page.page import page_words
from idloop.reporting.text.diagnosis import ladder_blocks, parameter_blocks
from idloop.validation.words import figure_text, fit_text, force_text


@pytest.mark.parametrize(
    ("value", "stderr", "text"),
    (
        (20.3421, 0.20435, "20.34 ± 0.40"),
        (94.99, 0.2, "94.99 ± 0.39"),
        (-36.8, 2.1, "−36.8 ± 4.1"),
        (204.6, 20.0, "205 ± 39"),
        (3.11e-7, 1e-9, "(3.110 ± 0.020) · 10⁻⁷"),
        (5.0, None, "5"),
        (5.0, 0.0, "5"),
        (0.0, None, "0"),
    ),
)
def test_two_digits_of_the_interval(value, stderr, text):
    assert with_interval(value, stderr) == text


@given(st.floats(-1e5, 1e5), st.floats(1e-4, 1e3))
def test_the_text_is_within_a_tenth_of_the_interval(value, stderr):
    text = with_interval(value, stderr).replace("−", "-")
    factor = 1.0
    if "·" in text:
        text, _, power = text.partition(" · 10")
        factor = 10.0 ** int(power.translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")))
    said, half = (float(part.strip("()")) * factor for part in text.split(" ± "))
    assert abs(said - value) <= 0.1 * 1.96 * stderr + 1e-9
    assert half == pytest.approx(1.96 * stderr, rel=0.06)


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    (
        (83.66, 3, "83.7"), (99.94, 3, "99.9"), (99.96, 3, "99.96"), (99.9996, 4, "99.9996"), (100.0, 3, "100"),
        (-12.34, 3, "−12.3"), (None, 3, "–"), (math.nan, 3, "–"), (math.inf, 3, "∞"), (100.0 - 1e-12, 3, "100"),
    ),
)  # fmt: skip
def test_a_fit_is_not_rounded_up_to_a_perfect_one(value, digits, text):
    assert fit_text(value, digits) == text


def test_what_is_no_number_is_said():
    assert figure_text(None) == figure_text(math.nan) == "–"
    assert figure_text(math.inf) == "∞"
    assert figure_text(-1.5e-9, 2) == "−1.5 · 10⁻⁹"


def test_what_was_held_is_no_estimate_and_what_was_chosen_is_none_of_it(contents, capsys):
    start = load_model("dc_motor")
    (sliding,) = proposals(start, ["presliding_friction@motor"])
    (waves,) = proposals(start, ["cogging@motor"])
    model = sliding.model({"level": 0.2, "stiffness": 500.0})
    entries = waves.model({"amplitude": 0.1, "harmonic": 7.0, "phase": 0.3})
    assert not effect_parameters(entries, waves.name)["harmonic"]["held"]
    given = effect_parameters(model, sliding.name)
    assert [name for name, entry in given.items() if entry["held"]] == ["velocity", "damping"]
    added = Candidate("presliding_friction", "motor", "yes", "", "It gives.", model=model, parameters=given)
    ladder = Ladder((Step(None, start), Step(added, model, set=(sliding.name,))), verdict="adequate")
    assert list(held_parameters(ladder)) == [f"{sliding.name}.velocity", f"{sliding.name}.damping"]
    print_blocks(ladder_blocks(ladder))
    print_blocks(parameter_blocks(ladder))
    said = capsys.readouterr().out
    assert "velocity 0.1 rad/s (held), damping 0 N·m·s/rad (held)" in said
    assert f"held, not estimated: {sliding.name}.velocity 0.1 rad/s, {sliding.name}.damping 0 N·m·s/rad\n" in said
    told = page_words(replace(contents, ladder=ladder))
    kinds = {row["key"]: row["kind"] for row in told["parameters"]}
    assert kinds[f"{sliding.name}.velocity"] == "held"
    assert [row["held"] for row in told["steps"][0]["parameters"]] == [False, False, True, True]


def test_a_resolution_that_was_read_off_is_told_by_itself(capsys):
    start = load_model("dc_motor")
    name = "sensor_quantisation@position[motor]"
    model = start.with_effects([f"{name}(resolution=0.000314159265)"])
    given = {"resolution": {"value": 0.000314159265, "stderr": 0.0, "unit": "rad"}}
    added = Candidate("sensor_quantisation", "position[motor]", "yes", "", "It steps.", model=model, parameters=given)
    ladder = Ladder((Step(None, start), Step(added, model, set=(name,))), verdict="adequate")
    assert list(read_off_parameters(ladder)) == [f"{name}.resolution"]
    assert held_parameters(ladder) == {}
    print_blocks(parameter_blocks(ladder))
    assert f"read off the readings: {name}.resolution 0.000314159 rad\n" in capsys.readouterr().out


def test_a_percentage_has_no_power_of_ten_and_a_large_one_is_a_factor_in_words() -> None:
    assert fit_text(-983.2, 3, " %") == "−983 %"
    assert fit_text(-4583.2, 3, " %") == "worse than a constant by a factor 47"
    assert fit_text(-math.inf, 3, " %") == "worse than a constant"
    assert fit_text(-4.58e5) == "worse than a constant by a factor 4581"
    assert fit_text(-1.24068e8) == "worse than a constant by a factor 1.2 · 10⁶"
    assert force_text(2.1704, 3, " %") == "217 %"
    assert force_text(12.345) == "12 times the commanded force"
    assert force_text(0.0001234) == "0.0123"
    assert force_text(None, 3, " %") == fit_text(None, 3, " %") == "–"


@given(st.floats(-1e9, 100.0))
def test_no_fit_is_written_with_a_power_of_ten(fit) -> None:
    assert "10" + "⁰" not in fit_text(fit)
    assert len(fit_text(fit, 3)) < 60
    if fit < -1000.0:
        assert "%" not in fit_text(fit, 3, " %")


def test_a_row_of_the_parameters_has_interval_unit_and_bounds() -> None:
    start = load_model("dc_motor").with_effects(["dead_zone@input(width=0.3)"])
    rows = {row["key"]: row for row in parameter_rows(start, ["dead_zone@input.width"])}
    assert rows["motor.inertia"]["kind"] == "known"
    assert rows["motor.inertia"]["bounds"] == "", "nothing is estimated"
    assert rows["drive.gain"]["kind"] == "free, not fitted yet"
    assert rows["drive.gain"]["bounds"] == ""
    assert rows["motor.viscous_friction"]["bounds"] == "at\u00a0least\u00a00"
    (inertia,) = [row for row in parameter_rows(load_model("emps")) if row["key"] == "axis.inertia"]
    assert inertia["bounds"] == "above 0", "a millionth of the value keeps it from zero, no more"
    assert rows["dead_zone@input.width"]["unit"] == "V"


@pytest.mark.parametrize(("value", "stderr"), [(1e-8, 0.1), (5e-8, 0.1), (1e-8, None)])
def test_an_estimate_at_its_bound_is_not_determined(value, stderr):
    model = load_model("axis").with_free(["axis.inertia", "drive.gain"])
    assert not not_determined(model)
    model = model.with_values({"axis.inertia": value}, {"axis.inertia": stderr, "drive.gain": 0.1})
    (line,) = not_determined(model)
    assert line.startswith("axis.inertia ended at its bound: the data do not determine it")
    assert ("only that it is below 0.196 kg·m² (95 %)" in line) == (stderr is not None)
    (row,) = (row for row in parameter_rows(model) if row["key"] == "axis.inertia")
    assert row["kind"] == "at its bound"
    assert "±" not in row["value"]
