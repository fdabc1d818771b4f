"""Nodes in one process on a domain of their own: what they answer, refuse and publish."""

from __future__ import annotations

import contextlib
import gc
import math
import signal
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")
pytest.importorskip("rclpy", reason="no rclpy: run launch_scripts/test, or source a ROS 2")

from idloop.errors import IdloopError, InputError
from idloop.physics import load_model
from idloop_nodes.codec import JointSample, decode_diagnostics, decode_joint_state, encode_joint_state, encode_time
from idloop_nodes.streams.stream_watch import effective_time

pytestmark = [pytest.mark.ros, pytest.mark.usefixtures("ros_environment")]
MS = 1_000_000


def measurement(stamp, position, velocity=0.0):
    return encode_joint_state(JointSample(stamp, ("motor",), (position,), (velocity,)))


def reference(stamp, position):
    return encode_joint_state(JointSample(stamp, ("motor",), (position,), (0.0,)))


class ControllerBench:
    def __init__(self, bench):
        self.bench = bench(
            "controller", model="dc_motor", sample_time=0.01, controller="'{type: p, output: motor.position, kp: 2.0}'"
        )
        self.bench.listen("joint_command")
        self.states, self.references = self.bench.talk("joint_states"), self.bench.talk("reference")
        self.bench.matched(self.states, self.references)
        self.bench.until(self.bench.node.publishers_by_topic["joint_command"].get_subscription_count)
        self.index = 0

    def answer(self, position, wanted=1.0, step=10 * MS):
        self.index += 1
        stamp = 10**9 + self.index * step
        before = len(self.bench.got["joint_command"])
        self.references.publish(reference(stamp, wanted))
        self.states.publish(measurement(stamp, position))
        self.bench.until(lambda: len(self.bench.got["joint_command"]) > before)
        sample = decode_joint_state(self.bench.got["joint_command"][-1])
        assert sample.stamp_ns == stamp
        return sample.effort[0]


def _participants():
    """Event threads of the middleware in this process: one for each participant."""
    count = 0
    for path in Path("/proc/self/task").glob("*/comm"):
        # a thread of another test may end between the list and its reading
        with contextlib.suppress(FileNotFoundError, ProcessLookupError):
            count += path.read_text(encoding="ascii").startswith("dds.ev.")
    return count


def test_a_destroyed_node_leaves_no_participant_behind(bench):
    """A participant that waits for the collector goes on discovering others, and may wait for itself for ever."""
    before = _participants()
    gc.disable()
    try:
        one = bench("controller")
        assert _participants() == before + 1
        one.close()
        assert _participants() == before
    finally:
        gc.enable()


def test_controller_answers_each_measurement_with_its_stamp(bench):
    one = ControllerBench(bench)
    assert one.answer(0.25) == pytest.approx(1.5)
    assert one.answer(1.5) == pytest.approx(-1.0)


def test_controller_waits_for_the_reference_of_that_time(bench):
    one = ControllerBench(bench)
    one.states.publish(measurement(10**9, 0.0))
    one.bench.until(lambda: one.bench.node._pending is not None)
    assert not one.bench.got["joint_command"]
    one.references.publish(reference(10**9, 3.0))
    one.bench.until(lambda: one.bench.got["joint_command"])
    assert decode_joint_state(one.bench.got["joint_command"][0]).effort == pytest.approx((6.0,))


@pytest.mark.slow
def test_a_controller_that_waits_in_vain_says_for_what(bench, monkeypatch, capfd):
    monkeypatch.setattr("idloop_nodes.streams.rates.TIMEOUT", 0.0)
    one = ControllerBench(bench)
    one.states.publish(measurement(10**9, 0.0))
    told = ""

    def said():
        nonlocal told
        told += capfd.readouterr().err
        return "waits for /reference of 1.000 s" in told

    one.bench.until(said)
    assert not one.bench.got["joint_command"]


def test_emergency_stop_holds_zero_until_reset(bench):
    one = ControllerBench(bench)
    assert one.answer(0.0) == pytest.approx(2.0)
    assert one.bench.call("/controller/emergency_stop").success
    assert one.answer(0.0) == 0.0
    assert one.answer(0.5) == 0.0
    assert one.bench.call("/controller/reset").success
    assert one.answer(0.0) == pytest.approx(2.0)


def test_inactive_controller_commands_zero(bench):
    one = ControllerBench(bench)
    one.bench.node.trigger_deactivate()
    assert one.answer(0.0) == 0.0
    one.bench.node.trigger_activate()
    assert one.answer(0.0) == pytest.approx(2.0)


def test_a_measurement_that_is_not_a_number_stops_the_motor(bench):
    one = ControllerBench(bench)
    assert one.answer(math.nan) == 0.0
    assert one.answer(0.0) == 0.0, "the fault stays until reset"
    one.bench.call("/controller/reset")
    assert one.answer(0.0) == pytest.approx(2.0)


def test_a_clock_that_jumps_costs_one_zero_command(bench):
    one = ControllerBench(bench)
    one.answer(0.0)
    one.index = 500
    assert one.answer(0.0) == 0.0
    assert one.answer(0.0) == pytest.approx(2.0)
    assert one.bench.node._jumps == 1


@pytest.mark.parametrize(
    ("kind", "parameters"),
    [
        ("plant", {"model": "dc_motr"}),
        ("plant", {"model": "dc_motor", "effects": "[dead_zon@input]"}),
        ("plant", {"sample_time": ".nan"}),
        ("plant", {"sample_time": "-0.01"}),
        ("controller", {"model": "dc_motor", "controller": "'{type: pidd}'"}),
        ("controller", {"model": "dc_motor", "controller": "'[1'"}),
        ("excitation", {"signal": "prbz"}),
        ("replay", {"bag": "nowhere"}),
        ("replay", {}),
    ],
)
def test_bad_parameters_are_one_line(bench, kind, parameters):
    with pytest.raises((InputError, IdloopError)) as caught:
        bench(kind, **parameters)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("kind", ["plant", "controller", "estimator", "workbench"])
def test_a_node_does_not_run_what_is_not_trusted(bench, kind, tmp_path):
    (tmp_path / "effects").mkdir()
    (tmp_path / "effects" / "lean.py").write_text(f"open({str(tmp_path / 'run')!r}, 'w').close()\n")
    (tmp_path / "model.yaml").write_text(load_model("dc_motor").to_yaml())
    with pytest.raises(InputError, match="which are not trusted"):
        bench(kind, model=str(tmp_path / "model.yaml"))
    assert not (tmp_path / "run").exists()


def test_excitation_publishes_ahead_of_the_clock(bench):
    one = bench("excitation", signal="square", duration=1.0, sample_time=0.01, ahead=20)
    one.listen("reference")
    clock = one.talk("/clock")
    one.matched(clock)
    one.until(one.node.publishers_by_topic["reference"].get_subscription_count)
    clock.publish(encode_time(10**9))
    one.until(lambda: len(one.got["reference"]) == 21)
    clock.publish(encode_time(10**9 + 50 * MS))
    one.until(lambda: len(one.got["reference"]) == 26)
    samples = [decode_joint_state(data) for data in one.got["reference"]]
    assert [sample.stamp_ns for sample in samples] == [10**9 + index * 10 * MS for index in range(26)]
    assert {abs(sample.position[0]) for sample in samples} == {1.0}


def test_a_clock_that_asks_again_gets_the_same_samples(bench, monkeypatch):
    monkeypatch.setattr("idloop_nodes.nodes.excitation.QUIET", 0.0)
    one = bench("excitation", signal="prbs", duration=10.0, sample_time=0.01, ahead=20)
    one.listen("reference")
    clock = one.talk("/clock")
    one.matched(clock)
    one.until(one.node.publishers_by_topic["reference"].get_subscription_count)
    clock.publish(encode_time(10**9))
    one.until(lambda: len(one.got["reference"]) == 21)
    clock.publish(encode_time(10**9))
    one.until(lambda: len(one.got["reference"]) == 42)
    assert one.got["reference"][:21] == one.got["reference"][21:]
    clock.publish(encode_time(10**9 + 10 * MS))
    one.until(lambda: len(one.got["reference"]) == 43)
    assert decode_joint_state(one.got["reference"][-1]).stamp_ns == 10**9 + 210 * MS


def test_a_controller_gives_a_measurement_that_comes_again_the_same_answer(bench):
    one = ControllerBench(bench)
    first = one.answer(0.25)
    stamp = decode_joint_state(one.bench.got["joint_command"][-1]).stamp_ns
    one.states.publish(measurement(stamp, 0.5))
    one.bench.until(lambda: len(one.bench.got["joint_command"]) == 2)
    again = decode_joint_state(one.bench.got["joint_command"][-1])
    assert (again.stamp_ns, again.effort[0]) == (stamp, first)


def test_a_plant_without_an_answer_says_its_measurement_again_and_goes_on(bench, monkeypatch):
    monkeypatch.setattr("idloop_nodes.nodes.plant.REPEAT", 0.0)
    one = bench("plant", model="dc_motor", mode="lockstep", sample_time=0.01)
    one.listen("joint_states")
    one.listen("/clock")
    commands = one.talk("joint_command")
    one.until(lambda: len(one.got["joint_states"]) >= 3 and len(one.got["/clock"]) >= 3)
    assert len(set(one.got["joint_states"])) == 1
    stamp = decode_joint_state(one.got["joint_states"][0]).stamp_ns
    commands.publish(encode_joint_state(JointSample(stamp, ("motor",), (), (), (1.0,))))
    one.until(lambda: len(set(one.got["joint_states"])) == 2)
    assert decode_joint_state(one.got["joint_states"][-1]).stamp_ns == stamp + 10 * MS


def test_a_stopped_excitation_takes_back_what_it_announced(bench):
    one = bench("excitation", signal="constant", target="effort", duration=10.0, sample_time=0.01, ahead=20)
    one.listen("excitation")
    clock = one.talk("/clock")
    one.matched(clock)
    one.until(one.node.publishers_by_topic["excitation"].get_subscription_count)
    clock.publish(encode_time(10**9))
    one.until(lambda: len(one.got["excitation"]) == 21)
    assert one.call("/excitation/stop").success
    one.until(lambda: len(one.got["excitation"]) == 41)
    samples = [decode_joint_state(data) for data in one.got["excitation"]]
    assert [sample.effort for sample in samples[:21]] == [(1.0,)] * 21
    assert [sample.effort for sample in samples[21:]] == [(0.0,)] * 20
    assert samples[21].stamp_ns == samples[1].stamp_ns


def test_a_running_signal_cannot_change(bench):
    one = bench("excitation", signal="sine", duration=1.0, sample_time=0.01)
    assert not one.set("amplitude", 2.0).successful
    one.node.trigger_deactivate()
    assert one.set("amplitude", 2).successful
    assert not one.set("amplitude", math.nan).successful
    assert abs(one.node._sequence._position).max() == pytest.approx(2.0, rel=1e-3)


def test_estimator_refuses_effects_that_do_not_exist_and_keeps_its_model(bench):
    one = bench("estimator", model="dc_motor", sample_time=0.01, recursive=False)
    result = one.set("effects", ["dead_zone@inptu"])
    assert not result.successful
    assert "inptu" in result.reason
    assert one.set("effects", ["dead_zone@input(width=0.1)"]).successful
    assert "dead_zone@input" in one.node.estimator.model.effect_names
    assert not one.call("/estimator/refit").success, "there is no data yet"


def test_health_is_named_node_and_check(bench):
    one = bench("excitation", signal="zero", duration=1.0, sample_time=0.01)
    one.listen("/diagnostics")
    one.until(lambda: one.got["/diagnostics"])
    _, statuses = decode_diagnostics(one.got["/diagnostics"][0])
    assert [status.name for status in statuses] == ["excitation: signal"]


BETWEEN_SIGNALS = 0.002  # seconds: without, handlers of Python's interrupt themselves without end


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["controller", "estimator"])
def test_signals_that_come_again_do_not_kill_a_node_that_is_ending(ros_environment, kind):
    words = [sys.executable, "-m", "idloop_nodes", kind, "--ros-args", "-p", "model:=dc_motor"]
    with subprocess.Popen(words, env=ros_environment, stderr=subprocess.PIPE, text=True) as node:
        assert "ready" in node.stderr.readline()
        while node.poll() is None:  # as from `ros2 launch`, and from someone who cannot wait
            node.send_signal(signal.SIGINT)
            with contextlib.suppress(subprocess.TimeoutExpired):
                node.wait(BETWEEN_SIGNALS)
        assert node.returncode == 0, node.stderr.read()


STUCK = """
import threading
from idloop_nodes import runtime
from idloop_nodes.nodes.controller import ControllerNode

runtime.PATIENCE = 1
ControllerNode.close = lambda self: threading.Event().wait()
runtime.run("controller", ["controller"])
"""


@pytest.mark.slow
def test_a_node_that_does_not_end_is_killed_by_a_signal_after_some_patience(ros_environment):
    with subprocess.Popen(
        [sys.executable, "-c", STUCK], env=ros_environment, stderr=subprocess.PIPE, text=True
    ) as node:
        assert "ready" in node.stderr.readline()
        while node.poll() is None:
            node.send_signal(signal.SIGINT)
            with contextlib.suppress(subprocess.TimeoutExpired):
                node.wait(BETWEEN_SIGNALS)
        assert node.returncode == -signal.SIGINT


DEADLOCK = """
import ctypes
import sys
from idloop_nodes import runtime
from idloop_nodes.nodes.controller import ControllerNode

runtime.LEAVE = 1.0
ControllerNode.destroy_node = lambda self: ctypes.PyDLL(None).pause()  # keeps the interpreter locked
sys.exit(runtime.run("controller", ["controller"]))
"""


@pytest.mark.slow
def test_a_node_whose_middleware_takes_no_leave_ends_all_the_same(ros_environment):
    with subprocess.Popen(
        [sys.executable, "-c", DEADLOCK], env=ros_environment, stderr=subprocess.PIPE, text=True
    ) as node:
        assert "ready" in node.stderr.readline()
        node.send_signal(signal.SIGINT)
        assert node.wait(timeout=200.0) == 1
        assert "Traceback" not in node.stderr.read()


BROKEN_LOOP = """
import sys
from idloop_nodes.nodes.controller import ControllerNode
from idloop_nodes.runtime import run

def broken(self):
    raise RuntimeError("the loop is broken")

ControllerNode._run_by_clock = broken
sys.exit(run("controller", ["controller", "--ros-args", "-p", "mode:=realtime"]))
"""


@pytest.mark.slow
def test_a_node_whose_loop_breaks_ends_and_says_so(ros_environment):
    done = subprocess.run(
        [sys.executable, "-c", BROKEN_LOOP],
        env=ros_environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=200,
    )
    assert done.returncode == 1
    *before, last = done.stderr.splitlines()
    assert last == "controller: RuntimeError: the loop is broken"
    assert all("ready" in line for line in before), "one line, no traceback"


@pytest.mark.parametrize(
    ("stamp", "received", "when"),
    [(105, 101, 105), (95, 101, 101), (95, 3_700_101, 100), (95, -3_599_899, 100)],
    ids=["in time", "late", "the clock was set forth", "the clock was set back"],
)
def test_a_simulated_command_takes_effect_at_its_stamp_or_on_arrival(stamp, received, when):
    milliseconds = [10**6 * one for one in (stamp, received, 100)]
    assert effective_time(*milliseconds) == 10**6 * when


def test_a_command_for_an_hour_ahead_holds_up_nobody():
    with pytest.raises(InputError, match="3600 s ahead"):
        effective_time(3_601 * 10**9, 10**9, 10**9)
