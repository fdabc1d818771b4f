"""`idloop diagnose`: the table of evidence, the verdict in words, one JSON document."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import replace

import pytest

from idloop.cli import main
from idloop.cli._outputs import print_blocks
from idloop.diagnosis import Candidate, Ladder, Step
from idloop.diagnosis.screening.proposals import proposals
from idloop.p_values import p_value_text
from idloop.reporting.estimates import parameter_text
from idloop.reporting.text.diagnosis import diagnosis_blocks, ladder_blocks


def words(*arguments: object) -> list[str]:
    return [str(argument) for argument in arguments]


def test_it_names_the_hidden_effect_in_one_document(hidden, capsys):
    assert main.run(words("diagnose", hidden.model, hidden.levels, "--json")) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["schema"] == "idloop/diagnose/1"
    assert document["verdict"] == "missing"
    assert document["set"] == ["dead_zone@input"]
    best = document["candidates"][0]
    assert (best["effect"], best["at"], best["testable"]) == ("dead_zone", "input", "yes")
    assert best["p_value"] < 0.01
    assert best["explains"] > 0.3
    assert document["worsened"] == []
    width = best["parameters"]["width"]
    assert abs(width["value"] - 0.4) < 4 * width["stderr"] < 0.04
    assert width["unit"] == "V"


def test_what_is_held_out_is_not_fitted_as_well(hidden, capsys):
    assert main.run(words("diagnose", hidden.model, hidden.levels, "--validate", hidden.levels)) == 2
    assert "the fit sees this bag" in capsys.readouterr().err


def test_it_says_so_in_words(hidden, capsys):
    assert main.run(words("diagnose", hidden.model, hidden.levels)) == 0
    out = capsys.readouterr().out
    for word in ("reversals", "explains %", "* ", "dead_zone@input", "< 0.001", "width 0.", " ± ", "show nothing"):
        assert word in out
    assert "an effect is missing: dead_zone@input. Small commands do nothing" in out
    # A share of what, and of which model the lists are.
    assert "explains: part of the power of the drive force that the model without it leaves unexplained" in out
    assert "testable, would show with: as long as dead_zone@input is not in the model" in out
    assert "as long as dead_zone@input is not in the model, this data cannot show:" in out


def test_what_the_data_cannot_show_is_listed_with_the_reason(hidden, capsys):
    assert main.run(words("diagnose", hidden.model, hidden.two)) == 0
    out, log = capsys.readouterr()
    # What an inspection finds wrong with the data is said before.
    assert f"(idloop inspect {hidden.two})" in log
    assert "this data cannot show everything" in out
    assert "dead_zone@input: " in out.partition("this data cannot show:")[2]


def test_only_the_effects_asked_for_are_weighed(hidden, capsys):
    arguments = ("--effects", "quadratic_drag", "coulomb_friction@motor", "--json", "--level", "0.05", "--seed", 3)
    assert main.run(words("diagnose", hidden.model, hidden.levels, *arguments)) == 0
    document = json.loads(capsys.readouterr().out)
    assert {c["effect"] for c in document["candidates"]} == {"quadratic_drag", "coulomb_friction"}
    assert document["level"] == 0.05


@pytest.mark.parametrize(
    ("arguments", "word"),
    (
        (["MODEL"], "BAG"),
        (["MODEL", "nowhere"], "nowhere"),
        (["MODEL", "BAG", "--effects", "dead_zon"], "dead_zone"),
        (["MODEL", "BAG", "--level", "0.9"], "0.9"),
        (["MODEL", "BAG", "--criterion", "luck"], "prediction"),
    ),
)
def test_wrong_use_is_one_line(arguments, word, hidden, capsys):
    places = {"MODEL": hidden.model, "BAG": hidden.levels}
    assert main.run(["diagnose", *(str(places.get(a, a)) for a in arguments)]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert word in err


@pytest.mark.parametrize(
    ("entry", "text"),
    (
        ({"value": 0.12342, "stderr": 0.001, "unit": "V"}, "width 0.1234 ± 0.0020 V"),
        ({"value": 0.12342, "stderr": None, "unit": "V"}, "width 0.1234 V"),
        ({"value": 0.0, "stderr": 0.1, "unit": "-"}, "width 0.00 ± 0.20"),
        ({"value": None, "stderr": None, "unit": "V"}, "width -"),
        ({"value": 1.0, "stderr": None, "unit": "Ω", "held": True}, "width 1 Ω (held)"),
        ({"value": 0.000314159265, "stderr": 0.0, "unit": "rad"}, "width 0.000314159 rad"),
    ),
)
def test_a_parameter_has_the_digits_that_its_interval_bears(entry, text):
    assert parameter_text("width", entry) == text


def test_a_tiny_p_value_is_not_spelled_out():
    assert [p_value_text(p) for p in (None, 1e-5, 0.0123)] == ["-", "< 0.001", "0.012"]


def test_two_effects_that_show_only_together_are_named_together(missing_pair, capsys):
    print_blocks(diagnosis_blocks(missing_pair))
    out = capsys.readouterr().out
    assert "only together: gain_asymmetry@input and load_torque@axis" in out
    assert "load_torque@axis: Something pulls." in out
    assert "cannot tell load_torque@axis from input_offset@input" in out


def test_what_was_passed_over_is_told_with_the_reason(missing_pair, capsys):
    passed_over = {"imbalance@axis": "too slight"}
    print_blocks(
        diagnosis_blocks(replace(missing_pair, set=(), pair=None, verdict="adequate", passed_over=passed_over))
    )
    out = capsys.readouterr().out
    assert "not the whole catalogue\nsignificant, yet passed over: imbalance@axis: too slight\n" in out


def test_what_was_passed_over_is_not_what_the_data_cannot_show(missing_pair, capsys):
    names = ("speed_limit_voltage@input", "sensor_offset@position[axis]")
    gate = replace(missing_pair.gate, testable=dict.fromkeys(names, "weak"), from_a_level=names)
    found = replace(missing_pair, gate=gate, set=(), pair=None, verdict="adequate", passed_over={names[0]: "a lag"})
    assert found.untestable == names[1:]
    assert found.to_dict()["untestable"] == [names[1]]
    print_blocks(diagnosis_blocks(found))
    assert capsys.readouterr().out.count(names[0]) == 1


def test_of_few_effects_it_says_that_only_these_were_looked_for(missing_pair, capsys):
    found = replace(missing_pair, set=(), pair=None, verdict="adequate")
    end = "nothing significant is left of what was looked for: only gain asymmetry and load torque were looked for, not"
    print_blocks(diagnosis_blocks(found))
    assert f"{end} the whole catalogue\n" in capsys.readouterr().out
    ladder = Ladder((Step(None, found.model),), verdict="adequate", candidates=found.candidates)
    print_blocks(ladder_blocks(ladder))
    assert f"verdict: {end} the whole catalogue\n" in capsys.readouterr().out
    everything = tuple(Candidate(one.effect.name, one.at, "yes", "", "") for one in proposals(found.model))
    print_blocks(diagnosis_blocks(replace(found, candidates=everything)))
    assert "nothing significant is left\n" in capsys.readouterr().out


def test_a_tie_that_no_motion_resolves_gets_a_check_by_hand(missing_pair, capsys):
    names = ("load_torque@axis", "input_offset@input")
    load = missing_pair.candidates[1]
    print_blocks(diagnosis_blocks(replace(missing_pair, candidates=(load,), set=names, pair=None)))
    out = capsys.readouterr().out
    assert "this data cannot tell load_torque@axis from input_offset@input (marked =)\n" in out
    assert "no motion can tell load_torque@axis and input_offset@input apart" in out
    assert "  by hand: " in out
    assert "idloop suggest" not in out


@pytest.mark.slow
@pytest.mark.parametrize("verb", ["diagnose", "identify"])
def test_the_answer_does_not_depend_on_the_number_of_threads(hidden, verb):
    """The environment of a user may ask for any."""
    said = {
        "diagnose": ["diagnose", str(hidden.model), str(hidden.levels), "--json"],
        "identify": ["identify", str(hidden.levels), "--method", "pem", "--json"],
    }
    answers = set()
    for count in "1", "4":
        names = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
        words = [sys.executable, "-m", "idloop", *said[verb]]
        done = subprocess.run(words, env=os.environ | dict.fromkeys(names, count), capture_output=True, check=True)
        answers.add(done.stdout)
    assert len(answers) == 1


def test_the_friction_of_a_measured_axis_is_named(data_dir, tmp_path, capsys):
    file = data_dir / "emps" / "DATA_EMPS.mat"
    if not file.is_file():
        pytest.skip(f"no {file}: set IDLOOP_DATA to the folder of the measured data")
    assert main.run(words("import", "emps", file, tmp_path / "bag")) == 0
    capsys.readouterr()
    assert main.run(words("diagnose", "emps", tmp_path / "bag", "--json", "--quiet")) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["set"] == ["coulomb_friction@axis"]
    assert document["candidates"][0]["parameters"]["level"]["value"] == pytest.approx(20.1, rel=0.05)
