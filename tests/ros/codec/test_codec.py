"""Messages to values and back, byte for byte."""

from __future__ import annotations

import math
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop.diagnosis import Candidate, Diagnosis, Ladder, Step, UnknownStructure
from idloop.diagnosis.identifiability import Gate
from idloop.json_values import to_json
from idloop.physics import load_model
from idloop.reporting.estimates import with_interval
from idloop_nodes.codec import (
    CdrError,
    EffectEvidence,
    EvidenceSummary,
    FitSummary,
    JointReader,
    JointSample,
    JointWriter,
    Level,
    ParameterSummary,
    Status,
    decode_diagnostics,
    decode_header,
    decode_joint_state,
    encode_diagnostics,
    encode_header,
    encode_joint_state,
    encode_time,
    evidence_from_statuses,
    evidence_to_statuses,
    fit_from_statuses,
    fit_to_statuses,
    ladder_from_statuses,
    ladder_to_statuses,
    missing_from_statuses,
    missing_to_statuses,
    no_diagnosis,
    parameters_from_statuses,
    parameters_to_statuses,
    peek_stamp,
)
from idloop_nodes.codec.effects import estimate_text
from idloop_nodes.codec.key_values import plus_minus
from idloop_nodes.workbench_page.reading import ladder_of, missing_of

stamps = st.integers(0, 2**31 * 10**9 - 1)
texts = st.text(st.characters(exclude_characters="\x00", exclude_categories=("Cs",)), max_size=12)
numbers = st.floats(allow_nan=False)
finite = st.floats(allow_nan=False, allow_infinity=False)
columns = st.lists(numbers, max_size=4).map(tuple)
samples = st.builds(
    JointSample, stamps, st.lists(texts, max_size=4).map(tuple), columns, columns, columns, frame_id=texts
)
statuses = st.lists(
    st.builds(Status, texts, texts, st.sampled_from(Level), st.dictionaries(texts, texts, max_size=4), texts),
    max_size=4,
)
names = st.text("abcdefghijklmnopqrstuvwxyz._@-0123456789", min_size=1, max_size=12)


@given(samples)
def test_joint_state_round_trip(sample):
    assert decode_joint_state(encode_joint_state(sample)) == sample


@given(samples)
def test_joint_state_is_what_ros_reads_and_writes(sample):
    message_module = pytest.importorskip("sensor_msgs.msg")
    serialization = pytest.importorskip("rclpy.serialization")
    message = serialization.deserialize_message(encode_joint_state(sample), message_module.JointState)
    assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == sample.stamp_ns
    assert tuple(message.name) == sample.names
    assert tuple(message.position) == sample.position
    assert tuple(message.effort) == sample.effort
    assert decode_joint_state(serialization.serialize_message(message)) == sample


@given(statuses, stamps)
def test_diagnostics_round_trip_through_ros(items, stamp):
    data = encode_diagnostics(stamp, items)
    assert decode_diagnostics(data) == (stamp, items)
    message_module = pytest.importorskip("diagnostic_msgs.msg")
    serialization = pytest.importorskip("rclpy.serialization")
    message = serialization.deserialize_message(data, message_module.DiagnosticArray)
    assert [one.name for one in message.status] == [one.name for one in items]
    assert decode_diagnostics(serialization.serialize_message(message)) == (stamp, items)


@given(stamps, texts)
def test_time_and_header_round_trip(stamp, frame):
    assert peek_stamp(encode_time(stamp)) == stamp
    assert decode_header(encode_header(stamp, frame)) == (stamp, frame)


@given(st.lists(st.tuples(stamps, finite, finite, finite), min_size=1, max_size=5))
def test_writer_and_reader_agree_with_the_codec(rows):
    writer = JointWriter(["motor", "load"], ["velocity", "position"])
    reader = JointReader([("load", "velocity"), ("motor", "position"), ("motor", "effort"), ("tail", "position")])
    for stamp, a, b, c in rows:
        data = writer.pack(stamp, (a, b), (c, a))
        assert data == encode_joint_state(JointSample(stamp, ("motor", "load"), (a, b), (c, a)))
        read_stamp, values = reader.read(data)
        assert read_stamp == stamp
        assert values[:2] == (a, a)
        assert all(math.isnan(value) for value in values[2:])


def test_reader_follows_a_change_of_shape():
    reader = JointReader([("b", "position")])
    first = encode_joint_state(JointSample(1, ("a", "b"), (1.0, 2.0)))
    second = encode_joint_state(JointSample(2, ("b", "a"), (3.0, 4.0)))
    third = encode_joint_state(JointSample(3, ("b", "a"), (), (5.0, 6.0)))
    values = [reader.read(data)[1][0] for data in (first, second, first, third)]
    assert values[:3] == [2.0, 3.0, 2.0]
    assert math.isnan(values[3])


def test_reader_takes_the_first_joint_whatever_its_name():
    reader = JointReader([("*", "effort")])
    assert reader.read(encode_joint_state(JointSample(5, ("axis", "x"), effort=(7.0, 8.0)))) == (5, (7.0,))


def test_equal_messages_are_equal_bytes_with_zero_padding():
    data = encode_joint_state(JointSample(0, ("abcd",), (1.0,)))
    position = data.index(struct.pack("<d", 1.0))
    assert data[position - 8 : position] == struct.pack("<II", 1, 0)


@given(samples, st.data())
def test_a_cut_message_is_refused(sample, data):
    whole = encode_joint_state(sample)
    cut = data.draw(st.integers(0, len(whole) - 4))
    with pytest.raises(CdrError):
        decode_joint_state(whole[: cut - cut % 4])


@given(st.binary(max_size=60))
def test_rubbish_never_raises_anything_else(data):
    for decode in (decode_joint_state, decode_diagnostics, JointReader([("motor", "effort")]).read):
        try:
            decode(data)
        except CdrError:
            continue


@given(
    st.builds(
        FitSummary,
        names,
        st.lists(names, max_size=3).map(tuple),
        names,
        st.tuples(stamps, stamps),
        st.tuples(stamps, stamps),
        st.dictionaries(names, finite, max_size=3),
        st.dictionaries(names, finite, max_size=3),
        finite,
        st.dictionaries(names, finite, max_size=3),
        texts,
        st.dictionaries(names, finite, max_size=3),
    )
)
def test_fit_round_trip(summary):
    _, items = decode_diagnostics(encode_diagnostics(1, fit_to_statuses("estimator", summary)))
    assert fit_from_statuses(items) == summary


optional = st.one_of(st.none(), finite)


estimated = st.builds(
    ParameterSummary, names, finite, optional, texts, optional, optional, st.booleans(), st.booleans(), texts
)


@given(st.lists(estimated))
def test_parameters_round_trip(items):
    _, back = decode_diagnostics(encode_diagnostics(1, parameters_to_statuses("estimator", items)))
    assert parameters_from_statuses(back) == items


def test_fit_message_is_for_people():
    summary = FitSummary("m", fit={"motor.position": 97.64}, validation_window=(0, 10**10))
    (status,) = fit_to_statuses("estimator", summary)
    assert status.name == "estimator: fit"
    assert status.message == "FIT motor.position 97.6 % on 10.0 s not used in the fit"
    assert float(status.values["fit/motor.position"]) == 97.64


def test_parameter_at_its_bound_is_a_warning():
    (status,) = parameters_to_statuses("estimator", [ParameterSummary("a", 0.0, None, "V", 0.0, None)])
    assert status.level == Level.WARN
    assert "at its bound" in status.message


def test_foreign_statuses_are_refused():
    with pytest.raises(CdrError):
        fit_from_statuses([Status("x")])
    with pytest.raises(CdrError):
        parameters_from_statuses([Status("x")])


name_tuples = st.lists(names, max_size=3).map(tuple)
MODEL = load_model("dc_motor")
ADDED = MODEL.with_effects(["dead_zone@input(width=0.5)"])
WIDTH = {"width": {"value": 0.1213, "stderr": 0.0011, "unit": "V", "held": False}}
DEAD_ZONE = Candidate("dead_zone", "input", "yes", "", "Dead.", 812.0, 0.001, 0.97, WIDTH, ADDED)
SLIP = Candidate("coulomb_friction", "motor", "weak", "slow", "Dry.")
at = np.linspace(-1.0, 1.0, 3)
UNKNOWN = UnknownStructure("motor.velocity", "rad/s", "N·m", at, 0.1 * at, 0.0 * at, 0.2, "a curve")


def diagnosed(verdict="missing", set_=("dead_zone@input",), pair=None, unknown=None, candidates=(DEAD_ZONE, SLIP)):
    return Diagnosis(MODEL, candidates, set_, verdict, Gate(("20 s, two lines",), {}, {}), unknown, "force", 0.02, pair)


def climbed(*steps):
    return Ladder((Step(None, MODEL), *steps), verdict="adequate", untestable=("cogging@motor",))


def through_a_message(items):
    serialization = pytest.importorskip("rclpy.serialization")
    message_module = pytest.importorskip("diagnostic_msgs.msg")
    data = encode_diagnostics(1, items)
    message = serialization.deserialize_message(data, message_module.DiagnosticArray)
    return decode_diagnostics(serialization.serialize_message(message))[1]


@pytest.mark.parametrize("unknown", [None, UNKNOWN])
def test_missing_effects_round_trip(unknown):
    found = diagnosed(unknown=unknown)
    summary = missing_to_statuses("estimator", found, ["at rest, 50 %"], [(1, 2), (3, 4)])
    back = missing_from_statuses(through_a_message(summary.statuses))
    assert back == summary
    assert (back.verdict, back.set, back.pair, back.error) == ("missing", ("dead_zone@input",), (), "")
    assert (back.where, back.windows) == (("at rest, 50 %",), ((1, 2), (3, 4)))
    assert back.document == to_json(found.to_dict())
    assert back.fitted_models == {"dead_zone@input": ADDED.to_yaml()}
    shown = missing_of(back, None)
    assert [one.name for one in shown.candidates] == ["dead_zone@input", "coulomb_friction@motor"]
    assert shown.candidates[0].parameters == WIDTH
    assert shown.candidates[0].model.to_yaml() == ADDED.to_yaml()
    assert (shown.findings, shown.untestable) == (("20 s, two lines",), ())
    assert (shown.unknown is None) == (unknown is None)


def test_a_diagnosis_that_failed_round_trips():
    summary = no_diagnosis("estimator", ADDED, "force", 0.02, "the worker process ended")
    back = missing_from_statuses(through_a_message(summary.statuses))
    assert back == summary
    assert (back.error, back.line) == ("the worker process ended",) * 2
    assert (back.values["effects"], back.values["level"], back.document) == ("dead_zone@input", "0.02", None)
    assert missing_of(back, None).error == "the worker process ended"


def test_the_values_of_effects_are_keys_of_their_own():
    head, effect, _ = missing_to_statuses("estimator", diagnosed(unknown=UNKNOWN), (), ()).statuses
    assert (head.values["criterion"], head.values["findings"]) == ("force", '["20 s, two lines"]')
    assert (head.values["unknown/variable"], head.values["unknown/at"]) == ("motor.velocity", "-1.0 0.0 1.0")
    expected = {"effect": "dead_zone", "at": "input", "testable": "yes", "p_value": "0.001", "explains": "0.97"}
    expected |= {"gain": "812.0", "parameter/width": "0.1213", "stderr/width": "0.0011", "unit/width": "V"}
    assert {name: effect.values[name] for name in expected} == expected


@pytest.mark.parametrize("suggested", [None, {"text": "try", "rivals": ["a"], "signal": {"name": "square"}}])
def test_ladder_round_trip(suggested):
    errors = {"nrmse": {"motor.position": 0.1}, "fit": {"motor.position": 90.0}, "force": None}
    ladder = climbed(Step(DEAD_ZONE, ADDED, ("dead_zone@input",), 0.001, train=errors))
    summary = ladder_to_statuses("estimator", ladder, suggested, 2)
    back = ladder_from_statuses(through_a_message(summary.statuses))
    assert back == summary
    assert (back.suggested_experiment, back.experiments, len(back.steps)) == (suggested, 2, 2)
    assert ladder_of(back, None).added == ("dead_zone@input",)
    named = back.document["suggested_experiment"]
    assert named == (suggested and {"text": "try", "signal": {"name": "square"}})
    step = back.steps[1].values
    assert (step["step_p_value"], step["chosen_by"], step["effect"]) == ("0.001", "diagnosis", "dead_zone")
    assert (step["train/fit/motor.position"], step["train/force"], step["model"]) == ("90.0", "", ADDED.to_yaml())
    failed = back.failed("the worker process ended")
    assert (failed.error, failed.line, failed.steps) == (*["the worker process ended"] * 2, back.steps)


counts = st.integers(0, 2**62)
weighed = st.builds(EffectEvidence, names, finite, st.one_of(st.none(), counts), st.one_of(st.none(), counts))


@given(
    st.builds(
        EvidenceSummary,
        names,
        name_tuples,
        stamps,
        finite,
        st.one_of(finite, st.just(math.inf)),
        counts,
        counts,
        finite,
        st.lists(weighed, max_size=3).map(tuple),
        name_tuples,
        st.lists(estimated, max_size=2).map(tuple),
        texts,
        texts,
    )
)
def test_evidence_round_trip(summary):
    assert evidence_from_statuses(through_a_message(evidence_to_statuses("estimator", summary))) == summary


def test_the_evidence_is_for_people():
    slip, gap = EffectEvidence("slip@motor", 9.31, 5 * 10**9, 500), EffectEvidence("dead_zone@input", 2.0)
    summary = EvidenceSummary("m", threshold=7.9, looks=2, samples=1000, seconds=10.0, candidates=(slip, gap))
    head, *effects = evidence_to_statuses("estimator", summary)
    assert head.message == "decided: slip@motor; 10 s of new samples so far"
    assert [one.name for one in effects] == ["estimator: slip@motor", "estimator: dead_zone@input"]
    assert [one.level for one in (head, *effects)] == [Level.WARN, Level.WARN, Level.OK]
    assert effects[0].values["decided_samples"] == "500"
    assert effects[1].values["decided"] == "false"
    undecided = EvidenceSummary("m", threshold=7.9, looks=2, seconds=10.0, candidates=(gap,))
    assert undecided.line == "nothing decided; most for dead_zone@input, log E 2.0 of 7.9; 10 s of new samples so far"
    early = EffectEvidence("dead_zone@input", 49.3, pending="a second stretch of samples must confirm it")
    line = EvidenceSummary("m", threshold=8.9, looks=1, seconds=5.0, candidates=(early,)).line
    assert "log E 49.3 of 8.9, but a second stretch of samples must confirm it; 5 s" in line


def test_what_stands_behind_a_plus_minus_is_the_same_interval_everywhere():
    assert estimate_text(WIDTH["width"]) == f"{with_interval(0.1213, 0.0011)} V" == "0.1213 ± 0.0022 V"
    assert (plus_minus(None), plus_minus(float("nan"))) == ("", "")


def test_missing_effects_are_for_people():
    ties = ("dead_zone@input", "coulomb_friction@motor")
    head, one, _ = missing_to_statuses("estimator", diagnosed(set_=ties), (), ()).statuses
    assert head.name == "estimator: missing effects"
    assert head.level == one.level == Level.WARN
    assert head.message == (
        "dead_zone@input is missing (p 0.001, explains 97 %, width 0.1213 ± 0.0022 V); "
        "this data cannot tell it from coulomb_friction@motor"
    )
    assert (one.name, one.hardware_id) == ("estimator: dead_zone@input", "dead_zone@input")
    nothing = missing_to_statuses("estimator", diagnosed("adequate", ()), (), ()).statuses[0]
    assert (nothing.level, nothing.message) == (Level.OK, "nothing significant is missing")
    together = diagnosed(pair=("dead_zone@input", "saturation@input"))
    assert missing_to_statuses("estimator", together, (), ()).line == (
        "only together: dead_zone@input and saturation@input are missing "
        "(p 0.001, explains 97 %, width 0.1213 ± 0.0022 V)"
    )


def test_the_ladder_is_for_people():
    step = Step(DEAD_ZONE, ADDED, ("dead_zone@input",), 0.001, validation={"fit": {"motor.position": 99.5}})
    items = ladder_to_statuses("estimator", climbed(step), None, 0).statuses
    assert items[0].message == "start + dead_zone@input: FIT motor.position 99.50 % on data not used in the fit"
    assert [one.name for one in items[1:]] == ["estimator: step 0", "estimator: step 1"]
    assert items[2].message == "+ dead_zone@input: FIT motor.position 99.50 %"


@pytest.mark.parametrize("read", [missing_from_statuses, ladder_from_statuses, evidence_from_statuses])
def test_foreign_findings_are_refused(read):
    for items in ([], [Status("x")], [Status("x", values={"level": "a"})]):
        with pytest.raises(CdrError):
            read(items)
