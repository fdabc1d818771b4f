"""Columns of known drives: each figure has a source, and the right drive is recognised."""

from __future__ import annotations

import pytest

from idloop.records.formats.known_columns import known_columns, plain_name, recognise
from idloop.records.tables.base_units import known_unit

LOGS = {
    "ODrive": [
        "t",
        "axis0.encoder.pos_estimate",
        "axis0.encoder.vel_estimate",
        "axis0.motor.current_control.Iq_setpoint",
    ],
    "moteus": ["time", "position", "velocity", "torque", "q_current", "voltage"],
    "VESC": ["ms_today", "input_voltage", "temp_motor", "current_motor", "erpm", "duty_cycle", "tachometer"],
    "Dynamixel X": ["time", "Present Position", "Present Velocity", "Present Current", "Goal PWM"],
    "Dynamixel AX": ["time", "Goal Position", "Moving Speed", "Present Position", "Present Speed", "Present Load"],
    "Feetech STS": ["timestamp", "Present_Position", "Present_Velocity", "Present_Load", "Present_Current"],
    "Pololu Jrk": ["Time (ms)", "Input", "Target", "Feedback", "Scaled feedback", "Duty cycle target", "Duty cycle"],
    "RCbenchmark": ["Time (s)", "ESC signal (µs)", "Torque (N·m)", "Thrust (N)", "Motor Optical Speed (RPM)"],
}


@pytest.mark.parametrize("device", LOGS)
def test_logs_of_drives(device):
    found = recognise(LOGS[device])
    assert found is not None
    assert found.device == device
    roles = {column.role for column in found.known(LOGS[device]).values()}
    assert {"position", "velocity"} & roles
    assert {"command", "effort"} & roles


def test_each_drive_is_tested():
    assert {one.device for one in known_columns()} == set(LOGS)


@pytest.mark.parametrize(
    "columns", [["t", "u", "position"], ["time", "position", "velocity", "torque"], ["present_position"], []]
)
def test_other_logs(columns):
    assert recognise(columns) is None


def test_units_are_those_of_a_mapping_and_times():
    for device in known_columns():
        assert device.source
        for name, column in device.columns.items():
            assert name == plain_name(name)
            if column.role == "time":
                assert column.unit in {"s", "ms", "us", "ns"}
            else:
                assert known_unit(column.unit), (device.device, name)


def test_figures_of_the_manuals():
    dynamixel = recognise(LOGS["Dynamixel X"])
    assert dynamixel.columns["present_position"].scale * 4096 == pytest.approx(1.0)
    assert dynamixel.columns["goal_pwm"].scale * 885 == pytest.approx(100.0)
    vesc = recognise(LOGS["VESC"])
    assert vesc.columns["erpm"].divide_by == vesc.columns["tachometer"].divide_by == "pole pairs"
    assert vesc.columns["tachometer"].scale * 6 == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("name", "plain"),
    [("axis0/encoder.pos_estimate", "pos_estimate"), ("Motor Optical Speed (RPM)", "motor optical speed"),
     ("Present Position 2", "present_position"), ("present-velocity", "present_velocity"), ("Speed", "speed")],
)  # fmt: skip
def test_names(name, plain):
    assert plain_name(name) == plain
