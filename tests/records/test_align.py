"""A model's signals are found, sorted and put on one time axis; what was wrong with the stamps is said."""

from __future__ import annotations

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from idloop.errors import InputError
from idloop.records import Record, make_stream, read_record, read_records, record_streams, write_bag
from idloop.records.inspection.inspection import inspect_bag


def _kinds(record: Record) -> set[str]:
    return {finding.kind for finding in record.findings}


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_round_trip(tmp_path, record, model, storage):
    read = read_record(write_bag(tmp_path / "bag", record, storage=storage), model)
    assert read.start_ns == record.start_ns
    assert read.output_names == record.output_names
    assert read.input_name == record.input_name
    assert not read.findings
    for name in (
        "input_time",
        "input",
        "time",
        "output",
        "reference_time",
        "reference",
        "excitation_time",
        "excitation",
    ):
        np.testing.assert_allclose(getattr(read, name), getattr(record, name), rtol=0, atol=1e-12)


def test_sensors_with_stamps_of_their_own(tmp_path, model):
    model.outputs[1] = SimpleNamespace(topic="encoder", joint="load", field="velocity", unit="rad/s")
    stamps = 10**18 + 1_000_000 * np.arange(100)
    path = write_bag(
        tmp_path / "bag",
        [
            make_stream("joint_command", stamps, {"motor": {"effort": np.arange(100.0)}}),
            make_stream("joint_states", stamps, {"motor": {"position": np.arange(100.0)}}),
            make_stream("encoder", stamps[::2] + 300_000, {"load": {"velocity": np.arange(50.0)}}),
        ],
    )
    record = read_record(path, model)
    assert record.output.shape == (150, 2)
    assert np.isfinite(record.output).sum(axis=0).tolist() == [100, 50]
    assert record.output_names == ("motor.position", "load.velocity")
    assert record.time[1] == pytest.approx(0.0003)


def test_a_joint_of_another_name_is_told_with_what_to_do(tmp_path, record, model):
    model.input = SimpleNamespace(**vars(model.input) | {"joint": "elbow"})
    path = write_bag(tmp_path / "bag", record)
    with pytest.raises(InputError, match=r"no joint 'elbow'; known: motor; give --joint elbow=NAME"):
        read_record(path, model)


def test_namespace_is_found_and_two_are_refused(tmp_path, record, model):
    inside = [replace(stream, topic="/left/" + stream.topic) for stream in record_streams(record)]
    assert read_record(write_bag(tmp_path / "one", inside), model).reference is not None
    both = inside + [replace(stream, topic=stream.topic.replace("left", "right")) for stream in inside]
    path = write_bag(tmp_path / "two", both)
    with pytest.raises(InputError, match="several namespaces"):
        read_record(path, model)
    model.input.__dict__["topic"] = "/right/joint_command"
    model.outputs = [
        SimpleNamespace(**(output.__dict__ | {"topic": "/right/joint_states"})) for output in model.outputs
    ]
    assert read_record(path, model).excitation is not None


def test_measurements_without_a_command_in_force_are_left_out(make_bag, model):
    record = read_record(make_bag(np.arange(400) / 100, command_time=1 + np.arange(100) / 100), model)
    assert record.time[0] == 0.0
    assert record.input_time[0] == 0.0
    assert record.duration == pytest.approx(1.09, abs=0.011)
    assert sum(finding.count for finding in record.findings if finding.kind == "cut") == 400 - record.time.size


def test_the_command_before_the_first_measurement_stays_known(make_bag, model):
    record = read_record(make_bag(1.005 + np.arange(100) / 100, command_time=np.arange(200) / 100), model)
    assert record.input_time[0] == pytest.approx(-0.005)
    assert np.isfinite(record.input_at(record.time)).all()


def test_duplicates_order_gaps_and_losses_are_reported(make_bag, model):
    time = np.arange(300) / 100
    time = np.delete(time, [50, *range(100, 130)])
    time[20] = time[19]
    time[[150, 151]] = time[[151, 150]]
    record = read_record(make_bag(time, position=10 * time, velocity=-time), model)
    assert {"duplicate_stamps", "gap", "lost_samples", "out_of_order"} <= _kinds(record)
    assert (np.diff(record.time) > 0).all()
    np.testing.assert_allclose(record.output[:, 0], 10 * record.time, atol=0.11)
    lost = next(finding for finding in record.findings if finding.kind == "lost_samples" and "states" in finding.where)
    assert 31 <= lost.count <= 33


def test_of_two_commands_with_one_stamp_the_later_counts(make_bag, model):
    command_time = np.repeat(np.arange(100) / 100, 2)
    command = np.tile([0.0, 1.0], 100)
    command[1] = 2.0
    record = read_record(make_bag(command_time=command_time, command=command), model)
    assert record.input[0] == 2.0
    assert set(record.input[1:]) == {1.0}


def test_runs_of_a_clock_that_was_set_back(make_bag, model):
    time = np.concatenate([np.arange(100), np.arange(150)]) / 100
    path = make_bag(time, receive=np.arange(250) / 100, command_receive=np.arange(250) / 100)
    with pytest.raises(InputError, match="time runs backwards"):
        read_record(path, model)
    with pytest.raises(InputError, match="time runs backwards"):
        read_records(path, model)
    assert [record.time.size for record in read_records(path, model, split=True)] == [100, 150]
    assert read_record(path, model, run=1).time.size == 150
    with pytest.raises(InputError, match="no run 2"):
        read_record(path, model, run=2)


def test_a_reference_that_is_announced_anew_replaces_what_was_announced(tmp_path, model):
    start, period = 10**18, 10_000_000
    time = start + period * np.arange(200)
    # At 0.5 s the 20 values announced ahead, up to 0.7 s, are taken back.
    announced = start + period * np.r_[0:70, 51:200]
    value = np.r_[np.full(70, 1.0), np.full(149, -1.0)]
    received = start + period * np.arange(219)
    streams = [
        make_stream("joint_command", time, {"motor": {"effort": np.sin(np.arange(200.0))}}),
        make_stream("joint_states", time, {"motor": {"position": np.arange(200.0), "velocity": np.ones(200)}}),
        make_stream("reference", announced, {"motor": {"position": value, "velocity": value}}, received),
    ]
    path = write_bag(tmp_path / "bag", streams)
    record = read_record(path, model)
    np.testing.assert_allclose(record.reference_time, np.arange(200) / 100, atol=1e-9)
    np.testing.assert_array_equal(record.reference[:, 0], np.where(np.arange(200) < 51, 1.0, -1.0))
    kinds = {finding.kind: finding.level for finding in inspect_bag(path).findings}
    assert kinds.get("announced_anew") == "note"
    assert "clock_reset" not in kinds


@pytest.mark.parametrize("taken_back", [False, True])
def test_a_reference_follows_the_runs_of_the_clock(tmp_path, model, taken_back):
    start, period = 10**18, 10_000_000
    time = start + period * np.r_[0:100, 0:150]
    first = np.r_[0:70, 51:120] if taken_back else np.arange(120)
    announced = start + period * np.r_[first, 0:170]
    value = np.r_[np.full(first.size, 1.0), np.full(170, 2.0)]
    received, order = start + period * np.arange(announced.size), start + period * np.arange(250)
    motion = {"position": np.arange(250.0), "velocity": np.ones(250)}
    streams = [
        make_stream("joint_command", time, {"motor": {"effort": np.sin(np.arange(250.0))}}, order),
        make_stream("joint_states", time, {"motor": motion}, order),
        make_stream("reference", announced, {"motor": {"position": value, "velocity": value}}, received),
    ]
    for run, (length, level) in enumerate([(120, 1.0), (170, 2.0)]):
        record = read_record(write_bag(tmp_path / f"bag{run}", streams), model, run=run)
        assert record.reference_time.size == length
        assert set(record.reference[:, 0]) == {level}


def test_several_bags_are_one_experiment(make_bag, model):
    assert len(read_records([make_bag(), make_bag()], model)) == 2


def test_receive_stamps_on_request(make_bag, model):
    path = make_bag(receive=np.arange(200) / 100 + 7, command_receive=np.arange(200) / 100 + 7)
    record = read_record(path, model, stamps="receive")
    assert record.start_ns == read_record(path, model).start_ns + 7_000_000_000


def test_clocks_that_drift_apart(make_bag, model):
    time = np.arange(20_000) / 1000
    quick = 1.0 + 1e-2
    path = make_bag(time, command_time=quick * time, receive=time, command_receive=time)
    with pytest.raises(InputError, match="two clocks: the stamps of /joint_command and /joint_states drift apart"):
        read_record(path, model)
    record = read_record(path, model, stamps="receive")
    assert record.time.size == time.size  # both on the recorder's clock
    noted = read_record(
        make_bag(10 * time, command_time=10 * time * (1 + 4e-4), receive=10 * time, command_receive=10 * time), model
    )
    assert "clock_drift" in _kinds(noted)


def test_a_simulation_faster_than_time_has_one_clock(make_bag, model):
    time = np.arange(20_000) / 1000
    rng = np.random.default_rng(1)
    wall = np.sort(time / 7 + 0.002 * rng.random(time.size))
    velocity = 100.0 * np.cos(np.arange(time.size) / 10)
    bag = make_bag(time, velocity=velocity, receive=wall, command_receive=wall + 1e-4)
    assert not read_record(bag, model).findings


def test_encoder_wrap(make_bag, model):
    angle = np.cumsum(np.full(200, 0.2))
    record = read_record(make_bag(position=np.mod(angle, 2 * np.pi)), model, wrap={"motor.position": 2 * np.pi})
    np.testing.assert_allclose(np.diff(record.output[:, 0]), 0.2, atol=1e-12)


def test_unmeasured_values_inside_a_stream_are_legal(make_bag, model):
    velocity = np.where(np.arange(200) % 5 == 0, 1.0 * np.arange(200), np.nan)
    record = read_record(make_bag(velocity=velocity), model)
    assert record.time.size == 200
    assert np.isfinite(record.output[:, 1]).sum() == 40
    assert "not_measured" in _kinds(record)


def test_holes_in_the_command_are_a_warning_that_says_where(make_bag, model):
    time = np.arange(200)
    record = read_record(make_bag(command=np.where((time > 49) & (time < 60), np.nan, np.sin(time))), model)
    (found,) = [finding for finding in record.findings if finding.kind == "not_measured"]
    assert (found.level, found.count) == ("warning", 10)
    assert "from 0.5 to 0.59 s; the command before is assumed to hold there" in found.text
    before = read_record(make_bag(command=np.where(time < 10, np.nan, np.sin(time))), model)
    (found,) = [finding for finding in before.findings if finding.kind == "not_measured"]
    assert "hold" not in found.text


def test_few_samples_are_a_warning(make_bag, model):
    assert "few_samples" in _kinds(read_record(make_bag(np.arange(29) / 100), model))
    assert "few_samples" not in _kinds(read_record(make_bag(), model))


def test_a_unit_that_differs_from_the_imports_is_reported(tmp_path, record, model):
    units = {"joint_command motor.effort": "A", "joint_states motor.velocity": "rad/s"}
    bag = write_bag(tmp_path / "bag", record, custom={"idloop.import": json.dumps({"units": units})})
    found = [finding for finding in read_record(bag, model).findings if finding.kind == "unit"]
    assert [(one.where, one.level) for one in found] == [("motor.effort", "warning")]
    assert "in A in the bag and in V in the model" in found[0].text
    unknown = json.dumps({"units": {"joint_command motor.effort": ""}})
    bag = write_bag(tmp_path / "without", record, custom={"idloop.import": unknown})
    (finding,) = (one for one in read_record(bag, model).findings if one.kind == "unit")
    assert "in a unit that is not known in the bag and in V in the model" in finding.text
