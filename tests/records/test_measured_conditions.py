"""Conditions measured beside the axis: from tables and foreign bags, through cuts and bags written anew."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from idloop.errors import InputError
from idloop.estimation.dataset import common_conditions, prepare
from idloop.physics import Condition, load_model
from idloop.physics.model import ConditionSource
from idloop.records import Record, inspect_bag, read_record, write_bag
from idloop.records.tables.importing import import_bag
from idloop.records.tables.mapping import parse_mapping

WARM = Condition("temperature", "°C", np.array([-1.0, 0.4, 1.1, 2.5]), np.array([20.0, 21.5, 24.0, 26.0]))
VOLTS = Condition("supply", "V", np.arange(20) / 10.0, 24.0 - np.arange(20) / 40.0)


@pytest.fixture
def beside(record: Record) -> Record:
    return replace(record, conditions=(WARM, VOLTS))


def test_a_bag_written_anew_holds_the_same_conditions(tmp_path: Path, beside: Record, model: object) -> None:
    again = read_record(write_bag(tmp_path / "bag", beside), model)
    assert [(one.name, one.unit) for one in again.conditions] == [("temperature", "°C"), ("supply", "V")]
    for one, other in zip(beside.conditions, again.conditions, strict=True):
        np.testing.assert_allclose(other.time, one.time, atol=1e-9)
        np.testing.assert_array_equal(other.value, one.value)


def test_processing_keeps_conditions(beside: Record) -> None:
    part = beside.cut(0.5, 1.0)
    inside = np.linspace(0.5, 1.0, 11)
    for one, whole in zip(part.conditions, beside.conditions, strict=True):
        np.testing.assert_allclose(one.at(inside), whole.at(inside), atol=1e-12)
    assert part.conditions[1].time.size < VOLTS.time.size
    for other in (beside.resample(0.002), beside.decimate(2), beside.filtered(None, 50.0), beside.detrend()):
        assert other.conditions == beside.conditions


def test_inspection_shows_conditions_apart_from_the_measured_signals(tmp_path: Path, beside: Record) -> None:
    found = inspect_bag(write_bag(tmp_path / "bag", beside))
    assert list(found.signals) == ["/joint_states"]
    warm = found.conditions["temperature"]
    assert (warm.unit, warm.count, warm.minimum, warm.maximum) == ("°C", 4, 20.0, 26.0)
    assert found.to_dict()["conditions"]["supply"]["count"] == 20
    assert not found.findings


def table(folder: Path) -> Path:
    """A log whose temperature is logged at every fifth row."""
    rows = [f"{0.01 * k:.2f},{(-1) ** (k // 10)},{0.1 * k:.3f},{20 + 0.2 * k if k % 5 == 0 else ''},{24000 - 10 * k}"
            for k in range(60)]  # fmt: skip
    path = folder / "log.csv"
    path.write_text("t,u,angle,T,mV\n" + "\n".join(rows) + "\n", encoding="utf-8")
    return path


def mapping(**conditions: object) -> object:
    return parse_mapping(
        {
            "schema": "idloop/mapping/1", "name": "warm", "joint": "motor", "time": {"column": "t"},
            "command": {"column": "u", "unit": "V"}, "position": {"column": "angle", "unit": "rad"},
            "conditions": conditions,
        },
        "warm.yaml",
    )  # fmt: skip


def test_a_table_gives_conditions(tmp_path: Path) -> None:
    both = mapping(temperature={"column": "T", "unit": "°C"}, supply={"column": "mV", "unit": "mV"})
    imported = import_bag(table(tmp_path), tmp_path / "bag", both)
    assert imported.channels["conditions temperature.position"] == "°C"
    assert not [one for one in imported.findings if "conditions" in one.text]
    warm, volts = read_record(tmp_path / "bag", plain()).conditions
    assert (warm.name, warm.unit, warm.time.size) == ("temperature", "°C", 12)
    np.testing.assert_allclose(warm.at(np.array([0.25])), 25.0)
    np.testing.assert_allclose(volts.value, 24.0 - 0.01 * np.arange(60))
    assert volts.unit == "V"


def plain():
    """A motor whose position is measured."""
    model = load_model("dc_motor")
    return replace(model, outputs=model.outputs[:1])


def test_a_bare_column_is_a_condition_of_no_unit(tmp_path: Path) -> None:
    import_bag(table(tmp_path), tmp_path / "bag", mapping(temperature="T"))
    (warm,) = read_record(tmp_path / "bag", plain()).conditions
    assert warm.unit == ""


@pytest.mark.parametrize(
    ("entry", "line"),
    [
        ({"column": "T", "unit": "K"}, "conditions temperature: unknown unit 'K'"),
        ({"column": "T", "unit": "rad/s"}, "rad/s is not a unit of a condition; known are V, mV"),
        ({"column": "Tm"}, "Tm"),
    ],
)
def test_a_wrong_condition_of_a_mapping_is_one_line(tmp_path: Path, entry: dict[str, str], line: str) -> None:
    with pytest.raises(InputError, match=line):
        import_bag(table(tmp_path), tmp_path / "bag", mapping(temperature=entry))


def test_an_unknown_key_of_a_condition_is_named() -> None:
    with pytest.raises(InputError, match=r"unknown key conditions\.temperature\.colum"):
        mapping(temperature={"colum": "T"})


@pytest.fixture
def robot(tmp_path: Path, record: Record) -> Path:
    """A bag with a thermometer [°C], a battery, and a bare number in kelvins."""
    from rosbags.rosbag2 import Reader, StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    types = store.types
    ours = write_bag(tmp_path / "ours", record)

    def header(at: int) -> object:
        stamp = types["builtin_interfaces/msg/Time"](at // 10**9, at % 10**9)
        return types["std_msgs/msg/Header"](stamp, "")

    path = tmp_path / "robot"
    with Reader(ours) as source, Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        joints = {one.topic: bag.add_connection(one.topic, one.msgtype, typestore=store) for one in source.connections}
        for connection, at, raw in source.messages():
            bag.write(joints[connection.topic], at, raw)
        kinds = ("sensor_msgs/msg/Temperature", "sensor_msgs/msg/BatteryState", "std_msgs/msg/Float64")
        names = ("/motor/temperature", "/battery", "/gearbox")
        topics = [bag.add_connection(*pair, typestore=store) for pair in zip(names, kinds, strict=True)]
        for k in range(20):
            at = record.start_ns + 100_000_000 * k
            nothing = np.zeros(0, dtype=np.float32)
            messages = (
                types[kinds[0]](header(at), 20.0 + k, 0.0),
                types[kinds[1]](header(at), 24.0 - 0.1 * k, *[0.0] * 6, 0, 0, 0, True, nothing, nothing, "", ""),
                types[kinds[2]](300.0 + k),
            )
            for topic, kind, message in zip(topics, kinds, messages, strict=True):
                bag.write(topic, at, store.serialize_cdr(message, kind))
    return path


NAMED = (
    ConditionSource("motor.temperature", "motor/temperature", "", "temperature", "°C"),
    ConditionSource("supply", "battery", "", "voltage", "V"),
    ConditionSource("gearbox.temperature", "gearbox", "", "", "°C", offset=-273.15),
    ConditionSource("humidity", "humidity", "", "relative_humidity", "-"),
)


def test_a_model_names_the_topics_of_a_robot(robot: Path) -> None:
    found = {one.name: one for one in read_record(robot, replace(load_model("dc_motor"), conditions=NAMED)).conditions}
    assert list(found) == ["motor.temperature", "supply", "gearbox.temperature"]
    np.testing.assert_allclose(found["motor.temperature"].value, 20.0 + np.arange(20))
    np.testing.assert_allclose(found["supply"].value, 24.0 - 0.1 * np.arange(20), rtol=1e-6)
    np.testing.assert_allclose(found["gearbox.temperature"].value, 26.85 + np.arange(20))
    np.testing.assert_allclose(found["supply"].time, 0.1 * np.arange(20), atol=1e-9)


def test_a_field_that_is_not_there_is_named(robot: Path) -> None:
    wrong = (replace(NAMED[1], field="volts"),)
    with pytest.raises(InputError, match="no field 'volts'"):
        read_record(robot, replace(load_model("dc_motor"), conditions=wrong))


def test_a_model_file_keeps_what_it_says_of_conditions() -> None:
    from idloop.physics.model_file import from_text

    model = replace(load_model("dc_motor"), conditions=NAMED)
    assert from_text(model.to_yaml(), None).conditions == NAMED
    twice = model.to_yaml().replace("name: supply", "name: humidity")
    with pytest.raises(InputError, match="conditions: 'humidity' is there twice"):
        from_text(twice, None)
    with pytest.raises(InputError, match=r"unknown key 'conditions\[0\].feld'"):
        from_text(model.to_yaml().replace("field: temperature", "feld: temperature"), None)


def test_conditions_of_another_time_are_left_out_with_a_line(tmp_path: Path, beside: Record, model: object) -> None:
    late = replace(WARM, time=WARM.time + 1000.0)
    again = read_record(write_bag(tmp_path / "bag", replace(beside, conditions=(late,))), model)
    assert again.conditions == ()
    assert [one.kind for one in again.findings] == ["two_clocks"]


def test_a_model_that_needs_a_condition_says_so(beside: Record) -> None:
    model = load_model("dc_motor").with_effect("thermal_viscosity", "motor", coefficient=-0.01)
    (data,) = prepare(model, [beside])
    assert common_conditions([data]) == {"supply": "V", "temperature": "°C"}
    with pytest.raises(InputError, match="holds no condition 'temperature', which thermal_viscosity@motor depends on"):
        prepare(model, [replace(beside, conditions=(VOLTS,))])
    kelvin = replace(WARM, unit="K")
    with pytest.raises(InputError, match="is in K, and thermal_viscosity@motor takes it in °C"):
        prepare(model, [replace(beside, conditions=(kelvin,))])
    assert common_conditions([data, *prepare(load_model("dc_motor"), [replace(beside, conditions=(VOLTS,))])]) == {
        "supply": "V"
    }
