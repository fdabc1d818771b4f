"""An experiment between normal signals: read, refused, announced, stopped, handed back."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop.errors import InputError
from idloop_nodes.codec import JointSample, decode_header, decode_joint_state, encode_joint_state, encode_time
from idloop_nodes.excitation.excitation_sequence import ExcitationSequence, blend
from idloop_nodes.excitation.experiment import FORM, Experiment, Limits, read_experiment
from idloop_nodes.progress import Progress

MS = 1_000_000
STEP = 10 * MS


def experiment(*values, adds_to="command"):
    value = np.array(values, dtype=float)
    return Experiment(value, np.zeros_like(value), adds_to, 0.01)


def sequence(*values, keeps=True):
    return ExcitationSequence(np.array(values, dtype=float), np.zeros(len(values)), STEP, keeps=keeps, ahead=20)


def test_a_signal_that_repeats_has_no_end():
    command = ExcitationSequence(np.array([1.0, 2.0, 3.0]), np.zeros(3), STEP, keeps=False, ahead=20, repeats=0.5)
    assert play(command, 0, 8) == [1.0, 2.0, 3.0, 1.0, 2.0, 3.0, 1.0, 2.0]


def test_a_reference_that_repeats_goes_back_without_a_jump():
    ramp = np.linspace(0.0, 5.0, 100)
    one = ExcitationSequence(ramp, np.zeros(100), STEP, keeps=True, ahead=20, repeats=0.5)
    values = play(one, 0, 400)
    assert np.max(np.abs(np.diff(values))) < 0.25
    assert values[:100] == pytest.approx(ramp.tolist())
    assert min(values[100:200]) == pytest.approx(0.0, abs=0.02)
    assert max(values[200:]) == pytest.approx(5.0)


def play(one, start, count, active=True):
    return [one.next(start + index * STEP, active)[0] for index in range(count)]


def test_the_form_in_the_messages_is_one_that_is_read():
    one = read_experiment(FORM, "effort", 0.01)
    assert one.adds_to == "command"
    assert len(one.value) == 2000
    assert np.abs(one.value).max() <= 2.0


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{", "line 1: not valid YAML"),
        ("[1, 2]", "write it as"),
        ("{signal: prbs}", "write it as"),
        ("{signal: {amplitude: 1.0}}", "no name"),
        ("{signal: {name: prbz, duration: 1.0}}", "prbs"),
        ("{signal: {name: sine, duration: 1.0, frequenzy: 2.0}}", "frequenzy"),
        ("{signal: {name: sine, duration: .nan}}", "duration"),
        ("{signal: {name: sine, duration: 1.0}, ads_to: command}", "adds_to"),
        ("{signal: {name: sine, duration: 1.0}, adds_to: drive}", "command or reference"),
        ("{signal: {name: sine, duration: 1.0}, adds_to: [command]}", "command or reference"),
        ("{signal: {name: sine, duration: 1.0}, adds_to: reference}", "target of this node is effort"),
        ("{signal: {name: sine, duration: 1.0, sample_time: 0.001}}", "sample_time"),
    ],
)
def test_a_bad_experiment_is_one_line(text, said):
    with pytest.raises(InputError, match=said) as caught:
        read_experiment(text, "effort", 0.01)
    assert "\n" not in str(caught.value)


def test_limits_refuse_what_exceeds_them():
    Limits().refuse(experiment(-9.0, 9.0, adds_to="reference"))
    Limits(2.0, -0.1, 0.1, 1.0).refuse(experiment(-2.0, 2.0))
    for limits, said in (
        (Limits(amplitude=1.9), "limit.amplitude"),
        (Limits(position_min=-1.0), "limit.position_min"),
        (Limits(position_max=1.0), "limit.position_max"),
        (Limits(velocity=399.0), "limit.velocity"),
    ):
        with pytest.raises(InputError, match=said):
            limits.refuse(experiment(-2.0, 2.0, adds_to="reference"))


def test_limits_watch_the_axis():
    limits = Limits(None, -1.0, 1.0, 2.0)
    assert limits.watched
    assert not Limits(amplitude=1.0).watched
    assert not limits.breach(0.5, -2.0)
    assert not limits.breach(float("nan"), float("nan"))
    assert "position_min" in limits.breach(-1.1, 0.0)
    assert "position_max" in limits.breach(1.1, 0.0)
    assert "velocity" in limits.breach(0.0, -2.1)


def test_the_way_between_two_values_is_smooth():
    value, _ = blend(1.0, -2.0, 0.5, 0.01)
    assert value[0] == pytest.approx(1.0)
    assert np.abs(np.diff([*value, -2.0])).max() < 3.0 * 2.0 / 0.5 * 0.01
    assert not len(blend(1.0, 1.0, 0.5, 0.01)[0])
    assert not len(blend(1.0, 2.0, 0.0, 0.01)[0])


def test_an_experiment_goes_between_the_samples_of_the_signal():
    one = sequence(1.0, 2.0, 3.0, 4.0)
    assert play(one, 0, 2) == [1.0, 2.0]
    assert one.begin(experiment(7.0, 8.0), 0.0, 0.0, 2 * STEP) == (2 * STEP, 4 * STEP)
    assert one.playing
    assert play(one, 2 * STEP, 2) == [7.0, 8.0]
    assert not one.playing
    assert play(one, 4 * STEP, 4) == [3.0, 4.0, 4.0, 4.0]


def test_an_experiment_leads_in_and_out_smoothly():
    one = sequence(*([1.0] * 50))
    play(one, 0, 10)
    start, end = one.begin(experiment(*([3.0] * 10)), 0.2, 0.1, 10 * STEP)
    assert (start, end) == (40 * STEP, 50 * STEP)
    values = play(one, 10 * STEP, 70)
    assert max(abs(np.diff([1.0, *values]))) < 2.0 * 2.0 / 0.2 * 0.01
    assert values[20:40] == [3.0] * 20
    assert values[-1] == 1.0


def test_an_effort_rests_at_zero_before_an_experiment():
    one = sequence(*([1.0] * 50), keeps=False)
    play(one, 0, 10)
    start, _ = one.begin(experiment(3.0, 2.0), 0.0, 0.05, 10 * STEP)
    assert start == 15 * STEP
    assert play(one, 10 * STEP, 8) == [0.0] * 5 + [3.0, 2.0, 1.0]


def test_a_stopped_experiment_goes_back_from_where_it_is():
    one = sequence(1.0, 2.0, 3.0, 4.0)
    play(one, 0, 1)
    one.begin(experiment(5.0, 6.0, 7.0, 8.0), 0.0, 0.0, STEP)
    play(one, STEP, 4)
    assert one.cut(2 * STEP, 0.0) == 3 * STEP
    assert one.span == (STEP, 3 * STEP)
    assert play(one, 3 * STEP, 2) == [2.0, 3.0]
    assert one.cut(4 * STEP, 0.0) is None, "it is over"


def test_an_experiment_ends_later_when_samples_were_left_out():
    one = sequence(1.0, 1.0, 1.0)
    play(one, 0, 1)
    one.begin(experiment(5.0, 6.0, 7.0), 0.0, 0.0, STEP)
    play(one, STEP, 1)
    assert play(one, 9 * STEP, 2) == [6.0, 7.0]
    assert one.span == (STEP, 11 * STEP)
    one.begin(experiment(5.0, 6.0), 0.0, 0.02, 20 * STEP)
    play(one, 20 * STEP, 1)
    play(one, 30 * STEP, 3)
    assert one.span == (31 * STEP, 33 * STEP)


def test_a_stop_holds_the_reference_that_is_in_force():
    one = sequence(1.0, 2.0, 3.0, 4.0)
    play(one, 0, 4)
    one.take_back(STEP)
    assert play(one, 2 * STEP, 2, active=False) == [2.0, 2.0]
    assert play(sequence(1.0, keeps=False), 0, 2) == [1.0, 0.0]


def test_progress_knows_the_experiment():
    progress = Progress()
    progress.update(5, "excitation/handed_back")
    assert progress.experiment is None
    progress.update(10, "excitation/experiment")
    progress.update(20, "excitation/handed_back")
    progress.update(15, "excitation/handed_back")
    assert progress.experiment == (10, 15)


class ExcitationBench:
    def __init__(self, bench, **parameters):
        self.bench = bench(
            "excitation",
            **{"signal": "constant", "target": "effort", "duration": 100.0, "sample_time": 0.01, "ahead": 20}
            | {"handover_time": 0.0, "rest_time": 0.0}
            | parameters,
        )
        self.topic = "reference" if self.bench.node._reference else "excitation"
        self.bench.listen(self.topic)
        self.bench.listen("progress")
        self.clock = self.bench.talk("/clock")
        self.bench.matched(self.clock)
        self.bench.until(self.bench.node.publishers_by_topic[self.topic].get_subscription_count)
        self.now = 10**9

    def go_on(self, samples):
        while True:
            step = min(samples, 20)
            self.now += step * STEP
            self.clock.publish(encode_time(self.now))
            self.bench.until(lambda: self.bench.node._now == self.now and self.newest() >= self.now + 20 * STEP)
            samples -= step
            if not samples:
                return

    def newest(self):
        got = self.bench.got[self.topic]
        return decode_joint_state(got[-1]).stamp_ns if got else 0

    def values(self):
        """What finally holds at each stamp."""
        samples = [decode_joint_state(data) for data in self.bench.got[self.topic]]
        return {one.stamp_ns: (one.effort or one.position)[0] for one in samples}

    def said(self):
        return [decode_header(data) for data in self.bench.got["progress"]]


@pytest.mark.ros
@pytest.mark.usefixtures("ros_environment")
class TestNode:
    def test_an_experiment_is_played_and_handed_back(self, bench):
        one = ExcitationBench(bench)
        one.go_on(0)
        assert one.bench.set("experiment", "{signal: {name: zero, offset: -1.0, duration: 0.3}}").successful
        answer = one.bench.call("/excitation/run_experiment")
        assert answer.success, answer.message
        one.go_on(100)
        start = 10**9 + 21 * STEP
        values = one.values()
        assert {values[stamp] for stamp in range(10**9, start, STEP)} == {1.0}
        assert {values[stamp] for stamp in range(start, start + 30 * STEP, STEP)} == {-1.0}
        assert {values[stamp] for stamp in range(start + 30 * STEP, one.now + STEP, STEP)} == {1.0}
        one.bench.until(lambda: len(one.said()) >= 3)
        assert one.said()[-2:] == [(start, "excitation/experiment"), (start + 30 * STEP, "excitation/handed_back")]

    def test_an_experiment_beyond_the_limits_is_refused(self, bench):
        one = ExcitationBench(bench)
        refused = one.bench.set("experiment", "{signal: {name: constant, amplitude: 1.5, duration: 0.3}}")
        assert not refused.successful
        assert "limit.amplitude" in refused.reason
        assert one.bench.set("limit.amplitude", 1.5).successful
        assert one.bench.set("experiment", "{signal: {name: constant, amplitude: 1.5, duration: 0.3}}").successful
        assert one.bench.set("limit.amplitude", 1.4).successful
        one.go_on(0)
        answer = one.bench.call("/excitation/run_experiment")
        assert not answer.success
        assert "limit.amplitude" in answer.message

    def test_the_limit_that_the_user_does_not_set_is_that_of_the_signal(self, bench):
        one = bench("excitation", signal="sine", amplitude=0.7, duration=1.0, sample_time=0.01, autostart=False)
        assert one.node.get_parameter("limit.amplitude").value == pytest.approx(0.7, rel=1e-3)
        assert one.set("amplitude", 2.0).successful
        assert one.node.get_parameter("limit.amplitude").value == pytest.approx(2.0, rel=1e-3)
        assert one.set("limit.amplitude", 1.0).successful
        assert one.set("amplitude", 3.0).successful
        assert one.node.get_parameter("limit.amplitude").value == 1.0

    def test_without_an_experiment_or_inactive_nothing_runs(self, bench):
        one = ExcitationBench(bench)
        assert "no experiment" in one.bench.call("/excitation/run_experiment").message
        assert one.bench.set("experiment", "{signal: {name: constant, amplitude: 1.0, duration: 0.3}}").successful
        assert "running graph" in one.bench.call("/excitation/run_experiment").message
        assert not one.bench.call("/excitation/stop_experiment").success

    def test_an_experiment_can_be_stopped_alone(self, bench):
        one = ExcitationBench(bench)
        one.go_on(0)
        one.bench.set("experiment", "{signal: {name: zero, offset: -1.0, duration: 9.0}}")
        assert one.bench.call("/excitation/run_experiment").success
        assert not one.bench.set("experiment", "").successful, "it runs"
        one.go_on(50)
        assert one.bench.call("/excitation/stop_experiment").success
        one.go_on(1)
        values = one.values()
        assert values[10**9 + 50 * STEP] == -1.0
        assert {values[stamp] for stamp in range(10**9 + 51 * STEP, one.now + STEP, STEP)} == {1.0}
        one.bench.until(lambda: one.said()[-1] == (10**9 + 51 * STEP, "excitation/handed_back"))
        assert one.bench.set("experiment", "").successful

    def test_stop_ends_an_experiment_too(self, bench):
        one = ExcitationBench(bench)
        one.go_on(0)
        one.bench.set("experiment", "{signal: {name: zero, offset: -1.0, duration: 9.0}}")
        assert one.bench.call("/excitation/run_experiment").success
        one.go_on(50)
        assert one.bench.call("/excitation/stop").success
        one.go_on(5)
        values = one.values()
        assert {values[stamp] for stamp in range(10**9 + 51 * STEP, one.now + STEP, STEP)} == {0.0}
        one.bench.until(lambda: one.said()[-1] == (10**9 + 51 * STEP, "excitation/handed_back"))

    def test_an_axis_beyond_its_limits_stops_the_experiment(self, bench):
        one = ExcitationBench(bench, **{"limit.position_max": 3.0})
        states = one.bench.talk("joint_states")
        one.bench.matched(states)
        one.go_on(0)
        one.bench.set("experiment", "{signal: {name: zero, offset: -1.0, duration: 9.0}}")
        assert one.bench.call("/excitation/run_experiment").success
        one.go_on(40)
        states.publish(encode_joint_state(JointSample(10**9 + 39 * STEP, ("motor",), (2.9,), (0.0,))))
        states.publish(encode_joint_state(JointSample(10**9 + 40 * STEP, ("motor",), (3.1,), (0.0,))))
        one.go_on(1)
        one.bench.until(lambda: not one.bench.node.active or one.go_on(1))
        assert "limit.position_max" in one.bench.node.health()[0].message
        one.go_on(1)
        assert one.values()[one.now] == 0.0
