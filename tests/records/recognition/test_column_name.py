"""Words, units and indices of column names as logs write them."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from idloop.records.recognition.column_name import parse_column_name
from idloop.records.recognition.roles import role_by_name

NAMES = {
    "time_ms": (("time",), "ms", ""),
    "Time [ms]": (("time",), "ms", ""),
    "Motor Optical Speed (RPM)": (("motor", "optical", "speed"), "rpm", ""),
    "Servo 3 (µs)": (("servo",), "us", "3"),
    "motorSpeed_rad_s": (("motor", "speed"), "rad/s", ""),
    "target pos (1)": (("target", "pos"), "", "1"),
    "Drehzahl in 1/min": (("drehzahl",), "rpm", ""),
    "n / rpm": (("n",), "rpm", ""),
    "/joint_states/shoulder/position": (("shoulder", "position"), "", ""),
    "id.u": (("u",), "", ""),
    "log.motor speed.Data": (("log", "motor", "speed"), "", ""),
    "servo pulse": (("servo", "pulse"), "", ""),
    "enc pulses": (("enc",), "counts", ""),
    "log.y[0]": (("log", "y"), "", "0"),
    "Position actual value [inc]": (("position", "actual", "value"), "counts", ""),
    "encoder(steps)": (("encoder",), "counts", ""),
    "u [V]": (("u",), "V", ""),
    "current_mA": (("current",), "mA", ""),
    "iq_setpoint": (("iq", "setpoint"), "", ""),
    "rps": (("rps",), "rev/s", ""),
    "theta_dot": (("theta", "dot"), "", ""),
    "x_m": (("x",), "m", ""),
    "stroke_in": (("stroke",), "in", ""),
    "[a1 velocity [rad/s]": (("a", "velocity"), "rad/s", "1"),
    "position [rad": (("position",), "rad", ""),
    "velocity] rad/s]": (("velocity",), "rad/s", ""),
    "t_ff": (("torque", "ff"), "", ""),
    "current_A": (("current",), "A", ""),
    "motor_V": (("motor",), "V", ""),
    "encoder_V": (("encoder",), "V", ""),
    "tacho_V": (("tacho",), "V", ""),
    "motor_cmd_v": (("motor", "cmd"), "V", ""),
    "cmd_voltage_v": (("cmd", "voltage"), "V", ""),
    "bus_v": (("bus",), "V", ""),
    # A unit without a separator.
    "yrad": (("y",), "rad", ""),
    "motor thetadeg": (("motor", "theta"), "deg", ""),
    "posmm": (("pos",), "mm", ""),
    "wrads": (("w",), "rad/s", ""),
    "vmms_2": (("v",), "mm/s", "2"),
    "omegarpm": (("omega",), "rpm", ""),
    "enccounts": (("enc",), "counts", ""),
    "uV": (("u",), "V", ""),
    # ... and what only looks like one.
    "vin": (("vin",), "", ""),
    "yrot": (("yrot",), "", ""),
    "num": (("num",), "", ""),
    "xin": (("xin",), "", ""),
    # Velocities of a vehicle, of a joint and of a motor.
    "cmd_v": (("cmd", "v"), "", ""),
    "joint_v": (("joint", "v"), "", ""),
    "motor_v": (("motor", "v"), "", ""),
    "motorcurrent": (("motor", "current"), "", ""),
    "Speed (actual) [rpm]": (("speed", "actual"), "rpm", ""),
    "Drehzahl (Soll)": (("drehzahl", "soll"), "", ""),
    "iq*": (("iq", "setpoint"), "", ""),
    "n* [rpm]": (("n", "setpoint"), "rpm", ""),
    "targetvel": (("target", "vel"), "", ""),
    "positionref": (("position", "ref"), "", ""),
    "motorPwm": (("motor", "pwm"), "", ""),
    "overcurrent": (("overcurrent",), "", ""),
    # Input, motor and phase, but no inches, metres and amperes.
    "current_in": (("current", "in"), "", ""),
    "motor_in": (("motor", "in"), "", ""),
    "theta_m": (("theta", "m"), "", ""),
    "omega_m": (("omega", "m"), "", ""),
    "voltage_A": (("voltage", "a"), "", ""),
    "M_soll_%": (("m", "soll"), "%", ""),
    "iq_%": (("iq",), "%", ""),
    "Winkel_°": (("winkel",), "deg", ""),
    "Drehzahl_°/s": (("drehzahl",), "deg/s", ""),
    # German compounds: set-point and measured before or behind the quantity.
    "Sollposition": (("soll", "position"), "", ""),
    "Istdrehzahl [1/min]": (("ist", "drehzahl"), "rpm", ""),
    "Lageistwert [mm]": (("lage", "istwert"), "mm", ""),
    "Positionssollwert": (("position", "sollwert"), "", ""),
    "Motorsolldrehzahl": (("motor", "soll", "drehzahl"), "", ""),
    "MOTORSTROM": (("motor", "strom"), "", ""),
    "Versorgungsspannung": (("versorgung", "spannung"), "", ""),
    "Winkelbeschleunigung": (("winkelbeschleunigung",), "", ""),
    "Posición medida": (("posicion", "medida"), "", ""),
    "Vitesse mesurée [tr/min]": (("vitesse", "mesuree"), "rpm", ""),
    "Führungsgröße": (("führungsgröße",), "", ""),
    # The number of a joint behind a unit; of a single letter it is a part.
    "Enc Speed RPM 1": (("enc", "speed"), "rpm", "1"),
    "torque_Nm_2": (("torque",), "N·m", "2"),
    "AIPos.A1": (("ai", "pos", "a"), "", "1"),
    # Feedback and reference, as controllers of motion abbreviate.
    "FPOS(0)": (("feedback", "pos"), "", "0"),
    "RVEL(0)": (("reference", "vel"), "", "0"),
    # What a device says of itself is not what stands around it; one of several states may be of a joint.
    "servo_stats.mode": (("mode",), "", ""),
    "observation.state[2]": (("observation", "state"), "", "2"),
}


@pytest.mark.parametrize("name", NAMES)
def test_names(name):
    parsed = parse_column_name(name)
    assert (parsed.words, parsed.unit, parsed.index) == NAMES[name]


def test_a_unit_below_the_header_counts_and_case_tells_letters_apart():
    assert parse_column_name("speed", "[RPM]").unit == "rpm"
    assert (parse_column_name("V").letter, parse_column_name("v").letter) == ("V", "v")
    assert parse_column_name("v").unit == ""
    assert (parse_column_name("M_soll").letter, parse_column_name("V_bus").letter) == ("M", "")


@pytest.mark.parametrize(
    ("name", "role"), [("T_cmd(Nm)", "command"), ("T [Nm]", "command"), ("T_meas_Nm", "effort"), ("T [s]", "time")]
)
def test_a_letter_of_time_with_the_unit_of_a_torque_is_a_torque(name, role):
    assert role_by_name(parse_column_name(name)).role == role


@given(st.text(max_size=40), st.text(max_size=10))
def test_any_name_is_taken_apart(name, unit):
    parsed = parse_column_name(name, unit)
    assert all(word == word.lower() for word in parsed.words)


@pytest.mark.parametrize(
    ("name", "role"),
    [
        ("q7_tau_J_compensate", "command"), ("force_x", "command"), ("theta torque", "command"), ("q7", "position"),
        ("load_position", "position"), ("torque_position", "position"), ("z [mm]", "position"),
    ],
)  # fmt: skip
def test_a_coordinate_beside_a_force_says_of_what_it_is_one(name, role):
    assert role_by_name(parse_column_name(name)).role == role


def test_the_current_of_a_motor_is_the_command_before_that_from_the_supply():
    rank = {
        name: role_by_name(parse_column_name(name)).rank for name in ("avgMotorCurrent", "avgInputCurrent", "input")
    }
    assert rank["input"] > rank["avgMotorCurrent"] > rank["avgInputCurrent"] > 0.0


def test_the_reason_names_the_quantity_beside_what_was_measured():
    assert role_by_name(parse_column_name("est_tau")).reason == "by its name (est tau)"
    assert role_by_name(parse_column_name("Actual Torque")).reason == "by its name (actual torque)"


@pytest.mark.parametrize("name", ["episode_index", "task_index", "trial"])
def test_the_number_of_a_run_is_no_signal(name):
    assert role_by_name(parse_column_name(name)).role == "other"
