"""What the page says in words."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("bokeh", reason="no Bokeh: launch_scripts/test installs it")

from idloop.diagnosis import Candidate, Ladder, Step
from idloop.diagnosis.screening.command_response import CommandResponse
from idloop.physics import load_model
from idloop.reporting import breakdowns
from idloop.reporting.figures.effects import Decided
from idloop.reporting.residual_findings import ResidualFinding, residual_warnings
from idloop.reporting.terms import unbroken
from idloop.reporting.workbench import state_json
from idloop.reporting.workbench.files import commands
from idloop.reporting.workbench.state import Activity, Evidence, Fit, Missing, Snapshot, TrustedEstimate, model_version
from idloop.validation.variables import VARIABLES
from idloop.validation.where import NOISE_ALONE


def missing_beside(ladder, missing):
    """What the page says of a diagnosis."""
    return state_json._missing(missing, Snapshot(ladder=ladder))


def error(mean=0.0, rms=1.0, **variables):
    """An error of the force along variables: how much of it follows each, and whether it stands out."""
    along = {
        name: SimpleNamespace(
            variable=name,
            follows=follows,
            stands_out=loud,
            worst=SimpleNamespace(text="loud here", error=0.6 if loud else 0.1, usual=0.1),
        )
        for name, (follows, loud) in variables.items()
    }
    return SimpleNamespace(
        name="drive force", basis="force", why="", unit="N", mean=mean, rms=rms, breakdowns=tuple(along.values()),
        along=along.get,
    )  # fmt: skip


def first_shown(one):
    found = breakdowns.shown_first((one,))
    return dict(zip(("error", "variable"), found, strict=True))


def test_what_stands_out_is_shown_before_what_only_varies():
    one = error(velocity=(0.1, False), position=(0.2, False), command=(0.15, True), frequency=(0.9, True))
    assert first_shown(one) == {"error": "drive force", "variable": "command"}


def test_what_the_error_follows_most_is_shown_of_several():
    one = error(velocity=(0.3, True), position=(0.6, True), command=(0.5, False))
    assert first_shown(one) == {"error": "drive force", "variable": "position"}


def test_the_view_that_accounts_for_most_of_the_error_opens():
    """A curve or a part, over time as well; over frequency every error is spread otherwise than the signal."""
    drift = error(velocity=(0.3, True), time=(0.83, True), since_reversal=(0.1, True), frequency=(float("nan"), True))
    assert first_shown(drift)["variable"] == "time"
    even = error(velocity=(0.1, False), frequency=(float("nan"), True))
    assert first_shown(even)["variable"] == "frequency"


def test_a_part_that_holds_as_much_of_the_error_as_of_the_time_is_no_finding():
    one = error(velocity=(0.1, False), command=(0.1, True), frequency=(float("nan"), False))
    assert breakdowns.along_text(one.along("velocity")) == (
        "a curve over velocity makes up 10 % of the error, and no part of it stands out"
    )
    assert breakdowns.along_text(one.along("command")) == "loud here; a curve over command makes up 10 % of it"
    assert breakdowns.along_text(one.along("frequency")) == "no part of the frequency stands out"


def test_the_variable_that_is_shown_first_has_the_dot():
    one = error(velocity=(0.1, False), position=(0.2, False), time=(0.4, False))
    assert first_shown(one)["variable"] == "time"
    assert breakdowns.is_notable(one.along("time"))
    assert not breakdowns.is_notable(one.along("velocity"))


def test_an_error_that_sensor_noise_may_be_all_of_has_no_dot_and_opens_last():
    """94 % of what noise makes of a force is at high frequencies: a dot there says that the model fails."""
    noise = error(frequency=(float("nan"), True), velocity=(0.1, False))
    noise.why = NOISE_ALONE
    assert breakdowns.notable_variables(noise) == []
    drift = error(velocity=(0.1, False), time=(0.4, False))
    drift.name = "motor.position"
    assert breakdowns.shown_first((noise, drift)) == ("motor.position", "time")
    assert breakdowns.shown_first((noise,)) == ("drive force", "velocity")


@given(st.dictionaries(st.sampled_from(VARIABLES), st.tuples(st.floats(0.0, 1.0), st.booleans()), min_size=1))
def test_the_tab_that_opens_has_a_dot_wherever_one_has(along):
    one = error(**along)
    opened = one.along(first_shown(one)["variable"])
    assert breakdowns.is_notable(opened) or not any(breakdowns.is_notable(b) for b in one.breakdowns)


def test_the_words_along_a_variable_are_the_numbers_that_are_drawn():
    one = error(velocity=(0.5, True), command=(0.21, False), frequency=(float("nan"), True))
    assert breakdowns.along_text(one.along("velocity")) == "loud here; a curve over velocity makes up 50 % of it"
    # A curve that the eye sees is named, however small.
    assert breakdowns.along_text(one.along("command")) == (
        "a curve over command makes up 21 % of the error, and no part of it stands out"
    )
    assert breakdowns.along_text(one.along("frequency")) == "loud here"


def test_velocity_is_shown_where_nothing_says_anything():
    assert first_shown(error(velocity=(0.01, False), position=(0.02, False)))["variable"] == "velocity"
    assert first_shown(error(command=(0.01, False), position=(0.02, False)))["variable"] == "position"


def test_an_error_of_one_sign_is_said_to_be_the_same_everywhere():
    assert (
        state_json._everywhere(error(mean=-2.5, rms=2.6))
        == "92 % of the error is the same everywhere: −2.5 N on average."
    )
    assert state_json._everywhere(error(mean=0.3, rms=2.6)) == ""


def test_a_parameter_has_as_many_digits_as_its_interval_lets_stand():
    found = state_json._parameters({
        "width": {"value": 0.29812, "stderr": 0.00139, "unit": "V"},
        "rest_position": {"value": -1.22e4, "stderr": None, "unit": "rad"},
        "ratio": {"value": 2.0, "stderr": 0.1, "unit": "-"},
        "resistance": {"value": 1.0, "stderr": None, "unit": "Ω", "held": True},
    })  # fmt: skip
    assert found == [
        "width 0.2981 ± 0.0027 V",
        "rest position −1.22 · 10⁴ rad",
        "ratio 2.00 ± 0.20",
        "resistance 1 Ω (held)",
    ]


def test_steps_that_spoil_the_motion_and_lists_of_an_incomplete_model_are_said_to_be_so():
    model = load_model("axis")
    cogging = Candidate("cogging", "axis", "yes", "", "", model=model.with_effects(["cogging@axis"]))
    steps = tuple(
        Step(added, one, set=(), train=errors, validation=errors)
        for added, one, error in ((None, model, 0.1), (cogging, cogging.model, 0.6))
        for errors in [{"nrmse": {"axis.position": error}}]
    )
    ladder = Ladder(steps, verdict="adequate", criterion="force")
    (shown,) = state_json._ladder(ladder, ())["beware"]
    assert shown.startswith("Warning: cogging @ axis makes the free run of axis.position on data that no fit saw worse")
    good = missing_beside(ladder, Missing("adequate"))
    assert good["conclusion"].startswith("Something that no effect of the catalogue explains is missing")
    assert "drive force" in good["explains"]
    assert good["basis"] == "This data cannot show"
    few = replace(ladder, steps=steps[:1], candidates=(replace(cogging, model=None),))
    assert missing_beside(few, Missing("adequate"))["conclusion"] == (
        "Nothing significant is left of what was looked for: only cogging was looked for, not the whole catalogue."
    )
    lacking = missing_beside(ladder, Missing("missing", set=("dead_zone@input",)))
    assert lacking["conclusion"] == ""
    assert lacking["basis"] == "As long as dead zone @ input is not in the model, this data cannot show"
    assert missing_beside(replace(ladder, steps=steps[:1]), Missing("adequate"))["conclusion"] == ""


def test_a_verdict_of_noise_carries_what_the_residual_tests_say_against_it():
    tests = {"ljung_box_p": 1e-9, "cross_p": 0.004, "against": "input"}
    coloured, follows = (
        ResidualFinding("a", SimpleNamespace(name="axis.position", coloured=not free, follows=free, **tests))
        for free in (False, True)
    )
    ladder = Ladder((Step(None, load_model("axis")),), verdict="adequate", criterion="force")
    for known in (None, ladder):
        said = missing_beside(known, Missing("adequate", left=(coloured,)))["conclusion"]
        (warning,) = residual_warnings("adequate", [coloured])
        assert said == f"Nothing significant is left, {warning}."
    said = missing_beside(ladder, Missing("adequate", left=(follows,)))["conclusion"]
    assert said.startswith("Something that no effect of the catalogue explains is left: the errors still follow the")
    assert missing_beside(ladder, Missing("adequate"))["conclusion"] == ""
    assert missing_beside(ladder, Missing("missing", set=("a@axis",), left=(follows,)))["conclusion"] == ""
    # Of recordings the diagnosis brings them, on a live graph those of the newest samples serve.
    found = Missing("adequate", left=(coloured,))
    assert state_json._remainders(found, Snapshot(missing=found)) == (coloured,)
    assert state_json._remainders(found, Snapshot(missing=found, live=True)) == ()


def test_a_motion_that_does_not_follow_the_command_is_no_good_news():
    ladder = Ladder((Step(None, load_model("axis")),), verdict="not_excited", criterion="force")
    ladder = replace(ladder, response=CommandResponse.UNMOVED)
    said = missing_beside(ladder, Missing("not_excited"))["conclusion"]
    assert "this data says nothing about the axis" in said


def test_what_was_passed_over_has_its_reason_on_its_card():
    lag = Candidate("actuator_lag", "input", "yes", "", "It comes late.", gain=9.0, p_value=1e-5)
    found = Missing("adequate", candidates=(lag,), passed_over={lag.name: "it does harm on the unseen data"})
    (card,) = missing_beside(None, found)["candidates"]
    assert not card["significant"]
    assert card["passed_over"] == "it does harm on the unseen data"


@pytest.mark.parametrize(("shown", "said"), ((0, "unseen data"), (1, "a (fitted)"), (2, "d (fitted)"), (4, "")))
def test_a_fit_says_which_data_it_is_of(shown, said):
    snapshot = Snapshot(recordings=("b (unseen)", "a (fitted)", "d (fitted)"), shown=shown)
    assert state_json._data_shown(snapshot) == said


def test_the_errors_of_a_ladder_are_of_one_kind_of_data():
    """A step without unseen errors shows none, rather than those of the fitted data beside the others."""
    model = load_model("dc_motor")
    steps = tuple(Step(None, model, train={"fit": {"motor.position": 90.0}}, validation=v) for v in (
        {"fit": {"motor.position": 80.0}}, {},
    ))  # fmt: skip
    shown = state_json._ladder(Ladder(steps), ("a (unseen)", "b (unseen)", "c (fitted)"))
    assert [[one["value"] for one in step["scores"]] for step in shown["steps"]] == [[80.0], []]
    assert shown["data"].startswith("Errors of the unseen data (2 recordings together).")


def test_a_number_keeps_its_unit_on_its_line():
    assert unbroken("level 20.13 ± 0.16 N·m, 26.3 % of 12 parts") == (
        "level 20.13\u00a0±\u00a00.16\u00a0N·m, 26.3\u00a0% of 12 parts"
    )
    assert unbroken("poles −2.37 1/s (p = 0.14, p < 0.001)") == (
        "poles −2.37\u00a01/s (p\u00a0=\u00a00.14, p\u00a0<\u00a00.001)"
    )
    assert unbroken("(3.110 ± 0.020) · 10⁻⁷ rad/s") == "(3.110\u00a0±\u00a00.020)\u00a0·\u00a010⁻⁷\u00a0rad/s"


def test_a_tie_that_no_experiment_can_end_says_what_to_do_by_hand():
    ladder = Ladder((Step(None, load_model("dc_motor")),), criterion="prediction")
    twins = ("input_offset@input", "load_torque@motor")
    told = missing_beside(ladder, Missing("missing", set=twins))
    assert not told["separable"]
    (one,) = told["twins"]
    assert one["text"].startswith("No motion can tell input offset @ input and load torque @ motor apart")
    assert "With the load off" in one["checks"][0]
    third = missing_beside(ladder, Missing("missing", set=(*twins, "dead_zone@input")))
    assert third["separable"]
    assert len(third["twins"]) == 1
    assert missing_beside(ladder, Missing("missing", set=twins[:1]))["twins"] == []
    assert missing_beside(None, Missing("missing", set=twins))["separable"]


def test_what_the_data_cannot_show_beside_a_tie_names_none_of_it():
    tied = ("dead_zone@input", "coulomb_friction@motor")
    ladder = Ladder((Step(None, load_model("dc_motor")),), verdict="missing", criterion="force")
    one, both = (missing_beside(ladder, Missing("missing", set=tied[:n]))["basis"] for n in (1, 2))
    assert one == "As long as dead zone @ input is not in the model, this data cannot show"
    assert both == "As long as what is missing is not in the model, this data cannot show"


def test_an_experiment_says_what_it_sends_in():
    signal = {"name": "sine", "duration": 11.0, "amplitude": 0.4, "offset": 0.4, "sample_time": 0.01}
    told = state_json._suggested({"signal": signal, "adds_to": "command", "text": "tells dead_zone@input apart"})
    assert told["signal"] == "Sine on the command, 11 s, amplitude 0.4, offset 0.4"
    assert told["text"] == "Tells dead zone @ input apart"
    steps = {"name": "multilevel", "duration": 2.0, "amplitude": 4.0, "offset": 0.0, "hold_min": 0.1821, "levels": 0}
    told = state_json._suggested({"signal": steps, "adds_to": "command", "unit": "V"})
    assert told["signal"] == "Multilevel on the command, 2 s, amplitude 4 V, hold min 0.1821 s, levels 0"
    assert state_json._suggested({"text": "it moves"})["signal"] == ""
    reach = {"name": "motor.position", "unit": "rad", "low": -1.25, "high": 2.0, "limits": [-2.0, 2.0]}
    kept, beyond, free = (
        state_json._suggested({"motion": [reach | change]})["motion"][0]
        for change in ({}, {"high": 2.1}, {"limits": []})
    )
    assert (kept["range"], kept["limit"], kept["inside"]) == ("−1.25 to 2 rad", "−2 to 2 rad", True)
    assert (beyond["inside"], beyond["outside"]) == (False, True)
    assert (free["limit"], free["inside"], free["outside"]) == ("no limit", False, False)


def test_the_evidence_and_what_may_be_trusted_is_said_in_words_and_numbers():
    known = Evidence(
        "decided: dead_zone@input", (), (5.0, 10.0),
        {"cogging@motor": (float("nan"), -2.04), "dead_zone@input": (6.0, 18.37), "slip@motor": (1.0, -0.04)}, 7.9,
        {"dead_zone@input": Decided(10.0, 1000, 18.37)},
        (TrustedEstimate("drive.gain", "8.0 N·m/V", False, "missing from the model: dead_zone@input"),),
        "decided: dead_zone@input",
    )  # fmt: skip
    found = state_json._evidence(known, Snapshot())
    assert found["current"]
    assert [(one["log_e"], one["decided"]) for one in found["effects"]] == [
        ("18.4", "10 s, 1000 samples"),
        ("0.0", "open"),
        ("−2.0", "open"),
    ]
    recorded = replace(known, recorded=True, decided={"dead_zone@input": Decided(0.5667, 7, 18.37)})
    assert state_json._evidence(recorded, Snapshot())["effects"][0]["decided"] == "0.567 s", "windows are no samples"
    assert "log(m/α) = 7.9; this threshold holds at any time" in found["hint"]
    assert "dead zone @ input" in found["ended"]
    (estimate,) = found["estimates"]
    assert estimate["name"] == "drive gain"
    assert not estimate["trusted"]
    assert "dead zone @ input" in estimate["why"]


def test_what_is_being_worked_out_is_said_in_words():
    source = SimpleNamespace(names=(), units=(), noise=np.empty(0), input_name="", input_unit="", followed=None)
    now = Activity("refitting with asymmetric_friction@axis", 0.5, "adding dead_zone@input")
    found = state_json.page_state(Snapshot(activity=now), source)["activity"]
    assert found == {
        "text": "refitting with asymmetric friction @ axis", "share": 0.5, "then": "adding dead zone @ input",
    }  # fmt: skip


def test_commands_name_the_file_that_holds_the_model_of_the_page():
    model = load_model("dc_motor")
    snapshot = Snapshot(model=model, bags=("bags/run",), model_file=("my run/fitted.yaml", model_version(model)))
    assert commands(snapshot)[0] == "idloop compare 'my run/fitted.yaml' bags/run"
    unseen = commands(replace(snapshot, validate=("bags/new",)))
    assert [one.partition(" --")[2].partition(" --")[0] for one in unseen[2:]] == ["validate bags/new"] * 2
    # What the page has changed is in the file that it offers.
    changed = replace(snapshot, model=model.with_effects(["coulomb_friction@motor(level=2.0)"]))
    assert commands(changed)[0] == "idloop compare model.yaml bags/run"


def test_what_is_significant_and_not_added_says_why():
    """Wherever it stands: beside what is missing, and under a verdict that nothing is."""
    lag = Candidate("actuator_lag", "input", "yes", "", "It lags.", gain=9.0, p_value=1e-5)
    level = 0.01
    known = Missing("adequate", candidates=(lag,), passed_over={lag.name: "it reduces the errors by 0.1 % only"})
    assert state_json._why_not(lag, known, level) == "it reduces the errors by 0.1 % only"
    for verdict in ("adequate", "not_excited", "missing"):
        assert state_json._why_not(lag, Missing(verdict, candidates=(lag,)), level)
    assert state_json._why_not(replace(lag, p_value=0.3), Missing("adequate"), level) == ""


def test_what_explains_more_and_goes_second_is_not_said_to_explain_less():
    """An effect that contains a simpler one comes after it, however much it explains."""
    simple = Candidate("coulomb_friction", "axis", "yes", "", "", gain=70.0, p_value=1e-9, explains=0.82)
    rich = replace(simple, effect="asymmetric_friction", explains=0.95)
    found = Missing("missing", candidates=(simple, rich), set=(simple.name,))
    said = state_json._why_not(rich, found, 0.01)
    assert said.startswith("Coulomb friction @ axis is the simpler one and goes first")
    # Its line in the figure of the evidence is the highest one: the words above it say why it is not the answer.
    grown = {rich.name: 658.9, found.set[0]: 72.3}
    above = state_json._outweighs(grown, Snapshot(missing=found))
    assert above.startswith("Asymmetric friction @ axis has more evidence and is not named: Coulomb friction @ axis is")
    assert state_json._outweighs({**grown, found.set[0]: 900.0}, Snapshot(missing=found)) == ""
    less = state_json._why_not(replace(rich, explains=0.5), found, 0.01)
    assert less.startswith("what is named explains more")


def test_on_a_live_graph_a_model_without_its_fit_is_pending():
    model = load_model("dc_motor")
    fit = Fit({"motor.position": 80.0}, {}, 4.0)
    shown = Snapshot(live=True, model=model, fit=fit)
    assert not shown.pending
    grown = replace(shown, model=model.with_effects(["coulomb_friction@motor"]))
    assert grown.pending
    assert not replace(grown, fit=replace(fit, error="it failed")).pending
    assert not replace(shown, live=False).pending


def test_head_and_ladder_name_the_error_that_decides():
    model = load_model("dc_motor")
    step = Step(None, model, validation={"fit": {"motor.position": 80.0}, "force": 0.2})
    said = state_json._judged_by(Ladder((step,), criterion="force"), force_known=True)
    assert said == "Effects are judged by the drive force that the measured motion leaves unexplained."
    hidden = replace(step, validation={"fit": {"motor.position": 80.0}, "force": None})
    said = state_json._judged_by(Ladder((hidden,), criterion="force"), force_known=False)
    assert said.endswith("unexplained; its error is not shown, too much of it is sensor noise.")
    # Where one step has it, every other one says that it has none.
    shown = state_json._ladder(Ladder((hidden, step), criterion="prediction"), ())
    texts = [[one["text"] for one in row["scores"]] for row in shown["steps"]]
    assert texts == [["80 %", "–"], ["80 %", "20 %"]]
    assert shown["data"].endswith("errors. –: too much of the error of the drive force is sensor noise.")
    # A live graph judges newer samples all the time.
    live = state_json._ladder(Ladder((step,), criterion="force"), (), live=True)
    assert live["data"].startswith(
        "Errors of the unseen data of the stretch that was searched; above are those of newer"
    )
    # Behind a spring, where nobody measures, it is not noise that hides the force.
    split = Candidate("compliance", "motor", "yes", "", "")
    shown = state_json._ladder(Ladder((step, replace(hidden, added=split)), criterion="prediction"), ())
    assert shown["data"].endswith("with compliance @ motor, the measurements do not determine the drive force.")


def test_a_fit_that_makes_the_free_run_worse_is_said_to():
    opened, fitted = (
        Step(None, load_model("dc_motor"), validation={"fit": {"motor.position": position, "motor.velocity": velocity}})
        for position, velocity in ((89.7, 85.0), (78.9, 84.9))
    )
    (said,) = state_json._ladder(Ladder((fitted,)), (), opened)["beware"]
    assert said.startswith("The fit makes FIT motor.position worse on these data")
    added = replace(fitted, added=Candidate("cogging", "motor", "yes", "", ""))
    assert state_json._ladder(Ladder((fitted, added)), (), opened)["beware"] == []


def test_what_an_unseen_recording_says_against_a_verdict_stands_beside_it():
    model = load_model("axis")
    test = SimpleNamespace(name="axis.position", coloured=False, follows=True, against="input")
    looked_at = SimpleNamespace(model=model, record="run2", residual_tests=(ResidualFinding("run2", test),))
    shown = Snapshot(model=model, assessment=looked_at, missing=Missing("adequate"), recordings=("run2 (unseen)",))
    said = "On run2, which is unseen, the one-step error of axis.position follows the command"
    assert state_json._elsewhere(shown.missing, shown).startswith(said)
    for other in (
        {"recordings": ("run2 (fitted)",)}, {"missing": Missing("missing")},
        {"missing": Missing("adequate", left=(ResidualFinding("run1", test),))},
    ):  # fmt: skip
        other_shown = replace(shown, **other)
        assert state_json._elsewhere(other_shown.missing, other_shown) == ""


@pytest.mark.parametrize(
    ("noise", "said"),
    [
        ((0.1, 0.2), "95 % of the sensor noise"),
        ((np.nan, np.nan), "95 % of the one-step residual"),
        ((0.1, np.nan), "95 % of the sensor noise or the one-step residual"),
    ],
)
def test_the_key_of_the_band_names_what_it_holds(noise, said):
    assert state_json._band(np.array(noise)) == said
