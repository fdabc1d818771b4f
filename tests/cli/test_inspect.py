"""`idloop inspect`: tables and sentences for people, one document with --json, a figure with --plot."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest

from idloop.cli import main
from idloop.records import Record, make_stream, write_bag


@pytest.fixture
def bag(tmp_path):
    stamps = 10**9 + 10**7 * np.arange(500)
    command = np.where(np.arange(500) // 30 % 2, 1.0, -1.0)
    return write_bag(
        tmp_path / "bag",
        [
            make_stream("joint_command", stamps, {"motor": {"effort": command}}),
            # A held command moves nothing before its stamp.
            make_stream("joint_states", stamps, {"motor": {"position": np.cumsum(command) - command}}),
        ],
    )


def _run(capsys, *words):
    code = main.run(["inspect", *map(str, words)])
    out, err = capsys.readouterr()
    return code, out, err


def test_conditions_have_a_table_of_their_own(tmp_path, capsys):
    stamps = 10**9 + 10**7 * np.arange(500)
    command = np.where(np.arange(500) // 30 % 2, 1.0, -1.0)
    streams = [
        make_stream("conditions", stamps[::100], {"temperature": {"position": 20.0 + np.arange(5)}}),
        make_stream("joint_command", stamps, {"motor": {"effort": command}}),
        make_stream("joint_states", stamps, {"motor": {"position": np.cumsum(command)}}),
    ]
    code, out, _ = _run(capsys, write_bag(tmp_path / "warm", streams), "--plot", tmp_path / "warm.png")
    assert code == 0
    row = next(line for line in out.splitlines() if line.startswith("temperature"))
    assert row.split() == ["temperature", "[?]", "5", "20", "24"]
    assert "temperature.position" not in out


def test_for_people(bag, capsys):
    code, out, _ = _run(capsys, bag)
    assert code == 0
    spoilt = "friction at low speed, play, dead zone, limits of the drive and inertia"
    assert out.startswith(f"Verdict: not usable for {spoilt}: motor.")
    for words in ("/joint_states", "motor.effort has two levels only", "use more levels to see them"):
        assert words in out


def test_json_and_plot(bag, tmp_path, capsys):
    figure = tmp_path / "figure.svg"
    code, out, _ = _run(capsys, bag, "--json", "--plot", figure)
    assert code == 0
    document = json.loads(out)
    assert document["schema"] == "idloop/inspect/1"
    assert document["commands"]["motor.effort"]["levels"] == 2
    drawn = figure.read_text()
    for words in ("motor.effort [command unit]", "time [s]", "frequency [Hz]", "interval [ms]"):
        assert words in drawn


def test_command_topic(bag, capsys):
    assert json.loads(_run(capsys, bag, "--json", "--command", "joint_states")[1])["command_topic"] == "/joint_states"


@pytest.mark.slow
def test_the_real_idle_axis(data_dir, tmp_path, capsys):
    path = data_dir / "odrive_rosbag2_idle" / "rosbag2_2024_08_22-12_20_42"
    code, out, _ = _run(capsys, path, "--plot", tmp_path / "figure.png")
    assert code == 0
    assert "nothing can be identified" in out
    assert (tmp_path / "figure.png").stat().st_size > 10_000


@pytest.mark.parametrize("words", [["nowhere"], ["{bag}", "--command", "joint_comand"], ["{bag}", "--distro", "jazy"]])
def test_mistakes(bag, capsys, words):
    code, out, err = _run(capsys, *(word.format(bag=bag) for word in words))
    assert (code, out) == (2, "")
    assert err.count("\n") == 1


def test_numbers_that_nobody_measures_are_one_line(tmp_path, capsys):
    time = 0.01 * np.arange(300)
    output = np.column_stack([1e300 * np.sin(time), np.cos(time)])
    names, units = ("motor.position", "motor.velocity"), ("rad", "rad/s")
    record = Record("bag", time, np.sign(np.sin(5 * time)), time, output, "motor.effort", "V", names, units)
    write_bag(tmp_path / "bag", record)
    done = subprocess.run(
        [sys.executable, "-m", "idloop", "inspect", str(tmp_path / "bag")], capture_output=True, text=True, check=True
    )
    assert "warning: motor.position reaches 1e+300, no measurement is above 1e+50; check its unit" in done.stdout
    assert done.stderr == "", "no warning of a library"


def _motor(path, *, joints=("motor",), gain=1.0, wrong=(), spike=False, overflow=False):
    """Bag of joints under random steps; the velocity of those in `wrong` is in rpm."""
    stamps = 10**9 + 10**7 * np.arange(1500)
    commands, states = {}, {}
    for index, joint in enumerate(joints):
        rng = np.random.default_rng(index)
        command = np.repeat(rng.normal(size=50), 30)
        velocity, v = np.empty(1500), 0.0
        for k, value in enumerate(command):
            velocity[k] = v
            v += 0.01 * (gain * 20.0 * value - 3.0 * v)
        position = np.cumsum(velocity) * 0.01 + 1e-5 * rng.normal(size=1500)
        position[[500, 900]] += 5.0 * spike
        position[700] += 65535.0 * overflow
        commands[joint] = {"effort": command}
        measured = velocity + 1e-3 * rng.normal(size=1500)
        states[joint] = {"position": position, "velocity": measured * (30 / np.pi if joint in wrong else 1.0)}
    return write_bag(
        path, [make_stream("joint_command", stamps, commands), make_stream("joint_states", stamps, states)]
    )


def test_a_clean_bag_is_usable(tmp_path, capsys):
    code, out, _ = _run(capsys, _motor(tmp_path / "good"))
    assert code == 0
    assert out.startswith("Verdict: usable: no fault found\n")


def test_several_bags_have_a_row_each_and_the_faults_between_them(tmp_path, capsys):
    bags = [_motor(tmp_path / "run_0.5"), _motor(tmp_path / "run_0.7"), _motor(tmp_path / "loaded", gain=0.4)]
    code, out, _ = _run(capsys, *bags)
    assert code == 0
    rows = out.splitlines()[2:5]
    assert [row.split()[0] for row in rows] == ["run_0.5", "run_0.7", "loaded"]
    assert "in loaded as in run_0." in out
    document = json.loads(_run(capsys, *bags, "--json")[1])
    assert document["schema"] == "idloop/inspections/1"
    assert [one["kind"] for one in document["between"]] == ["other_gain"]
    assert [one["grade"] for one in document["bags"]] == ["usable"] * 3
    code, _, err = _run(capsys, *bags, "--plot", tmp_path / "x.png")
    assert (code, err.count("\n")) == (2, 1)


def test_a_robot_has_a_row_for_each_joint(tmp_path, capsys):
    bag = _motor(tmp_path / "robot", joints=("hip", "knee", "toe"), wrong=("knee",))
    _, out, _ = _run(capsys, bag)
    rows = {line.split()[0]: line for line in out.splitlines() if line.startswith(("hip ", "knee ", "toe "))}
    assert list(rows) == ["hip", "knee", "toe"]
    assert rows["knee"].split()[1] == "knee.effort"
    assert "usable with care  wrong_velocity" in rows["knee"]
    document = json.loads(_run(capsys, bag, "--json")[1])
    assert document["joints"]["hip"]["grade"] == "usable"
    (fault,) = document["faults"]
    assert (fault["where"], fault["kind"]) == ("knee.velocity", "wrong_velocity")
    assert fault["evidence"]["slope"] == pytest.approx(9.55, rel=0.01)
    assert "unit: rpm" in fault["cure"]


def test_the_plot_marks_the_faulty_places(tmp_path, capsys):
    figure = tmp_path / "figure.svg"
    _run(capsys, _motor(tmp_path / "bad", spike=True), "--plot", figure)
    assert "spikes (2)" in figure.read_text()


def test_the_plot_shows_the_motion_beside_an_overflow(tmp_path):
    from idloop.records import inspect_bag
    from idloop.reporting.plots.recording import plot_recording

    found = inspect_bag(_motor(tmp_path / "bad", overflow=True))
    axes = next(one for one in plot_recording(found).axes if one.get_ylabel().startswith("motor.position"))
    low, high = axes.get_ylim()
    assert high - low < 1000.0
