"""Foreign files become bags of our topics; the public sets carry the numbers their READMEs state."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest

from idloop.errors import InputError
from idloop.records import read_record, read_streams
from idloop.records.tables.importing import import_bag
from idloop.records.tables.mapping import parse_mapping


def _mapping(**more):
    base = {"schema": "idloop/mapping/1", "name": "x", "joint": "motor", "time": {"column": "t"}}
    return parse_mapping(
        base | {"command": {"column": "u", "unit": "V"}, "position": {"column": "y", "unit": "rad"}} | more, "x.yaml"
    )


def _csv(tmp_path, **columns):
    path = tmp_path / "data.csv"
    rows = zip(*columns.values(), strict=True)
    path.write_text("\n".join([",".join(columns), *(",".join(map(str, row)) for row in rows)]))
    return path


def test_scale_offset_product_decoding_wrap_and_rows(tmp_path):
    k = np.arange(50)
    angle = 0.3 * k
    source = _csv(
        tmp_path, t=k / 100, load=(-k) % 65536, volts=np.full(50, 2.0), y=np.round(np.mod(angle, 2 * np.pi), 9)
    )
    mapping = _mapping(
        command={"column": "load", "decode": "int16", "scale": 0.5, "times": "volts", "offset": 1.0, "unit": "V"},
        position={"column": "y", "wrap": 2 * np.pi, "unit": "rad"},
        rows={"start": 10, "stop": 40},
    )
    result = import_bag(source, tmp_path / "bag", mapping)
    streams = read_streams(tmp_path / "bag")
    assert result.samples == 30
    np.testing.assert_allclose(streams["/joint_command"].effort[:, 0], 1.0 - k[10:40])
    np.testing.assert_allclose(np.diff(streams["/joint_states"].position[:, 0]), 0.3, atol=1e-8)


def test_turns_in_a_hole_of_the_log_are_told_by_the_speed_or_said_to_be_a_guess(tmp_path):
    times = np.concatenate([np.arange(30) * 0.01, 1.3 + np.arange(30) * 0.01, 2.6 + np.arange(30) * 0.01])
    angle = np.where(times < 2.0, 13.0 * times, 13.0 * 1.59 + 1.0 * (times - 1.59))
    source = _csv(tmp_path, t=times, u=np.sin(times), y=np.round(np.mod(angle, 2 * np.pi), 9))
    result = import_bag(source, tmp_path / "bag", _mapping(position={"column": "y", "wrap": 2 * np.pi, "unit": "rad"}))
    position = read_streams(tmp_path / "bag")["/joint_states"].position[:, 0]
    np.testing.assert_allclose(np.diff(position)[:59], np.diff(angle)[:59], atol=1e-8)
    (told,) = (finding for finding in result.findings if finding.kind == "turns_unknown")
    assert told.level == "warning"
    assert "in 1 gap of the log (the first at 1.59 s, 1.01 s long)" in told.text


def test_empty_cells_do_not_become_messages(tmp_path):
    source = _csv(tmp_path, t=[0, 1, 2, 3], u=["", 1, 2, 3], y=["", "", 5, 6], v=["", 7, "", 8])
    result = import_bag(source, tmp_path / "bag", _mapping(velocity="v"))
    streams = read_streams(tmp_path / "bag")
    assert len(streams["/joint_command"]) == 3
    np.testing.assert_array_equal(streams["/joint_states"].position[:, 0], [np.nan, 5, 6])
    np.testing.assert_array_equal(streams["/joint_states"].velocity[:, 0], [7, np.nan, 8])
    assert {finding.kind for finding in result.findings} == {"not_measured"}


def test_how_a_file_is_written_is_found_out_and_told(tmp_path):
    source = tmp_path / "messung.csv"
    text = "t;Spannung;Winkel\ns;V;°\n0,00;1,5;10\n0,01;-1,5;20\n0,02;2,5;30\n"
    source.write_bytes(text.encode("latin-1"))
    mapping = _mapping(command={"column": "Spannung", "unit": "V"}, position={"column": "Winkel", "unit": "deg"})
    result = import_bag(source, tmp_path / "bag", mapping)
    assert result.samples == 3
    streams = read_streams(tmp_path / "bag")
    np.testing.assert_allclose(streams["/joint_command"].effort[:, 0], [1.5, -1.5, 2.5])
    np.testing.assert_allclose(np.degrees(streams["/joint_states"].position[:, 0]), [10.0, 20.0, 30.0])
    told = " ".join(finding.text for finding in result.findings)
    for words in ("Windows-1252", "decimal commas", "read as units and left out: s, V, °"):
        assert words in told
    assert {finding.level for finding in result.findings} == {"note"}


@pytest.mark.parametrize("more", ({"position": []}, {"position": [], "effort": "y"}))
def test_a_record_without_motion_is_imported_with_a_warning(tmp_path, more):
    source = _csv(tmp_path, t=[0, 1, 2], u=[1, 2, 3], y=[4, 5, 6])
    (finding,) = import_bag(source, tmp_path / "bag", _mapping(**more)).findings
    assert (finding.kind, finding.level) == ("no_measurement", "warning")
    assert "add `position:` or `velocity:` to the mapping" in finding.text


def test_a_record_without_a_command_is_imported_with_a_warning(tmp_path):
    source = _csv(tmp_path, t=[0, 1, 2], u=[1, 2, 3], y=[4, 5, 6])
    (finding,) = import_bag(source, tmp_path / "bag", _mapping(command=[])).findings
    assert (finding.kind, finding.level) == ("no_command", "warning")
    assert "`command:`" in finding.text


def test_two_joints(tmp_path):
    source = _csv(tmp_path, t=[0, 1, 2], u=[1, 2, 3], a=[4, 5, 6], b=[7, 8, 9])
    import_bag(source, tmp_path / "bag", _mapping(position=["a", {"column": "b", "joint": "load"}]))
    stream = read_streams(tmp_path / "bag")["/joint_states"]
    assert stream.names == ("motor", "load")
    np.testing.assert_array_equal(stream.position, [[4, 7], [5, 8], [6, 9]])


def test_units_of_the_file_become_those_of_the_topics(tmp_path):
    k = np.arange(50)
    source = _csv(tmp_path, t=k / 100, u=1000.0 * np.sin(k), y=np.mod(20.0 * k, 360.0), v=60.0 * k)
    result = import_bag(
        source,
        tmp_path / "bag",
        _mapping(
            command={"column": "u", "unit": "mV"},
            position={"column": "y", "unit": "deg", "wrap": 360.0},
            velocity={"column": "v", "unit": "rpm"},
        ),
    )
    assert result.channels["joint_states motor.position"] == "rad"
    streams = read_streams(tmp_path / "bag")
    np.testing.assert_allclose(streams["/joint_command"].column("motor", "effort"), np.sin(k), atol=1e-12)
    np.testing.assert_allclose(streams["/joint_states"].column("motor", "position"), np.radians(20.0 * k))
    np.testing.assert_allclose(streams["/joint_states"].column("motor", "velocity"), 2 * np.pi * k)


@pytest.mark.parametrize(
    ("unit", "cells", "start"),
    [
        ("s", ["0.25", "0.5"], 1_250_000_000),
        ("ms", ["-3", "247"], 1_000_000_000),
        ("s", ["1700000000.25", "1700000000.5"], 1_700_000_000_250_000_000),
        ("iso8601", ["2025-11-12T10:03:29.500Z", "2025-11-12T10:03:29.750Z"], 1_762_941_809_500_000_000),
    ],
)
def test_time(tmp_path, unit, cells, start):
    source = _csv(tmp_path, t=cells, u=[1, 2], y=[1, 2])
    import_bag(source, tmp_path / "bag", _mapping(time={"column": "t", "unit": unit}))
    stamps = read_streams(tmp_path / "bag")["/joint_states"].stamp_ns
    assert abs(stamps[0] - start) <= 128  # a double holds seconds since 1970 to 0.1 µs
    assert abs(stamps[1] - stamps[0] - 250_000_000) <= 256


BAD = {
    "time backwards": ({"t": [0, 2, 1]}, {}, "runs backwards in row 2"),
    "a period of centuries": ({}, {"time": {"period": 1e300}}, "time: 3 rows at every 1e+300 s last longer"),
    "a rate of nothing": ({}, {"time": {"rate": 1e-300}}, "longer than any recording; correct the rate"),
    "a rate of less": ({}, {"time": {"rate": 5e-324}}, "longer than any recording; correct the rate"),
    "infinite value": ({"y": [0, "inf", 1]}, {}, "infinite in row 1"),
    "empty column": ({"y": ["", "", ""]}, {}, "empty (NaN) in every row"),
    "time not a number": ({"t": [0, "", 1]}, {}, "not a number in row 1"),
    "time out of reach": ({"t": [0, 1, 3e231]}, {}, "3e+231 s in row 2, which is not a time"),
    "time far behind": ({"t": [0, 1, -3e300]}, {}, "in row 2, which is not a time"),
    "a date out of reach": (
        {"t": ["2020-01-01", "2021-01-01", "9999-01-01"]},
        {"time": {"column": "t", "unit": "iso8601"}},
        "in row 2, which is not a time",
    ),
    "a date too early": (
        {"t": ["1960-01-01", "1961-01-01", "1962-01-01"]},
        {"time": {"column": "t", "unit": "iso8601"}},
        "begins before 1970",
    ),
    "no ISO time": ({}, {"time": {"column": "t", "unit": "iso8601"}}, "not an ISO 8601 time"),
    "rows outside": ({}, {"rows": {"start": 2, "stop": 9}}, "do not lie within its 3 rows"),
    "no time": ({}, {"time": None}, "say where time comes from"),
    "no joint": ({}, {"joint": None}, "no joint named"),
    "topic of a table": ({}, {"command": {"topic": "u"}}, "is a table"),
    "column misspelt": ({}, {"command": "uu"}, "did you mean 'u'"),
    "one target twice": ({}, {"position": ["u", "y"]}, "two columns become joint_states motor.position"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_import(tmp_path, name):
    columns, more, words = BAD[name]
    source = _csv(tmp_path, **({"t": [0, 1, 2], "u": [1, 2, 3], "y": [4, 5, 6]} | columns))
    with pytest.raises(InputError) as caught:
        import_bag(source, tmp_path / "bag", _mapping(**more))
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "bag").exists()


def test_an_existing_bag_is_kept(tmp_path, bag):
    with pytest.raises(InputError, match="not overwritten"):
        import_bag(_csv(tmp_path, t=[0], u=[1], y=[1]), bag, _mapping())


def test_a_foreign_bag(tmp_path, write_messages, joint_state, typestore):
    types = typestore.types
    layout = types["std_msgs/msg/MultiArrayLayout"]([], 0)
    array = types["std_msgs/msg/Float64MultiArray"]
    source = write_messages(
        tmp_path / "robot",
        [
            (
                "/arm/commands",
                "std_msgs/msg/Float64MultiArray",
                [(k * 10**7, array(layout, np.array([0.0, k]))) for k in range(1, 50)],
            ),
            (
                "/arm/joint_states",
                "sensor_msgs/msg/JointState",
                [(k * 10**7 + 9, joint_state(k * 10**7 + 5, ["a", "b"], [0, 180 * k])) for k in range(1, 50)],
            ),
        ],
    )
    content = {
        "schema": "idloop/mapping/1",
        "name": "robot",
        "joint": "elbow",
        "command": {"topic": "commands", "field": "data[1]", "unit": "N·m"},
        "position": {"topic": "joint_states", "source_joint": "b", "scale": np.pi / 180, "unit": "rad"},
    }
    import_bag(source, tmp_path / "bag", parse_mapping(content, "robot.yaml"))
    streams = read_streams(tmp_path / "bag")
    assert streams["/joint_states"].names == ("elbow",)
    assert streams["/joint_states"].stamp_ns[0] == 10**7 + 5
    assert streams["/joint_states"].receive_ns[0] == 10**7 + 9
    np.testing.assert_allclose(streams["/joint_states"].position[:, 0], np.pi * np.arange(1, 50))
    np.testing.assert_array_equal(streams["/joint_command"].effort[:, 0], np.arange(1, 50))
    optional = content | {"command": content["command"] | {"optional": True}}
    import_bag(source, tmp_path / "short", parse_mapping(optional, "robot.yaml"))
    assert "/joint_command" in read_streams(tmp_path / "short"), "a short name is as good for what is optional"
    doubled = content | {"command": content["command"] | {"times": "volts"}}
    with pytest.raises(InputError, match="`times: volts` names a column"):
        import_bag(source, tmp_path / "doubled", parse_mapping(doubled, "robot.yaml"))


def test_signals_stamped_where_measured_beside_those_on_arrival(tmp_path, write_messages, joint_state, typestore):
    number = typestore.types["std_msgs/msg/Float64"]
    period, stamps = 5 * 10**6, np.arange(1, 400) * 5 * 10**6
    delay = np.random.default_rng(0).integers(10**5, 8 * 10**6, stamps.size)
    states = [
        (int(t + late), joint_state(int(t), ["a"], [1e-9 * t]))
        for t, late in zip(stamps, np.sort(stamps + delay) - stamps, strict=True)
    ]
    current = [(int(t) + period // 3, number(2e-9 * t)) for t in stamps]
    source = write_messages(
        tmp_path / "robot",
        [("/joint_states", "sensor_msgs/msg/JointState", states), ("/current", "std_msgs/msg/Float64", current)],
    )
    effort = {"topic": "current", "field": "data", "unit": "A"}
    content = {
        "schema": "idloop/mapping/1",
        "name": "robot",
        "joint": "a",
        "command": effort,
        "position": {"topic": "joint_states", "source_joint": "a", "unit": "rad"},
        "effort": effort,
    }
    done = import_bag(source, tmp_path / "bag", parse_mapping(content, "robot.yaml"))
    assert not [one.text for one in done.findings if "lost" in one.text or "set back" in one.text]
    stream = read_streams(tmp_path / "bag")["/joint_states"]
    assert (np.diff(stream.stamp_ns) > 0).all()
    position, known = stream.position[:, 0], ~np.isnan(stream.position[:, 0])
    np.testing.assert_allclose(position[known], 1e-9 * stamps)


@pytest.mark.parametrize(("column", "read"), [(3, True), ("v", True), (4, False), ("w", False)])
def test_an_optional_column_is_read_where_the_file_has_it(tmp_path, column, read):
    source = _csv(tmp_path, t=[0, 1, 2], u=[1, 2, 3], y=[4, 5, 6], v=[7, 8, 9])
    velocity = {"column": column, "unit": "rad/s", "optional": True}
    import_bag(source, tmp_path / "bag", _mapping(velocity=velocity))
    found = read_streams(tmp_path / "bag")["/joint_states"].velocity[:, 0]
    np.testing.assert_array_equal(found, [7, 8, 9] if read else [np.nan] * 3)


# ---------------------------------------------------------------- public sets


def _signals(joint, *fields):
    def signal(topic, field):
        return SimpleNamespace(topic=topic, joint=joint, field=field, unit="", kind="held")

    return SimpleNamespace(
        input=signal("joint_command", "effort"),
        outputs=[signal("joint_states", field) for field in fields],
        conditions=(),
    )


@pytest.mark.slow
def test_emps(data_dir, tmp_path):
    from scipy.io import loadmat

    for name in ("DATA_EMPS", "DATA_EMPS_PULSES"):
        raw = loadmat(data_dir / "emps" / f"{name}.mat", squeeze_me=True)
        import_bag(data_dir / "emps" / f"{name}.mat", tmp_path / name, "emps")
        record = read_record(tmp_path / name, _signals("axis", "position"))
        np.testing.assert_allclose(record.time, raw["t"], atol=1e-9)
        np.testing.assert_array_equal(record.input, raw["vir"])
        np.testing.assert_array_equal(record.output[:, 0], raw["qm"])
        assert record.reference is not None
        np.testing.assert_array_equal(record.reference[:, 0], raw["qg"])
        assert (record.excitation is None) == (name == "DATA_EMPS")
    assert record.excitation is not None
    assert set(record.excitation[:, 1]) == {0.0, 5.0}


def test_emps_command_follows_the_published_controller(data_dir, tmp_path):
    """v = kp kv (qg - qm) - kv dq, checked on what the import wrote: its units and alignment are right."""
    import_bag(data_dir / "emps" / "DATA_EMPS.mat", tmp_path / "bag", "emps")
    record = read_record(tmp_path / "bag", _signals("axis", "position"))
    assert record.reference is not None
    position = record.output[:, 0]
    mean = 0.5 * (position + np.r_[position[0], position[:-1]])
    rate = np.r_[0.0, np.diff(mean)] / 1e-3
    command = 160.18 * 243.45 * (record.reference[:, 0] - position) - 243.45 * rate
    error = np.linalg.norm((command - record.input)[10:]) / np.linalg.norm(record.input[10:])
    assert error < 0.003


def test_dcmotor(data_dir, tmp_path):
    source = next((data_dir / "dcmotor_fra233" / "npz").glob("*Chirp.npz"))
    import_bag(source, tmp_path / "bag", "dcmotor_fra233")
    record = read_record(tmp_path / "bag", _signals("motor", "velocity"))
    assert record.time.size == 25502
    assert np.abs(record.input).max() == pytest.approx(12.0)
    # Somewhat below 1/Ke = 24 rad/s per volt: friction takes its share.
    assert np.polyfit(record.input, record.output[:, 0], 1)[0] == pytest.approx(20.0, rel=0.1)


def test_bam(data_dir, tmp_path):
    for source in sorted((data_dir / "bam_servo_pendulum" / "xl330_raw").glob("*.json"))[::5]:
        log = json.loads(source.read_text())
        result = import_bag(source, tmp_path / source.stem, "bam")
        record = read_record(tmp_path / source.stem, _signals("servo", "position", "velocity"))
        assert result.attributes["kp"] == log["kp"]
        volts = max(entry["input_volts"] for entry in log["entries"])
        assert np.abs(record.input).max() <= volts
        assert record.reference is not None
        # The servo drives towards its goal: command and position error have one sign.
        error = record.reference[:, 0] - record.output[:, 0]
        driven = np.array([entry["torque_enable"] for entry in log["entries"]])
        assert np.corrcoef(record.input[driven], error[driven])[0, 1] > 0.9


def test_bam_without_load_is_imported_with_a_warning_and_refused_for_a_fit(data_dir, tmp_path):
    source = next((data_dir / "bam_servo_pendulum" / "sts3250_raw").glob("*.json"))
    result = import_bag(source, tmp_path / "bag", "bam")
    assert "constant_input" in {finding.kind for finding in result.findings}
    with pytest.raises(InputError, match="constant"):
        read_record(tmp_path / "bag", _signals("servo", "position"))


@pytest.mark.slow
def test_silverbox(data_dir, tmp_path):
    source = data_dir / "silverbox" / "SNLS80mV.csv"
    with pytest.raises(InputError, match="--part: arrow, multisines"):
        import_bag(source, tmp_path / "none", "silverbox")
    for part, count in (("arrow", 40540), ("multisine_10", 8692)):
        result = import_bag(source, tmp_path / part, "silverbox", part=part)
        assert result.samples == count
        record = read_record(tmp_path / part, _signals("oscillator", "position"))
        assert record.sample_time == pytest.approx(2**14 / 10e6, rel=1e-6)
        # Each part begins and ends at rest.
        assert np.ptp(record.input[:20]) < 0.004
        assert np.ptp(record.output[:20, 0]) < 0.03
        assert np.std(record.input) > 0.02


@pytest.mark.parametrize(("part", "amplitude"), [("z1", 1.0), ("z2", 1.5), ("z3", 0.5)])
def test_ced(data_dir, tmp_path, part, amplitude):
    import_bag(data_dir / "ced_prbs" / "drive.mat", tmp_path / "bag", "ced", part=part)
    record = read_record(tmp_path / "bag", _signals("pulley", "velocity"))
    assert record.time.size == 500
    assert record.sample_time == pytest.approx(0.02)
    assert set(record.input) == {amplitude, -amplitude}
    assert record.output.min() > 0


def test_backlash(data_dir, tmp_path):
    source = data_dir / "backlash_sts3215" / "motor_telemetry_single.csv"
    import_bag(source, tmp_path / "bag", "backlash_sts3215", part="motor5")
    record = read_record(tmp_path / "bag", _signals("servo", "position", "velocity"))
    assert record.sample_time == pytest.approx(0.101, abs=0.001)
    speed = np.gradient(record.output[:, 0], record.time)
    # Three speeds at rest are single bad readings, and left out.
    known = np.isfinite(record.output[:, 1])
    assert np.count_nonzero(~known) == 3
    # Signs decoded: reported speed follows the position, and the drive pushes where the motor goes.
    assert np.corrcoef(speed[known], record.output[known, 1])[0, 1] > 0.85
    assert record.reference is not None
    assert np.corrcoef(record.input, record.reference[:, 0] - record.output[:, 0])[0, 1] > 0.3


def test_odrive(data_dir, tmp_path):
    folder = data_dir / "odrive_rosbag2_idle"
    import_bag(folder / "rosbag2_2024_08_22-12_20_42", tmp_path / "bag", "odrive")
    import csv

    with (folder / "controller1.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    stream = read_streams(tmp_path / "bag")["/joint_states"]
    assert stream.receive_ns.tolist() == [int(row["timestamp"]) for row in rows]
    np.testing.assert_allclose(stream.position[:, 0], [2 * np.pi * float(row["pos_estimate"]) for row in rows])
    np.testing.assert_allclose(stream.velocity[:, 0], [2 * np.pi * float(row["vel_estimate"]) for row in rows])


def _clocks(tmp_path):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "drive.csv").write_text("t,u\n" + "".join(f"{0.02 * k:.3f},{(-1) ** k}\n" for k in range(20)))
    (tmp_path / "run" / "encoder_80.csv").write_text(
        "ms,a,b\n" + "".join(f"{5 * k + 2},{k},{2 * k}\n" for k in range(80))
    )
    return tmp_path / "run"


JOINED = {
    "schema": "idloop/mapping/1",
    "name": "two files",
    "joint": "m",
    "files": ["drive.csv", "encoder_80.csv"],
    "time": {"column": "encoder_80.ms", "unit": "ms"},
    "command": {"column": "drive.u", "unit": "V", "time": {"column": "drive.t"}},
    "position": {"compute": "encoder_80.b - encoder_80.a"},
}


def test_one_signal_per_file_is_joined_by_time(tmp_path):
    mapping = parse_mapping(JOINED, "two.yaml")
    result = import_bag(_clocks(tmp_path), tmp_path / "b", mapping)
    assert (result.samples, result.period) == (80, pytest.approx(0.005))
    streams = read_streams(tmp_path / "b")
    assert streams["/joint_command"].stamp_ns[0] - streams["/joint_states"].stamp_ns[0] == -2_000_000
    np.testing.assert_array_equal(streams["/joint_states"].columns()["m.position"], np.arange(80.0))
    with pytest.raises(InputError, match=r"joins drive\.csv, encoder_80\.csv; give the folder"):
        import_bag(tmp_path / "run" / "drive.csv", tmp_path / "c", mapping)


def test_a_part_between_two_times_begins_with_the_command_that_holds_there(tmp_path):
    mapping = parse_mapping(JOINED | {"times": {"start": 0.105, "stop": 0.2}}, "two.yaml")
    import_bag(_clocks(tmp_path), tmp_path / "b", mapping)
    streams = read_streams(tmp_path / "b")
    np.testing.assert_array_equal(streams["/joint_states"].columns()["m.position"], np.arange(21.0, 40.0))
    assert streams["/joint_command"].stamp_ns[0] < streams["/joint_states"].stamp_ns[0]
    assert streams["/joint_command"].stamp_ns.size == 5


@pytest.mark.parametrize("command", [{"value": 80.0}, {"file_name": r"_(\d+)\.", "unit": "%"}])
def test_a_constant_command_is_given_or_stands_in_the_name_of_the_file(tmp_path, command):
    mapping = {"schema": "idloop/mapping/1", "name": "steps", "joint": "m", "time": {"column": "ms", "unit": "ms"},
               "command": command, "position": {"column": "a"}}  # fmt: skip
    import_bag(_clocks(tmp_path) / "encoder_80.csv", tmp_path / "b", parse_mapping(mapping, "steps.yaml"))
    values = read_streams(tmp_path / "b")["/joint_command"].columns()["m.effort"]
    np.testing.assert_allclose(values, 80.0 if "value" in command else 0.8)


def test_stamps_by_a_formula(tmp_path):
    source = _csv(tmp_path, tick=np.arange(40) * 5, u=np.arange(40) % 3, y=np.arange(40) * 0.1)
    import_bag(source, tmp_path / "bag", _mapping(time={"compute": "tick / 1000"}, rows={"start": 10, "stop": 30}))
    stamps = read_streams(tmp_path / "bag")["/joint_states"].stamp_ns
    np.testing.assert_array_equal(np.diff(stamps), np.full(19, 5_000_000))
    with pytest.raises(InputError, match="'tick / 0' is not a number in row 0"):
        import_bag(source, tmp_path / "other", _mapping(time={"compute": "tick / 0"}))


@pytest.mark.parametrize(("unit", "first"), [("s", 1_700_000_000.5), ("ms", 1_700_000_000_500.0), ("s", 0.5)])
def test_even_dates_stay_even(tmp_path, unit, first):
    """Double precision keeps the microseconds of a date, and no part of them."""
    k = np.arange(50)
    source = _csv(tmp_path, t=[f"{first + {'s': 0.01, 'ms': 10.0}[unit] * one:.6f}" for one in k], u=k % 7, y=k % 11)
    import_bag(source, tmp_path / "bag", _mapping(time={"column": "t", "unit": unit}))
    for stream in read_streams(tmp_path / "bag").values():
        assert set(np.diff(stream.stamp_ns).tolist()) == {10_000_000}
