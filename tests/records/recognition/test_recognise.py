"""What the columns of logs are, from their names, their units and their values."""

from __future__ import annotations

import re
import shlex
from math import pi
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from ruamel.yaml import YAML

from idloop.errors import InputError
from idloop.records.recognition.guess import Given
from idloop.records.recognition.mapping_file import mapping_of, text_of
from idloop.records.recognition.recognise import recognise_table, shown_together
from idloop.records.tables.mapping import parse_mapping
from idloop.records.tables.table import Table

T = np.arange(3000) * 0.005
U = np.sign(np.sin(3.0 * T)) * (1.0 + (T % 5.0 > 2.5))


def _motion():
    """Angle and speed of an axis with inertia and friction under the command."""
    speed = np.zeros(T.size)
    for k in range(T.size - 1):
        speed[k + 1] = speed[k] + 0.005 * (20.0 * U[k] - 4.0 * speed[k])
    return np.cumsum(speed) * 0.005, speed


ANGLE, SPEED = _motion()
NOISE = np.random.default_rng(1).normal(size=(2, T.size)) * 1e-3


def _roles(columns, **options):
    found = recognise_table(Table(Path("log.csv"), columns), **options)
    return {one.role: (one.column, one.unit) for one in found.guesses}, found


LOGS = {
    "letters": (
        {"t": T, "tau": U, "q": ANGLE, "qd": SPEED},
        {"command": ("tau", "N·m"), "position": ("q", "rad"), "velocity": ("qd", "rad/s")},
    ),
    "v beside V": (
        {"t": T, "V": U, "x": ANGLE, "v": SPEED},
        {"command": ("V", "V"), "position": ("x", "m"), "velocity": ("v", "m/s")},
    ),
    "units in brackets": (
        {
            "Time [ms]": 1e3 * T,
            "Current [mA]": 1e3 * U,
            "Angle [deg]": np.degrees(ANGLE),
            "Speed [rpm]": SPEED * 30 / pi,
        },
        {"command": ("Current [mA]", "mA"), "position": ("Angle [deg]", "deg"), "velocity": ("Speed [rpm]", "rpm")},
    ),
    "rpm without a unit": (
        {"t": T, "pwm": 100 * U, "angle_deg": np.degrees(ANGLE), "speed": SPEED * 30 / pi},
        {"command": ("pwm", "-"), "position": ("angle_deg", "deg"), "velocity": ("speed", "rpm")},
    ),
    "set-points beside measurements": (
        {"t": T, "target_position": ANGLE + 0.1, "position": ANGLE, "current_setpoint": U, "current_measured": 0.9 * U},
        {
            "command": ("current_setpoint", "A"),
            "position": ("position", "rad"),
            "effort": ("current_measured", "A"),
            "reference": ("target_position", "rad"),
        },
    ),
    "an encoder that starts again": (
        {"t": T, "u": U, "enc": np.round(np.mod(ANGLE * 4096 / 2 / pi, 4096))},
        {"command": ("u", "-"), "position": ("enc", "rad")},
    ),
    "no names at all": (
        {"0": T, "1": U, "2": ANGLE},
        {"command": ("1", "-"), "position": ("2", "rad")},
    ),
    "a measured force alone": (
        {"t": T, "torque actual value": U, "velocity actual value": SPEED},
        {"command": ("torque actual value", "N·m"), "velocity": ("velocity actual value", "rad/s")},
    ),
    "German compounds": (
        {
            "Zeit": T,
            "Drehzahlsollwert": SPEED + 0.1,
            "Drehzahlistwert": SPEED,
            "Sollmoment": U,
            "Drehzahlfehler": 0.1 - U,
        },
        {
            "command": ("Sollmoment", "N·m"),
            "velocity": ("Drehzahlistwert", "rad/s"),
            "reference velocity": ("Drehzahlsollwert", "rad/s"),
        },
    ),
    "set-points in French": (
        {"Temps": T, "Consigne position": ANGLE + 0.1, "Position mesurée": ANGLE, "Consigne courant": U},
        {
            "command": ("Consigne courant", "A"),
            "position": ("Position mesurée", "rad"),
            "reference": ("Consigne position", "rad"),
        },
    ),
    "set-points in Spanish": (
        {"Tiempo": T, "Velocidad consigna": SPEED + 0.1, "Velocidad medida": SPEED, "Corriente consigna": U},
        {
            "command": ("Corriente consigna", "A"),
            "velocity": ("Velocidad medida", "rad/s"),
            "reference velocity": ("Velocidad consigna", "rad/s"),
        },
    ),
    "set and actual in brackets": (
        {"t": T, "Speed (set) [rad/s]": SPEED + 0.1, "Speed (actual) [rad/s]": SPEED, "set current": U, "current": U},
        {
            "command": ("set current", "A"),
            "velocity": ("Speed (actual) [rad/s]", "rad/s"),
            "effort": ("current", "A"),
            "reference velocity": ("Speed (set) [rad/s]", "rad/s"),
        },
    ),
    "the letters of a cascade": (
        {"Zeit_ms": 1e3 * T, "M_soll_%": U, "M_ist_%": 0.9 * U, "n_soll_1/min": 0 * T, "n_ist_1/min": SPEED * 30 / pi},
        {"command": ("M_soll_%", "%"), "velocity": ("n_ist_1/min", "rpm"), "effort": ("M_ist_%", "%")},
    ),
    "a voltage by its unit in small letters": (
        {"t": T, "motor_cmd_v": U, "position_rad": ANGLE, "velocity_rad_s": SPEED, "bus_v": 12 + 0 * T},
        {
            "command": ("motor_cmd_v", "V"),
            "position": ("position_rad", "rad"),
            "velocity": ("velocity_rad_s", "rad/s"),
            "supply": ("bus_v", "V"),
        },
    ),
    "a speed of rotation beside a force": (
        {"t": T, "F_0": U, "N1_0": SPEED},
        {"command": ("F_0", "N"), "velocity": ("N1_0", "rad/s")},
    ),
    "temperature and supply": (
        {"t": T, "duty": U, "angle": ANGLE, "motor_temp": 20 + T, "vbus": 12 + 0 * T, "error": 0 * T},
        {
            "command": ("duty", "-"),
            "position": ("angle", "rad"),
            "temperature": ("motor_temp", ""),
            "supply": ("vbus", ""),
        },
    ),
}


@pytest.mark.parametrize("name", LOGS)
def test_roles_and_units(name):
    columns, expected = LOGS[name]
    roles, found = _roles(columns)
    assert roles == expected
    assert all(one.reason for one in found.guesses)


def test_what_no_header_says_is_marked():
    _, found = _roles({"t": T, "u": U, "y": ANGLE})
    doubts = " ".join(found.all_doubts())
    assert "the unit of the command is not known" in doubts
    assert "the unit of the position is not written down and taken as rad" in doubts
    _, sure = _roles({"t [s]": T, "u [V]": U, "y [rad]": ANGLE})
    assert sure.all_doubts() == []


def test_a_velocity_of_the_wrong_sign_is_turned_and_said():
    _, found = _roles({"t": T, "u [V]": U, "angle [rad]": ANGLE, "speed [rad/s]": -SPEED})
    assert found.of("velocity").options == {"scale": -1.0}
    assert any("opposite signs" in one for one in found.all_doubts())


def test_a_velocity_that_never_moves_is_left_out():
    roles, found = _roles({"t": T, "u": U, "angle": ANGLE, "speed": 0 * T})
    assert "velocity" not in roles
    assert found.other == ("speed",)


def test_a_wrap_of_an_encoder_gives_the_size_of_a_count():
    for name in ("enc [counts]", "enc", "phi"):
        _, found = _roles({"t": T, "u": U, name: np.round(np.mod(ANGLE * 4096 / 2 / pi, 4096))})
        assert found.of("position").options["scale"] == 2 * pi / 4096
    assert found.of("position").options == {"scale": 2 * pi / 4096, "wrap": 2 * pi}
    assert any("4096 counts are taken as one turn" in one for one in found.all_doubts())


def test_of_several_joints_the_one_that_moves_is_taken():
    still = 1e-5 * NOISE[0]
    columns = {"t": T}
    for k, (angle, command) in enumerate([(still, 0 * U), (ANGLE, U), (still, 0 * U)], 1):
        columns |= {f"q{k}": angle, f"tau{k}": command}
    roles, found = _roles(columns)
    assert roles["position"][0] == "q2"
    assert roles["command"][0] == "tau2"
    assert any("3 joints" in one for one in found.all_doubts())
    assert _roles(columns, given={"position": Given("q3")})[0]["position"][0] == "q3"


def test_the_joint_that_moves_most_has_the_longest_path_beside_noise():
    swing = np.sin(T)
    columns = {"t": T, "u": U}
    columns |= {"q1": 0.5 * NOISE[0] * 1e3, "q2": swing + NOISE[1], "q3": 0.01 * swing, "q4": np.where(T > 7, 1.2, 0.0)}
    roles, found = _roles(columns)
    assert roles["position"][0] == "q2"
    assert "as in --position q1" in " ".join(found.all_doubts())
    mixed = {"t": T, "u": U, "q1 [deg]": np.degrees(0.1 * swing), "q2 [rad]": swing}
    assert _roles(mixed)[0]["position"][0] == "q2 [rad]"


def test_a_joint_that_was_commanded_is_taken_before_one_that_it_drives():
    one = {"a1 position [rad]": ANGLE, "a1 torque [Nm]": 0.9 * U}
    two = {"a2 position [rad]": -1.1 * ANGLE, "a2 torque [Nm]": 0.7 * U}
    roles, found = _roles({"t": T, "a1 torque cmd [Nm]": U, **one, **two})
    assert (roles["command"][0], roles["position"][0]) == ("a1 torque cmd [Nm]", "a1 position [rad]")
    assert any("joint 1, the one with a command, is taken" in doubt for doubt in found.all_doubts())
    # A command of zero throughout is none; where every joint has one, the motion decides.
    commands = {"a1 torque cmd [Nm]": U, "a2 torque cmd [Nm]": 0.0 * U}
    assert _roles({"t": T, **commands, **one, **two})[0]["command"][0] == "a1 torque cmd [Nm]"
    commands["a2 torque cmd [Nm]"] = -U
    assert _roles({"t": T, **commands, **one, **two})[0]["command"][0] == "a2 torque cmd [Nm]"


SUPPLY = 12.3 + np.abs(NOISE[0])


@pytest.mark.parametrize("name", ["input_volts", "Input Voltage [V]", "bus voltage", "battery [V]", "Vin"])
def test_a_supply_is_never_the_command(name):
    motion = {"t": T, "position": ANGLE, "speed": SPEED}
    roles, _ = _roles({**motion, name: SUPPLY, "load": U})
    assert (roles["supply"][0], roles["command"][0]) == (name, "load")
    roles, _ = _roles({**motion, name: SUPPLY, "goal_position": ANGLE + 0.1, "torque_enable": np.sign(T)})
    assert (roles["supply"][0], roles["command"][0]) == (name, "goal_position")


def test_a_set_point_alone_is_the_command_of_a_loop_in_the_drive():
    roles, found = _roles({"t": T, "target_position": np.degrees(ANGLE), "position [deg]": np.degrees(ANGLE)})
    assert roles["command"] == ("target_position", "deg")
    assert "reference" not in roles
    assert any("the set-point 'target_position' is taken as the command" in one for one in found.all_doubts())
    roles, _ = _roles({"t": T, "target_position": ANGLE, "i [A]": U, "position": ANGLE})
    assert (roles["command"][0], roles["reference"][0]) == ("i [A]", "target_position")


def test_a_voltage_to_the_motor_is_the_command_and_doubted_where_it_hardly_varies():
    roles, found = _roles({"t": T, "input_volts": U, "angle": ANGLE})
    assert roles["command"][0] == "input_volts"
    assert not any("hardly varies" in one for one in found.all_doubts())
    _, found = _roles({"t": T, "voltage": SUPPLY, "angle": ANGLE})
    assert any("'voltage' hardly varies: if it is the supply" in one for one in found.all_doubts())
    _, found = _roles({"t": T, "load": 0 * T, "angle": ANGLE})
    assert any("'load' is zero throughout" in one for one in found.all_doubts())


@pytest.mark.parametrize(
    ("across", "along"), [("i_q", "i_d"), ("Iq [A]", "Id [A]"), ("q-axis current", "d-axis current"), ("u_q", "u_d")]
)
def test_across_the_field_the_torque_is_made(across, along):
    roles, found = _roles({"t": T, along: 0.1 * U, across: U, "theta": ANGLE})
    assert (roles["command"][0], roles["position"][0]) == (across, "theta")
    assert found.other == (along,)
    assert not any("could be meant" in one for one in found.all_doubts())


@pytest.mark.parametrize(
    "name", ["Following Error (rad)", "tracking error [deg]", "pos_deviation_rad", "Position lag", "Droop pulses"]
)
def test_an_error_is_no_position(name):
    columns = {"t": T, "u": U, name: 0.01 * ANGLE}
    assert _roles({**columns, "angle": ANGLE})[0]["position"][0] == "angle"
    with pytest.raises(InputError, match="no column is a position"):
        _roles(columns)


def test_large_whole_numbers_are_no_angles_in_rad():
    roles, found = _roles({"t": T, "u": U, "pos": np.round(2000 + 1000 * ANGLE)})
    assert roles["position"] == ("pos", "rad")
    assert any("'pos' holds large whole numbers, probably counts" in one for one in found.all_doubts())
    assert any("--position 'pos=counts/N'" in one for one in found.all_doubts())
    degrees = {"t": T, "u": U, "pos": np.round(np.degrees(100 * ANGLE)), "speed": 100 * SPEED * 30 / pi}
    assert _roles(degrees)[0]["position"] == ("pos", "deg")


def test_a_velocity_without_a_name_is_found_by_the_slope_of_the_position():
    for factor, unit in ((1.0, "rad/s"), (30 / pi, "rpm"), (-1.0, "rad/s")):
        roles, found = _roles({"t": T, "u": U, "angle [rad]": ANGLE + NOISE[0] * 0.1, "c": factor * SPEED, "d": T**2})
        assert roles["velocity"] == ("c", unit)
        assert found.of("velocity").options == ({"scale": -1.0} if factor < 0 else {})
        assert any("no name says what 'c' is" in one for one in found.all_doubts())
    _, found = _roles({"t": T, "u": U, "angle [rad]": ANGLE, "c": 23.4 * SPEED})
    assert found.of("velocity").options == {}
    assert any(
        "it is 23.4 times the slope of the position, which is no usual unit" in one for one in found.all_doubts()
    )
    roles, _ = _roles({"0": T, "1": U, "2": ANGLE, "3": SPEED})
    assert {role: one[0] for role, one in roles.items()} == {"command": "1", "position": "2", "velocity": "3"}
    assert "velocity" not in _roles({"t": T, "u": U, "angle": ANGLE, "c": U + NOISE[1]})[0]


@pytest.mark.parametrize("unit", ["rad", "deg"])
def test_a_velocity_that_is_left_out_still_doubts_the_sample_time(unit):
    angle = ANGLE if unit == "rad" else np.degrees(ANGLE)
    for factor, said in ((1.989, True), (1.0, False), (30 / pi, False), (180 / pi, False)):
        columns = {"t": T, "u": U, f"angle [{unit}]": angle, "speed": factor * SPEED}
        for left_out in ({}, {"velocity": Given("none")}):
            doubts = " | ".join(_roles(columns, given=left_out)[1].all_doubts())
            assert ("1.989 times the slope" in doubts) is said, (factor, left_out)
            assert ("the sample time is wrong by this factor" in doubts) is said


def test_a_velocity_that_is_the_travel_in_a_sample_is_said_with_the_formula_that_mends_it():
    columns = {"t": T, "u": U, "angle [rad]": ANGLE, "speed": 0.005 * SPEED}
    said = next(one for one in _roles(columns)[1].all_doubts() if "travels in a sample of 0.005 s" in one)
    formula, unit = said.partition("--velocity '")[2].rstrip("'").split("=")
    roles, again = _roles(columns, given={"velocity": Given(formula, unit)})
    assert roles["velocity"] == ("speed / 0.005", "rad/s")
    left_out = _roles(columns, given={"velocity": Given("none")})[1]
    for found in (again, left_out):
        assert not any("slope of the position" in one or "in a sample" in one for one in found.all_doubts())


def test_what_a_workspace_holds_beside_a_record_is_none_of_its_columns():
    settings = {"model.Input voltage": np.arange(36.0), "model.time": np.arange(36.0)}
    roles, _ = _roles(settings | {"u": U, "angle": ANGLE}, period=0.005)
    assert roles["command"][0] == "u"


def test_what_is_given_counts_before_any_guess():
    columns = {"t": T, "a": ANGLE, "b": 0.5 * ANGLE, "u": U}
    roles, found = _roles(columns, given={"position": Given("a + b", "deg"), "command": Given("u", "mA")})
    assert roles["position"] == ("a + b", "deg")
    assert found.of("position").options["compute"] == "a + b"
    assert roles["command"] == ("u", "mA")
    _, found = _roles(columns, given={"position": Given("a", "counts/4096")})
    assert found.of("position").options["scale"] == pytest.approx(2 * pi / 4096)
    roles, _ = _roles(columns | {"omega": SPEED}, given={"velocity": Given("none")})
    assert "velocity" not in roles


def test_a_command_in_the_name_of_the_file():
    found = recognise_table(Table(Path("runs/pwm_60.csv"), {"t": T, "rpm": SPEED}))
    assert found.of("command").options["file_name"] == r"pwm[_\- ]?(-?\d+(?:[.,]\d+)?)"
    found = recognise_table(Table(Path("step_12V.csv"), {"t": T, "rpm": SPEED}))
    assert found.of("command").unit == "V"


def test_a_digital_channel_is_no_command_beside_a_torque():
    flag = 2.5 * (SPEED > 0.0)
    roles, found = _roles({"t": T, "Analog 1 speed": SPEED, "Analog 2 Torque": U, "Digital 1 INP": flag})
    assert roles["command"][0] == "Analog 2 Torque"
    assert not [doubt for doubt in found.all_doubts() if "Digital 1 INP" in doubt]


def test_a_supply_is_not_offered_for_a_motion_that_stands_still():
    with pytest.raises(InputError) as caught:
        _roles({"t": T, "speed_rpm": 0.0 * T, "Voltage (V)": U})
    assert "nothing moves: speed_rpm never changes" in str(caught.value)
    assert "sensor in volts" not in str(caught.value)


BAD = {
    "no command": ({"t": T, "angle": ANGLE}, {}, "no column is a command"),
    "no motion": ({"t": T, "u": U, "motor_temp": T}, {}, "no column is a position or a velocity"),
    "a column that is not there": ({"t": T, "u": U, "y": ANGLE}, {"position": Given("angel")}, "no column 'angel'"),
    "a motion that stands still": (
        {"t": T, "velocity_rad_s": 5.0 + 0.0 * T, "current_a": U},
        {},
        "nothing moves: velocity_rad_s never changes",
    ),
    "a motion without values": (
        {"t": T, "u": U, "position": np.nan * T, "velocity": np.nan * T},
        {},
        "no motion was measured: position, velocity hold no values",
    ),
    "a sensor in volts": (
        {"time_s": T, "current_A": U, "encoder_V": SPEED, "duty_pct": U, "supply_V": 12 + 0.0 * T},
        {},
        "--position 'encoder_V * 0.5=rad'",
    ),
    "an unknown unit": ({"t": T, "u": U, "y": ANGLE}, {"position": Given("y", "parsec")}, "unknown unit 'parsec'"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_cannot_be_told_is_one_line(name):
    columns, given, words = BAD[name]
    with pytest.raises(InputError) as caught:
        _roles(columns, given=given)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


WORDS = ["t", "time", "u", "i", "V", "v", "q", "pos", "speed", "enc", "target", "temp", "rpm", "x", "0", "state", "Iq"]
UNITS = ["", " [ms]", "_deg", " (rpm)", " [V]", " [counts]", "_N", " in mm", "[0]", " (2)"]
VALUES = st.one_of(
    arrays(np.float64, 40, elements=st.floats(-1e9, 1e9) | st.just(float("nan"))),
    arrays(np.float64, 40, elements=st.sampled_from([0.0, 1.0, 65535.0, -1.0, float("nan"), float("inf")])),
    st.floats(1e-6, 1e6).map(lambda step: step * np.arange(40.0)),
    st.just([f"2025-01-01T00:00:{k:02d}" for k in range(40)]),
    st.just(["on"] * 40),
)


@settings(max_examples=60, deadline=None)
@given(
    st.dictionaries(
        st.builds(str.__add__, st.sampled_from(WORDS), st.sampled_from(UNITS)), VALUES, min_size=1, max_size=7
    ),
    st.dictionaries(
        st.sampled_from(["time", "command", "position", "velocity"]),
        st.builds(
            Given, st.sampled_from(["", *WORDS, "u + q", "12"]), st.sampled_from(["", "deg", "V", "counts/8", "s"])
        ),
        max_size=2,
    ),
)
def test_any_table_is_recognised_as_a_mapping_that_is_valid_or_refused(columns, said):
    try:
        found = recognise_table(Table(Path("log_7V.csv"), columns), said)
    except InputError:
        return
    content = mapping_of(found, "log", "axis")
    assert parse_mapping(YAML(typ="safe").load(text_of(content)), "mapping.yaml").joint == "axis"


def test_an_output_that_follows_the_command_is_a_velocity():
    roles, found = _roles({"t": T, "r": 2.0 * np.sign(U), "u": U, "y": SPEED})
    assert roles["velocity"][0] == "y"
    assert roles["reference velocity"][0] == "r"
    assert any("may be a position or a velocity" in doubt for doubt in found.all_doubts())


def test_a_position_that_follows_the_command_may_be_a_velocity():
    for column, doubted in ((SPEED, True), (ANGLE, False)):
        roles, found = _roles({"t": T, "pwm": U, "enc": column})
        assert roles["position"][0] == "enc"
        assert any("--velocity enc" in doubt for doubt in found.all_doubts()) == doubted


def test_an_output_that_does_not_follow_the_command_is_a_position():
    roles, found = _roles({"t": T, "u": U, "y": ANGLE})
    assert roles["position"][0] == "y"
    assert any("may be a position or a velocity" in doubt for doubt in found.all_doubts())
    assert "velocity" in _roles({"t": T, "u": U, "y": ANGLE}, given={"velocity": Given("y")})[0]


def test_a_velocity_in_hertz_is_in_turns_per_second():
    roles, found = _roles({"t": T, "u": U, "velocity measured [Hz]": SPEED})
    assert roles["velocity"] == ("velocity measured [Hz]", "rev/s")
    assert any("turns per second" in doubt for doubt in found.all_doubts())


@pytest.mark.parametrize("formula", ["0/1023 * 2", "0/1023 * 2 + u", "2 * a b"])
def test_a_name_in_a_formula_that_needs_backquotes_is_shown_with_them(formula):
    columns = {"t": T, "u": U, "0/1023": U, "a b": U, "angle [rad]": ANGLE}
    right = formula.replace("0/1023", "`0/1023`").replace("a b", "`a b`")
    with pytest.raises(InputError, match=f"backquotes: --command '{re.escape(right)}=V'"):
        _roles(columns, given={"command": Given(formula, "V")})
    assert _roles(columns, given={"command": Given(right, "V")})[0]["command"] == (right, "V")


def test_a_number_that_is_the_name_of_a_column_needs_backquotes_in_a_formula():
    columns = {"1": T, "3": U, "5": SPEED}
    with pytest.raises(InputError, match=re.escape("stands in backquotes: --command '`3` / 255.3=-'")):
        _roles(columns, given={"command": Given("3 / 255.3", "-")})
    given = {"time": Given("1", "s"), "velocity": Given("5", "rad/s"), "command": Given("`3` / 255.3", "-")}
    assert _roles(columns, given=given)[0]["command"] == ("`3` / 255.3", "-")


def test_a_log_without_a_command_lists_its_columns_but_the_time():
    with pytest.raises(InputError, match="name one of angle, temperature, a with"):
        _roles({"t": T, "angle": ANGLE, "temperature": 20.0 + 0.0 * T, "a": 0.0 * T}, given={})


@pytest.mark.parametrize(("column", "measured"), [("iq_measured", True), ("current", False), ("torque cmd", False)])
def test_a_measured_force_is_known_by_its_name(column, measured):
    for said in ({}, {"command": Given(column)}):
        _, found = _roles({"t": T, column: U, "q": ANGLE}, given=said)
        assert found.of("command").measured is measured


@pytest.mark.parametrize("column", ["Motorstrom", "motor current [A]", "iq"])
def test_a_current_in_a_loop_is_measured_unless_its_name_says_that_it_was_commanded(column):
    loop = {"t": T, "position": ANGLE, "target position": ANGLE + 0.1}
    _, found = _roles({column: U, **loop, "flags": np.round(U)})
    assert (found.of("command").column, found.of("command").measured) == (column, True)
    assert any("no command was recorded; the measured" in doubt for doubt in found.all_doubts())
    roles, found = _roles({column: U, **loop, "voltage": U})
    assert (roles["command"][0], roles["effort"][0]) == ("voltage", column)
    _, found = _roles({f"{column} setpoint": U, **loop})
    assert not found.of("command").measured


def test_a_sensor_of_forces_is_no_command_beside_the_current_of_the_motor():
    columns = {"t": T, "/ft wrench.force.x": -U, "/ft wrench.torque.z": U, "angle": ANGLE}
    assert _roles(columns | {"current": 2 * U})[0]["command"][0] == "current"
    loop = _roles(columns | {"current": 2 * U, "target angle": ANGLE + 0.1})[0]
    assert loop["command"][0] == "current"
    assert _roles(columns)[0]["command"][0] == "/ft wrench.force.x"


@pytest.mark.parametrize(
    ("command", "motion", "one", "two"),
    [("Inp_{}", "Measure_{}", "x", "y"), ("u_{}", "q_{}", "x", "y"), ("{} pwm", "{} rpm", "left", "right"),
     ("pwmRight", "posRight", "Right", "Left")],
)  # fmt: skip
def test_a_word_tells_the_axes_of_a_machine_apart(command, motion, one, two):
    """That which moves more is taken, with its own command and not with that of the other."""
    columns = {"t": T}
    for side, size in ((one, 0.2), (two, 1.0)):
        name, place = (text.format(side).replace("Right", side) for text in (command, motion))
        columns |= {name: size * np.roll(U, 40 if side == one else 0), place: size * ANGLE}
    roles, found = _roles(columns)
    place = roles.get("position", roles.get("velocity"))[0]
    assert two in place
    assert two in roles["command"][0]
    assert any("the log has 2 joints" in doubt for doubt in found.all_doubts())


@pytest.mark.parametrize("torque", ["torque", "tau", "Torque [Nm]"])
@pytest.mark.parametrize("current", ["current", "i_q", "Current [A]"])
def test_of_a_torque_and_a_current_that_makes_it_the_current_is_the_command(torque, current):
    motion = {"t": T, "angle": ANGLE}
    roles, found = _roles(motion | {torque: 0.1 * U + 0.2 * np.cos(T), current: 2 * U})
    assert (roles["command"][0], roles["effort"][0]) == (current, torque)
    assert f"--command {shlex.quote(torque)}" in " ".join(found.all_doubts())
    computed = _roles(motion | {torque: np.round(0.1 * U, 3), current: 2 * U})[0]
    assert computed["command"][0] == torque, "a multiple of the current was computed from it"
    named = _roles(motion | {f"{torque} cmd": 0.1 * U + 0.2 * np.cos(T), current: 2 * U})[0]
    assert named["command"][0] == f"{torque} cmd"


@pytest.mark.parametrize("letter", ["q", "x"])
def test_a_state_is_the_velocity_of_the_one_whose_slope_it_is(letter):
    swing = 0.3 * np.cumsum(np.sin(7.0 * T)) * 0.005 * ANGLE
    rates = np.gradient(ANGLE, T), np.gradient(swing, T)
    names = [f"{letter}{k}" for k in range(1, 5)]
    roles, found = _roles(dict(zip(["u", *names], [U, ANGLE, swing, *rates], strict=True)), period=0.005)
    assert (roles["position"][0], roles["velocity"][0]) == (names[0], names[2])
    assert "2 joints (1, 2)" in " ".join(found.doubts)
    positions = {f"{letter}{k}": ANGLE * k for k in range(1, 4)}
    assert "velocity" not in _roles({"t": T, "u": U, **positions})[0]


def test_the_hand_of_an_arm_is_no_joint():
    roles, found = _roles({"time": T, "tau_command": U, "q": ANGLE, "qd": SPEED, "ee_pos": 0.3 * np.sin(0.1 * ANGLE)})
    assert roles["position"][0] == "q"
    assert not any("could be meant" in one for one in found.all_doubts())
    assert _roles({"time": T, "force": U, "tcp_pos": ANGLE})[0]["position"][0] == "tcp_pos"


@pytest.mark.parametrize("name", ["Vibration (g)", "Left Load Cell (mV)"])
def test_what_has_a_unit_of_no_motion_is_none(name):
    with pytest.raises(InputError, match="no column is a position or a velocity") as refused:
        _roles({"t": T, "u": U, name: ANGLE})
    assert "as a formula" not in str(refused.value)
    assert _roles({"t": T, "u": U, name: ANGLE, "b": SPEED})[0]["velocity"][0] == "b"
    for flag in ({"Pin State 4": ANGLE}, {"limit": np.where(T < 7.0, 0.0, 1.0)}):
        with pytest.raises(InputError, match="no column is a position or a velocity"):
            _roles({"t": T, "u": U} | flag)


@pytest.mark.parametrize("computed", ["tau_rigid", "tau_model", "predicted torque"])
def test_what_a_model_gave_is_taken_only_where_nothing_was_measured(computed):
    columns = {"t": T, computed: U + 0.1, "tau_friction": 0.1 + 0 * U, "q": ANGLE, "qd": SPEED}
    assert _roles(columns | {"tau_measured": U})[0]["command"][0] == "tau_measured"
    roles = _roles(columns | {"tau_measured": U, "tau_cmd": U})[0]
    assert (roles["command"][0], roles["effort"][0]) == ("tau_cmd", "tau_measured")
    assert _roles(columns)[0]["command"][0] == computed


def test_a_current_that_may_be_measured_is_marked():
    for column, marked in (("current [A]", True), ("current_cmd [A]", False), ("u [A]", False)):
        _, found = _roles({"t [s]": T, column: U, "angle [rad]": ANGLE})
        assert [one for one in found.all_doubts() if "kind: measured" in one] == found.all_doubts()
        assert bool(found.all_doubts()) is marked, column


def test_a_unit_that_is_written_and_not_known_is_shown():
    _, found = _roles({"t": T, "u [V]": U, "speed (furlong/h)": SPEED})
    assert any(
        "the unit 'furlong/h' of the velocity is not known and taken as rad/s" in one for one in found.all_doubts()
    )


def test_a_velocity_in_per_cent_is_one_of_an_unknown_unit():
    roles, found = _roles({"t": T, "M_soll_%": U, "Drehzahl_%": SPEED})
    assert roles == {"command": ("M_soll_%", "%"), "velocity": ("Drehzahl_%", "rad/s")}
    assert any("the unit '%' of the velocity is not known and taken as rad/s" in one for one in found.all_doubts())


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_velocity_in_a_known_unit_says_the_size_of_a_count(sign):
    columns = {"t [s]": T, "u [V]": U, "pos [inc]": np.round(ANGLE * 2000 / 2 / pi), "n [rpm]": sign * SPEED * 30 / pi}
    _, found = _roles(columns)
    assert found.of("position").options == {"scale": 2 * pi / 2000}
    assert found.of("velocity").options == ({} if sign > 0 else {"scale": -1.0})
    assert any("2000 counts per turn" in one and "'pos [inc]=counts/N'" in one for one in found.all_doubts())


@pytest.mark.parametrize(("unit", "other"), [("rad/s", "rpm"), ("rpm", "rad/s")])
def test_counts_found_by_a_velocity_whose_unit_is_confused_are_said_for_the_other_unit(unit, other):
    """The reader knows the 1440 counts of the encoder, not the 151 of a velocity in rpm called rad/s."""
    speed = SPEED if other == "rad/s" else SPEED * 30 / pi
    columns = {"t [s]": T, "u [V]": U, "pos [inc]": np.round(ANGLE * 1440 / 2 / pi), f"speed [{unit}]": speed}
    (doubt,) = (one for one in _roles(columns)[1].all_doubts() if "counts per turn" in one)
    assert f"with the velocity in {other} they are 1440: --velocity 'speed [{unit}]={other}'" in doubt


def test_a_linear_velocity_says_the_length_of_a_count():
    columns = {"t [s]": T, "u [V]": U, "pos [inc]": np.round(ANGLE / 5e-6), "v [mm/s]": 1e3 * SPEED}
    _, found = _roles(columns)
    assert found.of("position").unit == "m"
    assert found.of("position").options["scale"] == pytest.approx(5e-6, rel=1e-3)


def test_a_set_point_that_is_held_is_one_and_zeros_are_none():
    columns = {"t [s]": T, "u [V]": U, "speed [rpm]": SPEED, "target_speed": 200.0 + 0 * T}
    roles, _ = _roles(columns)
    assert roles["reference velocity"] == ("target_speed", "rpm")
    roles, found = _roles(columns | {"target_speed": 0 * T})
    assert "reference velocity" not in roles
    assert found.other == ("target_speed",)


def test_a_set_point_of_another_quantity_is_none_of_the_velocity():
    for column in ("angle_ref [deg]", "x_soll", "p_soll"):
        roles, _ = _roles({"t": T, "u": U, column: ANGLE, "n_ist": SPEED})
        assert "reference velocity" not in roles, column
    for column in ("target", "r", "n_soll"):
        roles, _ = _roles({"t": T, "u": U, column: SPEED + 0.1, "n_ist": SPEED})
        assert roles["reference velocity"][0] == column


def test_without_names_what_is_constant_in_each_run_is_the_command():
    runs = [(level, T[:600], level * (T[:600] - 0.2 * (1.0 - np.exp(-5.0 * T[:600])))) for level in (-2.0, 1.0, 3.0)]
    columns = {
        "0": np.concatenate([np.full(time.size, level) for level, time, _ in runs]),
        "1": np.concatenate([time for _, time, _ in runs]),
        "2": np.concatenate([angle for *_, angle in runs]),
    }
    roles, found = _roles(columns, given={"time": Given("1")})
    assert roles == {"command": ("0", "-"), "position": ("2", "rad")}
    assert len(found.rows) == 3


def _runs(levels, count=400):
    """Held command, time, speed and angle of a motor that starts from rest in each run."""
    time = T[:count]
    settled = 1.0 - np.exp(-5.0 * time)
    return [(np.full(count, u), time, 40.0 * u * settled, 40.0 * u * (time - 0.2 * settled)) for u in levels]


def _headerless(run, decimals=2):
    command, time, speed, angle = run
    return {"0": command, "1": time, "2": np.round(speed, decimals), "3": np.round(angle, decimals)}


def test_without_names_the_slope_of_another_column_is_the_velocity_and_never_the_command():
    runs = _runs([-2.0, 1.0, 3.0])
    # The longest run is one at rest, which shows nothing.
    runs.insert(1, tuple(np.concatenate([0.0 * one, 0.0 * one]) for one in runs[0]))
    runs[1] = (runs[1][0], T[:800], *runs[1][2:])
    columns = {name: np.concatenate([_headerless(run)[name] for run in runs]) for name in "0123"}
    roles, _ = _roles(columns)
    assert {role: column for role, (column, _) in roles.items()} == {"command": "0", "position": "3", "velocity": "2"}


def test_files_show_together_which_column_is_held_in_each():
    tables = [Table(Path(f"run{k}.csv"), _headerless(run)) for k, run in enumerate(_runs([-2.0, 1.0, 3.0]))]
    # A sensor that stands still in one of the files is recognised by the others.
    tables[1].columns["3"] = 0.0 * tables[1].columns["3"]
    shown = shown_together(tables, {})
    assert {role: one.column for role, one in shown.items()} == {"command": "0", "position": "3", "velocity": "2"}
    for table in tables:
        found = recognise_table(table, shown=shown)
        assert {one.role: one.column for one in found.guesses} == {"command": "0", "position": "3", "velocity": "2"}


def test_a_velocity_that_is_late_is_found_by_its_slope():
    late = np.zeros(T.size)
    for k in range(T.size - 1):
        late[k + 1] = late[k] + 0.005 / 0.2 * (SPEED[k] - late[k])
    roles, _ = _roles({"t": T, "u": U, "pos_deg": np.round(np.degrees(ANGLE)), "sig": np.round(late, 1)})
    assert roles["velocity"][0] == "sig"


def test_a_force_is_no_velocity_where_nothing_else_may_be_the_command():
    # Behind a fast motor the angle runs with the integral of the voltage.
    speed = np.convolve(U, np.exp(-T[:40] / 0.02) / 4.0)[: T.size]
    roles, _ = _roles({"t": T, "angle": np.cumsum(speed) * 0.005, "sig": U})
    assert roles == {"command": ("sig", "-"), "position": ("angle", "rad")}


@pytest.mark.parametrize("further", [np.arange(T.size), 1e3 * T + 7.0, 40.0 + np.arange(T.size) / 3.0])
def test_a_further_clock_is_no_motion(further):
    roles, found = _roles({"0": T, "1": further, "2": U, "3": ANGLE})
    assert found.base.time.column == "0"
    assert roles == {"command": ("2", "-"), "position": ("3", "rad")}


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_counts_that_roll_over_have_the_size_that_the_velocity_says(sign):
    counts = np.round(ANGLE * 10000 / 2 / pi + 60000.0)
    columns = {"t [s]": T, "i [A]": U, "pos [cnt]": np.mod(counts, 65536), "vel [deg/s]": sign * np.degrees(SPEED)}
    assert np.ptp(columns["pos [cnt]"]) > 60000
    _, found = _roles(columns)
    scale = 2 * pi / 10000
    assert found.of("position").options == {"scale": scale, "wrap": 65536 * scale}
    assert found.of("velocity").options == ({} if sign > 0 else {"scale": -1.0})
    assert not any("taken as one turn" in one for one in found.all_doubts())


def test_the_flicker_of_a_coarse_sensor_is_no_command():
    volts = np.repeat([1.2, 3.5, 5.3], 1000)
    speed = np.zeros(T.size)
    for k in range(T.size - 1):
        speed[k + 1] = speed[k] + 0.005 / 0.2 * (0.025 * volts[k] - speed[k])
    coarse = 0.03 * np.floor(speed / 0.03 + np.random.default_rng(2).uniform(size=T.size))
    volts = volts + 0.02 * np.random.default_rng(3).normal(size=T.size)
    roles, _ = _roles({"0": T, "1": coarse, "2": volts})
    assert {role: column for role, (column, _) in roles.items()} == {"command": "2", "velocity": "1"}


def test_the_slope_of_a_position_in_a_unit_is_no_command():
    with pytest.raises(InputError, match="no column is a command"):
        _roles({"t": T, "angle": ANGLE, "sig": SPEED * 30 / pi})


@pytest.mark.parametrize(
    "name", ["c1 temp [C]", "motor temperature (°)", "temp [deg]", "temp_C", "Temp [deg C]", "temp [°C]"]
)
def test_a_temperature_in_a_letter_is_in_degrees_celsius(name):
    roles, found = _roles({"t [s]": T, "u [V]": U, "angle [deg]": ANGLE, name: 20.0 + T})
    assert roles["temperature"] == (name, "°C")
    assert not [one for one in found.all_doubts() if "temperature" in one]


def test_the_unit_of_a_condition_that_nothing_says_is_doubted():
    columns = {"t [s]": T, "u [V]": U, "angle [deg]": ANGLE, "batteryVoltage": 7931.0 + 0 * T, "temp": 20.0 + T}
    roles, found = _roles(columns)
    assert (roles["supply"], roles["temperature"]) == (("batteryVoltage", ""), ("temp", ""))
    doubts = found.all_doubts()
    assert "the unit of the supply is not written down: --supply 'batteryVoltage=UNIT'" in doubts
    assert "the unit of the temperature is not written down: --temperature 'temp=UNIT'" in doubts
    given = {"supply": Given("batteryVoltage", "mV"), "temperature": Given("25", "")}
    _, found = _roles(columns, given=given)
    assert [one for one in found.all_doubts() if "not written down" in one] == [
        "the unit of the temperature is not written down: --temperature '25=UNIT'"
    ]


@pytest.mark.parametrize(("column", "turned"), [("motor [A]", "-`motor [A]`"), ("a * 2", "-(a * 2)")])
def test_a_sign_before_a_unit_is_answered_with_the_formula_that_turns_it(column, turned):
    columns = {"t": T, "motor [A]": U, "a": U, "angle": ANGLE}
    with pytest.raises(InputError) as refused:
        _roles(columns, given={"command": Given(column, "-A")})
    assert str(refused.value).endswith(f"--command '{turned}=A'")
    roles, _ = _roles(columns, given={"command": Given(turned, "A")})
    assert roles["command"] == (turned, "A")


def _with_sign_bit(signed, bit):
    whole = np.round(signed)
    return np.where(whole < 0, 2.0**bit - whole, whole)


def _servo():
    """Telemetry of a servo as it sends it: position in counts, speed and load with a sign bit, current in counts."""
    place = np.round(2048 + ANGLE * 4096 / 2 / pi)
    speed, load = _with_sign_bit(SPEED * 4096 / 2 / pi, 15), _with_sign_bit(30 * U + 40 * SPEED, 10)
    current = np.round(np.abs(20 * SPEED))
    return {"target": place, "pos": place, "speed": speed, "load": load, "current": current}


def test_telemetry_with_sign_bits_is_read_with_its_signs():
    roles, found = _roles({"t": T, **_servo()})
    assert (roles["velocity"][0], found.of("velocity").options) == ("speed", {"decode": {"sign_bit": 15}})
    assert "it is the slope of the position" in found.of("velocity").reason
    assert found.of("command").options == {"decode": {"sign_bit": 10}}
    for said in ("bit 15 is the sign", "bit 10 is the sign", "no name says that 'load' was commanded"):
        assert sum(said in one for one in found.all_doubts()) == 1
    assert not any("; " in one and "bit 1" in one for one in found.all_doubts()), "each doubt is a line of its own"


def test_a_column_that_the_user_names_keeps_the_signs_of_its_log():
    _, found = _roles({"t": T, **_servo()}, given={"velocity": Given("speed", "counts/4096"), "command": Given("load")})
    assert found.of("velocity").options == {"decode": {"sign_bit": 15}, "scale": 2 * pi / 4096}
    assert found.of("command").options == {"decode": {"sign_bit": 10}}


def test_whole_numbers_of_a_velocity_are_counts_of_the_position_where_nothing_shows_more():
    columns = {"t": T, "u [V]": U, "pos": np.round(2048 + 100 * ANGLE), "speed": np.round(100 * NOISE[0] / 1e-3)}
    _, found = _roles(columns, given={"position": Given("pos", "counts/4096")})
    assert (found.of("velocity").unit, found.of("velocity").options) == ("rad/s", {"scale": 2 * pi / 4096})
    assert any("counts of the position in a second: --velocity 'speed=UNIT'" in one for one in found.all_doubts())


def test_a_set_point_beside_a_measured_force_is_named_and_has_the_unit_of_the_motion():
    _, found = _roles({"t": T, **_servo()}, given={"position": Given("pos", "counts/4096")})
    assert any("model of the loop in the drive, --command 'target'" in one for one in found.all_doubts())
    _, found = _roles({"t": T, **_servo()}, given={"position": Given("pos", "counts/4096"), "command": Given("target")})
    command = found.of("command")
    assert (command.unit, command.options) == ("rad", {"scale": 2 * pi / 4096})
    assert not any("of the command is not known" in one for one in found.all_doubts())
    assert found.of("reference") is None
    _, found = _roles({"t": T, **_servo()}, given={"command": Given("target", "V")})
    assert found.of("command").unit == "V"


def test_whole_numbers_of_a_current_are_no_amperes():
    roles, found = _roles({"t": T, **_servo()})
    assert roles["effort"] == ("current", "-")
    assert any("counts of the drive: --effort 'current=UNIT'" in one for one in found.all_doubts())
    assert _roles({"t": T, "u [V]": U, "q": ANGLE, "measured current": np.round(SPEED / 2)})[0]["effort"][1] == "-"
    roles, found = _roles({"t": T, "u [V]": U, "q": ANGLE, "measured current": 0.7 * SPEED})
    assert roles["effort"] == ("measured current", "A")
    assert any("taken as A: --effort 'measured current=UNIT'" in one for one in found.all_doubts())


def test_a_column_of_a_known_drive_that_the_user_names_keeps_its_unit():
    names = {
        "pos": "Present_Position",
        "speed": "Present_Velocity",
        "load": "Present_Load",
        "current": "Present_Current",
    }
    columns = {"t": T, **{names[name]: value for name, value in _servo().items() if name in names}}
    _, plain = _roles(columns)
    _, named = _roles(columns, given={"velocity": Given("Present_Velocity")})
    assert (
        named.of("velocity").options
        == plain.of("velocity").options
        == {
            "decode": {"sign_bit": 15},
            "scale": 1 / 4096,
        }
    )
    assert named.of("velocity").unit == "rev/s"
    assert (
        "scale" not in _roles(columns, given={"velocity": Given("Present_Velocity", "rpm")})[1].of("velocity").options
    )


def test_states_and_actions_of_a_data_set_for_learning_are_positions_and_set_points():
    joints = {0: 0.0 * T, 1: ANGLE}
    columns = {"timestamp": T, "frame_index": np.arange(T.size), "episode_index": 0.0 * T}
    columns |= {f"observation.state[{k}]": value for k, value in joints.items()}
    columns |= {f"action[{k}]": value + 0.1 for k, value in joints.items()}
    roles, found = _roles(columns)
    assert {role: one[0] for role, one in roles.items()} == {
        "command": "action[1]",
        "position": "observation.state[1]",
    }
    assert any("loop in the drive" in one for one in found.all_doubts())


def test_the_mode_of_a_drive_and_a_current_along_its_field_are_no_command():
    columns = {"servo_stats.mode": 0 * T + 10, "servo_stats.d_A": 0.0 * T, "servo_stats.torque_Nm": U}
    columns |= {"servo_stats.position": ANGLE * 0.5 / pi, "servo_stats.velocity": SPEED * 0.5 / pi}
    roles, _ = _roles({"time": T, **columns, "servo_stats.fault": 0 * T})
    assert roles["command"] == ("servo_stats.torque_Nm", "N·m")


@pytest.mark.parametrize(
    ("names", "right"), [(("input", "output"), "output"), (("Output", "Setpoint", "Input"), "Input")]
)
def test_which_of_an_input_and_an_output_is_measured_is_said_by_a_set_point(names, right):
    values = {"input": U, "output": ANGLE, "Output": U, "Input": ANGLE, "Setpoint": ANGLE + 0.1 * np.sign(U)}
    roles, found = _roles({"t": T, **{name: values[name] for name in names}})
    assert roles["position"][0] == right
    assert roles["command"][0] == next(name for name in names if values[name] is U)
    assert any("may be a position or a velocity" in one for one in found.all_doubts())


def test_what_was_measured_of_a_joint_and_what_was_asked_of_it_may_stand_apart():
    still = {f"motor_state[0].{name}": 0.0 * T for name in ("q", "dq", "tau_est")} | {"motor_cmd[0].tau": 0.0 * T}
    still |= {"motor_cmd[0].q": 0.0 * T, "motor_cmd[1].q": 0.0 * T}
    moving = {"motor_state[1].q": ANGLE, "motor_state[1].dq": SPEED, "motor_state[1].tau_est": U + NOISE[0]}
    roles, _ = _roles({"t": T, **still, **moving, "motor_cmd[1].tau": U})
    assert {role: one[0] for role, one in roles.items()} == {
        "command": "motor_cmd[1].tau",
        "position": "motor_state[1].q",
        "velocity": "motor_state[1].dq",
        "effort": "motor_state[1].tau_est",
    }


@pytest.mark.parametrize(
    ("command", "effort"),
    [("dac_code", "adc_current"), ("Axis.Cmd.Trq", "Axis.Act.Trq"), ("motor cmd", "motor amps measured")],
)
def test_abbreviations_of_forces(command, effort):
    roles, _ = _roles({"t": T, effort: 0.9 * U, command: U, "angle": ANGLE})
    assert (roles["command"][0], roles["effort"][0]) == (command, effort)


def test_of_two_names_the_one_with_a_d_behind_it_was_desired():
    roles, _ = _roles({"t": T, "tau_J": U, "tau_J_d": U, "q": ANGLE, "q_d": ANGLE + 0.1})
    assert (roles["command"][0], roles["position"][0], roles["reference"][0]) == ("tau_J_d", "q", "q_d")
    # Along the field of a motor it is a direction.
    assert _roles({"t": T, "i": U, "i_d": 0.1 * U, "q": ANGLE})[0]["command"][0] == "i"


def test_pulses_in_hertz_have_the_number_in_a_turn_that_the_position_shows():
    columns = {"t": T, "voltage [V]": U, "angle [rad]": ANGLE, "speed [Hz]": 14.0 * SPEED / (2.0 * pi)}
    _, found = _roles(columns)
    (number,) = [doubt for doubt in found.all_doubts() if "N is" in doubt]
    assert number == "velocity: N is 14 by the slope of 'angle [rad]'"
    roles, _ = _roles(columns, given={"velocity": Given.parse("`speed [Hz]` / 14=rev/s", list(columns))})
    assert roles["velocity"] == ("`speed [Hz]` / 14", "rev/s")


def test_a_frequency_is_a_set_point_of_the_speed():
    roles, found = _roles({"t": T, "output frequency (Hz)": 10.0 * U, "speed [rpm]": SPEED})
    assert roles["command"] == ("output frequency (Hz)", "rev/s")
    assert any("--command '`output frequency (Hz)` / N=rev/s'" in doubt for doubt in found.all_doubts())


def test_a_command_that_is_named_takes_the_motion_of_its_joint():
    columns = {"t": T, "a1 torque cmd [Nm]": U, "a1 position [rad]": ANGLE, "a1 velocity [rad/s]": SPEED}
    columns |= {"a2 torque cmd [Nm]": U, "a2 position [rad]": -3.0 * ANGLE, "a2 velocity [rad/s]": -3.0 * SPEED}
    roles, found = _roles(columns, given={"command": Given("a1 torque cmd [Nm]")})
    assert roles["position"][0] == "a1 position [rad]"
    assert roles["velocity"][0] == "a1 velocity [rad/s]"
    assert not any("joints" in doubt for doubt in found.doubts)
    # A motion that is named beside it says more.
    roles, _ = _roles(columns, given={"command": Given("a1 torque cmd [Nm]"), "position": Given("a2 position [rad]")})
    assert roles["velocity"][0] == "a2 velocity [rad/s]"


def test_the_unit_of_a_position_is_said_by_the_velocity_and_not_by_its_own_slope():
    found = _roles({"t": T, "u": U, "pos": ANGLE, "vel": SPEED})[1]
    assert found.of("position").reason == "by its name (pos); rad by the velocity in rad/s"
    assert "it is the slope of the position" in found.of("velocity").reason


STAIRS = 12.0 * np.sign(np.sin(3.0 * T)) * (1.0 + (T % 5.0 > 2.5))


@pytest.mark.parametrize("name", ["rad", "position [rad]", "theta_rad"])
@pytest.mark.parametrize("command", ["torque", "level"])
def test_an_angle_that_follows_the_command_over_turns_is_a_velocity(name, command):
    roles, found = _roles({"t": T, command: STAIRS, name: 12.0 * SPEED})
    assert roles["velocity"] == (name, "rad/s")
    assert f"{name!r} may be a position or a velocity" in " ".join(found.all_doubts())


def test_a_position_under_a_ramp_or_on_a_spring_stays_one():
    """The speed runs with a ramp better than its position; a pendulum under a slow torque stays within a turn."""
    ramp = T * 2.0
    roles, _ = _roles({"t": T, "torque": ramp, "position [rad]": 10.0 * T**2})
    assert roles["position"] == ("position [rad]", "rad")
    roles, found = _roles({"t": T, "torque": STAIRS, "angle": 10.0 * SPEED})
    assert roles["position"][0] == "angle"
    assert "is large where the command is" in " ".join(found.all_doubts())


@pytest.mark.parametrize("first", [True, False])
def test_of_two_speeds_the_one_of_a_few_levels_was_asked_for(first):
    speeds = {"input_speed": 20.0 * np.sign(U), "output_speed": SPEED}
    names = list(speeds) if first else list(speeds)[::-1]
    roles, _ = _roles({"t": T, "torque": U, **{name: speeds[name] for name in names}})
    assert roles["velocity"][0] == "output_speed"


def test_numbered_states_beside_a_position_are_no_joints():
    states = {"X1": 2.0 * SPEED, "X2": 30.0 * U, "X3": 3.0 * T * U}
    roles, found = _roles({"t": T, **states, "motor position": ANGLE, "current": U})
    assert (roles["position"][0], roles["command"][0]) == ("motor position", "current")
    assert "joints" not in " ".join(found.all_doubts())


@pytest.mark.parametrize(
    ("columns", "options"),
    [
        ({"1": U, "2": ANGLE, "3": 10.0 * SPEED}, {"given": {"velocity": Given("`3` / 10", "rad/s")}}),
        ({"u": U, "channel": ANGLE, "speed [rad/s]": SPEED}, {}),
    ],
)
def test_a_velocity_that_is_known_tells_its_position(columns, options):
    roles, _ = _roles({"t": T, **columns}, **options)
    assert roles["position"] == (list(columns)[1], "rad")


def test_of_one_motion_in_counts_and_in_a_unit_the_unit_is_taken_and_its_distance_from_the_mean_is_no_set_point():
    counts = np.round(ANGLE / 0.0015)
    angle = counts * 0.0015
    columns = {"t": T, "u": U, "y": counts, "yrad": angle, "ymean": angle - angle.mean()}
    for order in (list(columns), list(columns)[::-1]):
        roles, found = _roles({name: columns[name] for name in order})
        assert roles["position"] == ("yrad", "rad")
        assert roles.keys() == {"command", "position"}
        place = found.of("position")
        assert "the same as y but for a factor" in place.reason
        assert not any("y could be meant" in doubt for doubt in found.all_doubts())


def test_a_second_encoder_is_not_the_same_motion():
    beside = np.round(ANGLE / 0.0015) + np.round(2.0 * np.sin(5.0 * ANGLE))
    roles, found = _roles({"t": T, "u": U, "enc": beside, "angle [rad]": np.round(ANGLE / 0.0015) * 0.0015})
    assert roles["position"] == ("angle [rad]", "rad")
    assert "but for a factor" not in found.of("position").reason


@given(factor=st.floats(1e-4, 1e4), start=st.floats(-1e3, 1e3), digits=st.integers(3, 6))
def test_a_column_is_a_multiple_of_another_whatever_factor_and_start(factor, start, digits):
    from idloop.records.recognition.column_name import parse_column_name
    from idloop.records.recognition.roles import role_by_name
    from idloop.records.recognition.table_column import TableColumn

    name = parse_column_name("x")
    one, other, noisy = (
        TableColumn("x", name, role_by_name(name), value)
        for value in (
            np.round(ANGLE / factor, digits + max(0, int(np.log10(factor)))),
            factor * ANGLE + start,
            ANGLE + 0.05 * np.sin(40.0 * T),
        )
    )
    assert one.times(other) == pytest.approx(1.0 / factor**2, rel=1e-3)
    assert one.times(noisy) == 0.0


def test_settings_of_a_model_beside_the_record_are_no_columns_that_were_not_used():
    columns = {"t": T, "u": U, "angle": ANGLE, "sys.A": T[:3], "note": np.zeros(T.size)}
    found = recognise_table(Table(Path("log.mat"), columns))
    assert found.other == ("note",)
    with pytest.raises(InputError) as caught:
        recognise_table(Table(Path("log.mat"), {name: one for name, one in columns.items() if name != "t"}))
    assert "(columns are u, angle, note)" in str(caught.value)
