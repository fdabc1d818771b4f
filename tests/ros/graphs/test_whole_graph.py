"""Whole graphs as processes, judged by the bag that they leave behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")
pytest.importorskip("rclpy", reason="no rclpy: run launch_scripts/test, or source a ROS 2")

from idloop.graph import GraphRun, load_graph, read_results, run_graph
from idloop.physics import load_model

pytestmark = [pytest.mark.ros, pytest.mark.usefixtures("ros_environment")]
SHORT = {"duration": "4.0", "window": "2.0", "validation": "1.0", "fit_period": "1.0"}
SAMPLES = 400


def messages(bag):
    from rosbags.highlevel import AnyReader

    with AnyReader([bag]) as reader:
        return [(connection.topic, stamp, bytes(data)) for connection, stamp, data in reader.messages()]


def run(bag: Path, **values: str) -> list[str]:
    lines: list[str] = []
    graph = load_graph("dc_motor", SHORT | {"bag": str(bag)} | values)
    assert run_graph(graph, say=lambda label, line: lines.append(f"{label}: {line}")), lines
    return lines


@pytest.fixture(scope="module")
def recorded(tmp_path_factory, ros_domain_id):
    """One lock-step run that the tests of this file share."""
    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.mktemp("run")
        patch.setenv("ROS_DOMAIN_ID", str(ros_domain_id))
        patch.setenv("ROS_LOG_DIR", str(folder / "log"))
        return folder / "bag", run(folder / "bag")


def test_every_sample_is_in_the_bag(recorded):
    bag, lines = recorded
    stamps = {}
    for topic, stamp, _ in messages(bag):
        stamps.setdefault(topic, []).append(stamp)
    grid = [10**9 + index * 10_000_000 for index in range(SAMPLES)]
    for topic in ("/joint_states", "/joint_command", "/estimator/prediction", "/estimator/residual"):
        assert stamps[topic] == grid, topic
    assert stamps["/excitation"][:SAMPLES] == grid
    assert any("lost 0, dropped 0" in line for line in lines), lines


def test_the_bag_is_a_record_of_the_model(recorded):
    from idloop.records import read_record

    record = read_record(recorded[0], load_model("dc_motor"))
    assert record.time.size == record.input.size == SAMPLES
    assert np.ptp(record.input) > 1.0
    assert not [finding for finding in record.findings if finding.level == "error"]


def test_the_live_fit_finds_the_machine(recorded):
    result = read_results(recorded[0])
    truth = load_model("dc_motor").values
    assert result.fits == 2
    assert not result.error
    assert set(result.fit) == {"motor.position", "motor.velocity"}
    for name, found in result.parameters.items():
        assert abs(found["value"] - truth[name]) < 5 * found["stderr"] + 1e-9, name


@pytest.mark.slow
def test_equal_seeds_give_equal_bags(recorded, tmp_path):
    run(tmp_path / "bag")
    assert messages(tmp_path / "bag") == messages(recorded[0])


@pytest.mark.slow
def test_replay_shows_the_estimator_what_it_saw(recorded, tmp_path):
    graph = load_graph(
        "replay",
        {
            "play": str(recorded[0]),
            "bag": str(tmp_path / "bag"),
            "sample_time": "0.01",
            "window": "2.0",
            "validation": "1.0",
            "fit_period": "1.0",
        },
    )
    assert run_graph(graph, say=lambda label, line: None)
    assert read_results(tmp_path / "bag") == read_results(recorded[0])
    ours = [one for one in messages(tmp_path / "bag") if one[0] == "/estimator/prediction"]
    assert ours == [one for one in messages(recorded[0]) if one[0] == "/estimator/prediction"]


def without_last_commands(bag: Path, copy: Path, left: int) -> None:
    """The same recording by a controller that died before the machine stood still."""
    from rosbags.highlevel import AnyReader
    from rosbags.rosbag2 import StoragePlugin, Writer

    with AnyReader([bag]) as reader, Writer(copy, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        wanted = [one for one in reader.connections if one.topic in ("/joint_states", "/joint_command")]
        ours = {
            one.id: writer.add_connection(one.topic, one.msgtype, typestore=reader.typestore) for one in wanted
        }  # fmt: skip
        commands = 0
        for connection, stamp, data in reader.messages(wanted):
            commands += connection.topic == "/joint_command"
            if connection.topic == "/joint_states" or commands <= left:
                writer.write(ours[connection.id], stamp, data)


@pytest.mark.slow
@pytest.mark.parametrize("left", [SAMPLES - 20, SAMPLES - 170])
def test_a_recording_without_its_last_commands_is_played_to_the_end(recorded, tmp_path, left):
    without_last_commands(recorded[0], tmp_path / "cut", left)
    values = {"sample_time": "0.01", "window": "2.0", "validation": "1.0", "fit_period": "1.0"}
    values |= {"play": str(tmp_path / "cut"), "bag": str(tmp_path / "bag")}
    assert run_graph(load_graph("replay", values), say=lambda label, line: None)
    stamps = [stamp for topic, stamp, _ in messages(tmp_path / "bag") if topic == "/estimator/prediction"]
    assert len(stamps) == SAMPLES


@pytest.mark.slow
@pytest.mark.whole_graph
def test_real_time_keeps_the_clock(tmp_path):
    started = time.time_ns()
    run(tmp_path / "bag", mode="realtime", duration="1.0")
    stamps = [stamp for topic, stamp, _ in payload_stamps(tmp_path / "bag") if topic == "/joint_states"]
    assert len(stamps) == 100
    assert set(np.diff(stamps)) == {10_000_000}
    assert started < stamps[0] < time.time_ns()


def payload_stamps(bag):
    from idloop_nodes.codec import peek_stamp

    return [(topic, peek_stamp(data), data) for topic, _, data in messages(bag) if topic.startswith("/joint")]


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_an_interrupted_graph_leaves_a_bag_and_no_process(tmp_path, number):
    script = (
        "import sys\n"
        "from idloop.graph import load_graph, run_graph\n"
        f"values = {{'duration': '0.0', 'bag': {str(tmp_path / 'bag')!r}}}\n"
        "done = run_graph(load_graph('dc_motor', values), say=lambda label, line: print(label, line, flush=True))\n"
        "sys.exit(7 if not done else 0)\n"
    )
    with subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True, cwd=tmp_path) as child:
        started = next(line for line in child.stdout if "start: dc_motor" in line)
        child.send_signal(number)
        rest = child.stdout.read()
        assert child.wait(timeout=200) == (7 if number != signal.SIGKILL else -number), started
    assert "Traceback" not in rest
    deadline = time.monotonic() + 200
    while running(str(tmp_path)):  # after a kill the nodes find out for themselves
        assert time.monotonic() < deadline
        threading.Event().wait(0.05)
    assert messages(tmp_path / "bag") or number == signal.SIGKILL  # readable, if only of the first instants


def running(word: str) -> list[str]:
    """Command lines and environments of our nodes that mention `word`."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            line = (folder / "cmdline").read_bytes().decode(errors="replace")
            environment = (folder / "environ").read_bytes().decode(errors="replace")
        except OSError:
            continue
        if "idloop_nodes" in line and word in environment and int(folder.name) != os.getpid():
            found.append(line)
    return found


@pytest.mark.slow
def test_a_graph_ends_when_one_node_dies(tmp_path):
    from idloop.errors import IdloopError

    graph = load_graph("dc_motor", {"duration": "0.0", "bag": str(tmp_path / "bag")})
    lines: list[str] = []
    run_of_graph = GraphRun(graph, say=lambda label, line: lines.append(line))
    try:
        deadline = time.monotonic() + 200
        victim = next(child for child in run_of_graph._children if child.label == "controller")
        with pytest.raises(IdloopError, match="node controller was killed by signal 9"):
            run_of_graph.wait(lambda: _kill_when_started(victim, lines, deadline))
    finally:
        run_of_graph.stop()
    assert run_of_graph.running == []


def _kill_when_started(victim, lines, deadline):
    assert time.monotonic() < deadline, lines
    if any("start: dc_motor" in line for line in lines):
        victim.process.kill()
    return False


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["plant", "--ros-args", "-p", "model:=dc_motr"], "dc_motr"),
        (["plant", "--ros-args", "-p", "sample_time:=-1.0"], "sample_time"),
        (["plan"], "usage"),
    ],
)
def test_wrong_use_is_one_line_and_exit_code_2(arguments, said):
    done = subprocess.run(
        [sys.executable, "-m", "idloop_nodes", *arguments], capture_output=True, text=True, check=False, timeout=200
    )
    assert done.returncode == 2
    lines = [line for line in done.stderr.splitlines() if line]
    assert len(lines) == 1
    assert said in lines[0]


def test_words_that_ros_does_not_understand_are_no_traceback():
    done = subprocess.run(
        [sys.executable, "-m", "idloop_nodes", "plant", "--ros-args", "-p"],
        capture_output=True,
        text=True,
        check=False,
        timeout=200,
    )
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1].startswith("plant: ")
    assert "Traceback" not in done.stderr


def test_a_node_without_the_library_says_so(tmp_path):
    script = (
        "import sys\n"
        "sys.modules['idloop'] = None\n"
        "from idloop_nodes.runtime import run\n"
        "sys.exit(run('plant', ['plant']))\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False, timeout=200)
    assert done.returncode == 2
    assert done.stderr.startswith("plant: the library idloop cannot be imported")
    assert len(done.stderr.splitlines()) == 1
