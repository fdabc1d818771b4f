"""What a log writes as a unit is read, as a multiple as well; what is not known is said."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.api.log import recognise
from idloop.records.recognition.column_name import parse_column_name


def _log(tmp_path, command, position, velocity="", *, counts=1.0):
    """Write a log of a command, an angle, and its slope in the unit of the angle per second."""
    time = np.arange(800) / 200.0
    force = np.sign(np.sin(5.0 * time))
    place, speed = counts * (1.0 - np.cos(3.0 * time)), counts * 3.0 * np.sin(3.0 * time)
    columns = [time, force, place, *([speed] if velocity else [])]
    names = ["t [s]", command, position, *([velocity] if velocity else [])]
    rows = "\n".join(";".join(f"{cell:.6g}" for cell in row) for row in zip(*columns, strict=True))
    path = tmp_path / "log.csv"
    path.write_text(";".join(names) + "\n" + rows + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("position", "velocity", "unit", "rate"),
    [
        ("Ângulo (graus)", "Velocidade (graus/s)", "deg", "deg/s"),
        ("angolo [gradi]", "velocità [gradi/s]", "deg", "deg/s"),
        ("PositionDegrees", "VelocityDegPerSec", "deg", "deg/s"),
        ("PositionMeters", "VelocityMetersPerSec", "m", "m/s"),
        ("POSITION_REV", "VELOCITY_REV_S", "rev", "rev/s"),
        ("Hoek [graden]", "Snelheid [graden per seconde]", "deg", "deg/s"),
        ("vinkel [grader]", "hastighet [grader/s]", "deg", "deg/s"),
        ("угол_град", "скорость_град/с", "deg", "deg/s"),
        ("Angle (Deg)", "Rate (Deg·s⁻¹)", "deg", "deg/s"),
    ],
)
def test_words_of_units(tmp_path, position, velocity, unit, rate):
    found = recognise(_log(tmp_path, "u [V]", position, velocity)).recognition
    assert (found.of("position").unit, found.of("velocity").unit) == (unit, rate)
    assert not [doubt for doubt in found.all_doubts() if "unit" in doubt]


@pytest.mark.parametrize(
    ("name", "unit", "factor"),
    [
        ("Commanded Current (0.01 A)", "A", 0.01),
        ("Target torque [1/1000 rated]", "-", 0.001),
        ("Torque demand value [‰]", "%", 0.1),
        ("Torque (‰ of rated torque)", "%", 0.1),
        ("Torque [0.1 %]", "%", 0.1),
        ("phi_mdeg", "deg", 0.001),
        ("w_mdps", "deg/s", 0.001),
        ("torque_cNm", "N·m", 0.01),
        ("torque [cN·m]", "N·m", 0.01),
        ("Moment (Ncm)", "N·m", 0.01),
        ("tau [kgf.cm]", "N·m", 0.0980665),
        ("torque_kgcm", "N·m", 0.0980665),
        ("pull [gf]", "N", 0.00980665),
        ("torque_ozin", "ozf·in", 1.0),
    ],
)
def test_a_multiple_of_a_unit(name, unit, factor):
    parsed = parse_column_name(name)
    assert (parsed.unit, parsed.factor, parsed.written) == (unit, factor, "")


def test_a_multiple_is_read_from_the_header_and_may_be_given(tmp_path):
    path = _log(tmp_path, "current (0.01 A)", "phi_mdeg")
    command = recognise(path).recognition.of("command")
    assert (command.unit, command.options) == ("A", {"scale": 0.01})
    given = recognise(path, {"command": "current (0.01 A)=0.001 A"}).recognition.of("command")
    assert (given.unit, given.options) == ("A", {"scale": 0.001})


def test_counts_per_second_are_a_velocity(tmp_path):
    found = recognise(_log(tmp_path, "_TTX (V)", "_TPX (counts)", "_TVX (counts/s)", counts=1e4)).recognition
    assert found.of("velocity").column == "_TVX (counts/s)"


@pytest.mark.parametrize("velocity", ["", "omega [bananas/s]"])
def test_an_unknown_unit_is_not_called_unwritten(tmp_path, velocity):
    doubts = recognise(_log(tmp_path, "u [V]", "angle [bananas]", velocity)).doubts
    assert any("'bananas'" in doubt for doubt in doubts)
    assert not any("written down" in doubt for doubt in doubts)


def test_the_unit_of_a_remark_is_not_that_of_the_column():
    assert parse_column_name("Time (samples) TM=976.5625us").unit == ""
    assert parse_column_name("Time (samples) TM=976.5625us").written == "samples"


@pytest.mark.parametrize(
    ("name", "largest", "words"),
    [
        ("pwm", 255, "probably the full scale of 8 bits: as a share of it --command 'pwm / 255=-'"),
        ("duty", 1000, "probably the full scale of per mille: as a share of it --command 'duty / 1000=-'"),
        ("u", 32767, "probably the full scale of 15 bits: as a share of it --command 'u / 32767=-'"),
        ("PWM out", 180, "of which the full scale N is not known (255 of 8 bits): as a share of it"),
    ],
)
def test_the_full_scale_of_a_command_in_counts_is_said_with_the_options_that_use_it(tmp_path, name, largest, words):
    path = _log(tmp_path, name, "angle [rad]", counts=1.0)
    rows = [line.split(";") for line in path.read_text(encoding="utf-8").splitlines()]
    levels = [
        str(round(largest * np.sign(float(row[1])) * (0.5 + 0.5 * (k % 300 > 150)))) for k, row in enumerate(rows[1:])
    ]
    text = [";".join([row[0], level, *row[2:]]) for row, level in zip(rows[1:], levels, strict=True)]
    path.write_text("\n".join([";".join(rows[0]), *text]) + "\n", encoding="utf-8")
    doubts = recognise(path, {"command": name}).doubts
    said = next(doubt for doubt in doubts if "holds whole numbers" in doubt)
    assert f"{name!r} holds whole numbers up to {largest}, {words}" in said
    assert "as the mean voltage of a supply of U volts" in said
    formula = said.partition("--command '")[2].partition("'")[0].replace("N", "255")
    again = recognise(path, {"command": formula})
    assert again.recognition.of("command").options["compute"] == formula.removesuffix("=-")
    assert not any("holds whole numbers" in doubt for doubt in again.doubts)


def test_a_recorded_supply_makes_a_voltage_of_a_duty_cycle(tmp_path):
    time = np.arange(800) / 200.0
    duty, supply = np.round(255 * np.sin(5.0 * time)), 12.0 - 0.1 * np.abs(np.sin(5.0 * time))
    rows = "\n".join(f"{t:.4f},{u:.0f},{v:.3f},{np.cos(3 * t):.5f}" for t, u, v in zip(time, duty, supply, strict=True))
    path = tmp_path / "log.csv"
    path.write_text(f"t [s],pwm,vbat [V],angle [rad]\n{rows}\n")
    doubts = recognise(path).doubts
    assert any(doubt.endswith("as the mean voltage --command 'pwm * `vbat [V]` / 255=V'") for doubt in doubts)
