"""Messages to values and back, byte for byte."""

from __future__ import annotations

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop.reporting.estimates import with_interval
from idloop_nodes.codec import (
    CdrError,
    EffectEvidence,
    EffectSummary,
    Estimate,
    EvidenceSummary,
    FitSummary,
    JointReader,
    JointSample,
    JointWriter,
    LadderSummary,
    Level,
    Measures,
    MissingSummary,
    ParameterSummary,
    Status,
    StepSummary,
    UnknownSummary,
    decode_diagnostics,
    decode_header,
    decode_joint_state,
    decode_time,
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
    parameters_from_statuses,
    parameters_to_statuses,
    peek_stamp,
)
from idloop_nodes.codec.key_values import plus_minus

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
    assert decode_time(encode_time(stamp)) == stamp == peek_stamp(encode_time(stamp))
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
lines = st.lists(texts, max_size=3).map(tuple)
estimates = st.dictionaries(names, st.builds(Estimate, finite, optional, texts), max_size=2)
effects = st.builds(
    EffectSummary, names, names, st.sampled_from(["yes", "weak", "no"]), optional, finite, optional, estimates, names
)
effects = st.builds(
    lambda one, why, text, model: EffectSummary(**{**one.__dict__, "why": why, "text": text, "fitted_model": model}),
    effects,
    texts,
    texts,
    texts,
)
curve = st.lists(finite, max_size=3).map(tuple)
unknowns = st.one_of(st.none(), st.builds(UnknownSummary, texts, texts, texts, curve, curve, curve, finite, texts))
windows = st.lists(st.tuples(stamps, stamps), max_size=2).map(tuple)
by_output = st.dictionaries(names, finite, max_size=2)
measures = st.builds(Measures, by_output, by_output, by_output, optional)
steps = st.builds(StepSummary, st.one_of(st.none(), effects), name_tuples, optional, names, measures, measures, texts)
documents = st.one_of(st.none(), st.dictionaries(texts, st.one_of(finite, texts), max_size=2))


def through_a_message(items):
    serialization = pytest.importorskip("rclpy.serialization")
    message_module = pytest.importorskip("diagnostic_msgs.msg")
    data = encode_diagnostics(1, items)
    message = serialization.deserialize_message(data, message_module.DiagnosticArray)
    return decode_diagnostics(serialization.serialize_message(message))[1]


@given(
    st.builds(
        MissingSummary,
        names,
        name_tuples,
        st.sampled_from(["missing", "adequate", "unknown_structure", "not_excited"]),
        st.lists(effects, max_size=3).map(tuple),
        name_tuples,
        name_tuples,
        lines,
        lines,
        unknowns,
        names,
        finite,
        windows,
        texts,
        texts,
        name_tuples,
    )
)
def test_missing_effects_round_trip(summary):
    assert missing_from_statuses(through_a_message(missing_to_statuses("estimator", summary))) == summary


@given(
    st.builds(
        LadderSummary,
        names,
        st.lists(steps, max_size=3).map(tuple),
        names,
        name_tuples,
        documents,
        st.integers(0, 9),
        texts,
        texts,
    )
)
def test_ladder_round_trip(summary):
    assert ladder_from_statuses(through_a_message(ladder_to_statuses("estimator", summary))) == summary


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


DEAD_ZONE = EffectSummary(
    "dead_zone",
    "input",
    "yes",
    0.001,
    0.97,
    812.0,
    {"width": Estimate(0.1213, 0.0011, "V")},
    text="Dead.",
)


def test_what_stands_behind_a_plus_minus_is_the_same_interval_everywhere():
    one = Estimate(0.1213, 0.0011, "V")
    assert one.text == f"{with_interval(one.value, one.stderr)} V" == "0.1213 ± 0.0022 V"
    assert (plus_minus(None), plus_minus(float("nan"))) == ("", "")


def test_missing_effects_are_for_people():
    summary = MissingSummary("m", verdict="missing", candidates=(DEAD_ZONE,), set=("dead_zone@input", "slip@motor"))
    head, one = missing_to_statuses("estimator", summary)
    assert head.name == "estimator: missing effects"
    assert head.level == one.level == Level.WARN
    assert head.message == (
        "dead_zone@input is missing (p 0.001, explains 97 %, width 0.1213 ± 0.0022 V); "
        "this data cannot tell it from slip@motor"
    )
    assert (one.name, one.hardware_id) == ("estimator: dead_zone@input", "dead_zone@input")
    assert missing_to_statuses("estimator", MissingSummary("m", verdict="adequate"))[0].level == Level.OK
    pair = ("dead_zone@input", "saturation@input")
    together = MissingSummary("m", verdict="missing", candidates=(DEAD_ZONE,), set=pair[:1], pair=pair)
    assert missing_to_statuses("estimator", together)[0].message == (
        "only together: dead_zone@input and saturation@input are missing "
        "(p 0.001, explains 97 %, width 0.1213 ± 0.0022 V)"
    )


def test_the_ladder_is_for_people():
    start = StepSummary(validation=Measures({"motor.position": 0.1}, {"motor.position": 90.0}), model="name: m")
    step = StepSummary(
        DEAD_ZONE, ("dead_zone@input",), 0.001, "diagnosis", validation=Measures({}, {"motor.position": 99.5})
    )
    items = ladder_to_statuses("estimator", LadderSummary("m", (start, step), "adequate"))
    assert items[0].message == "start + dead_zone@input: FIT motor.position 99.50 % on data not used in the fit"
    assert [one.name for one in items[1:]] == ["estimator: step 0", "estimator: step 1"]
    assert items[2].message == "+ dead_zone@input: FIT motor.position 99.50 %"


@pytest.mark.parametrize("read", [missing_from_statuses, ladder_from_statuses, evidence_from_statuses])
def test_foreign_findings_are_refused(read):
    for items in ([], [Status("x")], [Status("x", values={"level": "a"})]):
        with pytest.raises(CdrError):
            read(items)
