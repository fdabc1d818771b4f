"""Watching wear in the estimator: what its message says, and which stretch of data is looked at when."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop.diagnosis.design.experiment import Experiment
from idloop.errors import IdloopError
from idloop.monitoring import WatchState
from idloop.monitoring.monitor import Alarm, Growth
from idloop.physics import load_model
from idloop.records.bags.cdr import SECOND
from idloop_nodes.codec import Level, decode_diagnostics, encode_diagnostics
from idloop_nodes.descriptions import describe
from idloop_nodes.estimation.estimator_context import EstimatorContext
from idloop_nodes.estimation.wear import USUAL, WearSchedule, check_stretch, learn_normal, wear_statuses
from idloop_nodes.streams.sample_buffer import SampleBuffer

LEVEL = "coulomb_friction@motor.level"
GROWN = Growth(0.3, 0.2, 0.4)


def test_an_alarm_is_an_error_and_a_watch_that_never_can_alarm_a_warning():
    alarm = WatchState(LEVEL, "N·m", 0.8, 0.2, "alarm", "", (Alarm(7, 5, GROWN),), GROWN, 9.0, 8.0, 9, 9, 5.0, 5.0)
    why = "its motion is too slow"
    rest = replace(alarm, parameter="backlash@a-b.gap", state="cannot_tell", why=why, alarms=(), growth=None)
    baseline = SimpleNamespace(
        model=SimpleNamespace(name="m"), false_alarm_hours=100.0, duration=60.0, end_of=lambda block: 1000 * block,
        normal=[SimpleNamespace(why=text) for text in ("", why, "")],
    )  # fmt: skip
    monitor = SimpleNamespace(baseline=baseline, states=lambda: [alarm, rest, rest])
    stamp, told = decode_diagnostics(encode_diagnostics(7, wear_statuses("estimator", monitor)))
    assert stamp == 7
    assert [one.level for one in told] == [Level.ERROR, Level.ERROR, Level.WARN, Level.OK]
    assert told[0].message == f"wear: {LEVEL}"
    assert "+0.3 N·m (0.2 .. 0.4)" in told[1].message
    assert (told[1].values["first"], told[1].values["low"], told[1].values["able"]) == ("7000", "0.2", "true")
    assert "cannot tell" in told[2].message
    assert (told[2].values["first"], told[2].values["low"], told[2].values["able"]) == ("0", "", "false")


class Office:
    """The estimator's side, with the test as the worker."""

    def __init__(self, **parameters):
        self.values = {one.name: one.default for one in describe("estimator").parameters()}
        self.values |= {"sample_time": 0.01, "monitor": (LEVEL,), "monitor_learn": 60.0} | parameters
        self.jobs, self.published, self.log = [], [], []
        self.last = 10**9  # stamp of the newest sample
        self.model = load_model("dc_motor").with_effects(["coulomb_friction@motor(level=0.8)"])
        self.buffer = SampleBuffer(len(self.model.outputs))
        self.worker = self
        log = (self.log.append,) * 3
        context = EstimatorContext("estimator", *log, self.values, self.buffer, self, self.publish)
        self.monitoring = WearSchedule(context, self.model)

    def submit(self, work, done, failed):
        self.jobs.append(SimpleNamespace(**work.keywords, work=work, done=done, failed=failed))

    def publish(self, name, stamp, statuses):
        self.published.append(encode_diagnostics(stamp, statuses))

    def hear(self, seconds, seed=1, level=0.8, start=None):
        """Take in so many seconds of data, block by block."""
        given = {"name": "multilevel", "amplitude": 3.0, "sample_time": 0.01, "duration": seconds, "seed": seed}
        machine = self.model.with_values({LEVEL: level})
        run = Experiment(given).run(machine, noise=True, seed=seed)
        begin = start if start is not None else self.last + 10_000_000
        if self.buffer.first is None:
            self.buffer.first = begin
        for k, (t, row) in enumerate(zip(run.time[:-1], run.output, strict=False)):
            stamp = begin + round(t * SECOND)
            self.buffer.commands.append(stamp, (float(run.input[k]),))
            self.buffer.outputs.append(stamp, tuple(row))
            if k % 500 == 499:
                self.monitoring.follow(stamp)
        self.last = begin + round(run.time[-2] * SECOND)

    def work(self):
        """Do the newest job as the worker would."""
        self.jobs[-1].done(self.jobs[-1].work(lambda share, text: None))

    @property
    def told(self):
        """The newest message: the monitor, and what is watched."""
        head, *watches = decode_diagnostics(self.published[-1])[1]
        return head, watches

    @property
    def stamp(self):
        """Stamp after the newest sample that the worker has seen."""
        return decode_diagnostics(self.published[-1])[0]


def test_it_learns_first_and_then_looks_at_every_sample_once():
    office = Office(monitor=(f"{LEVEL}=60%",), monitor_false_alarms="per 1 h")
    office.hear(50.0)
    assert office.jobs == []
    office.hear(55.0, 2)
    (job,) = office.jobs
    assert job.work.func is learn_normal
    assert job.records[0].duration == pytest.approx(60.0, abs=0.02)
    assert office.monitoring.busy
    office.work()
    assert float(office.told[0].values["reference"]) == pytest.approx(60.0, abs=0.02)
    office.monitoring.follow(office.last)
    ends = [office.stamp]
    while office.monitoring.busy:
        office.work()
        ends.append(office.stamp)
    looks = office.jobs[1:]
    assert all(one.work.func is check_stretch for one in looks)
    assert len(looks) == 4
    assert ends == [ends[0] + k * 10 * SECOND for k in range(5)]
    # Each begins where the one before ended, less what the observer takes to settle.
    for one, before in zip(looks, ends, strict=False):
        assert 0 < before - one.record.start_ns < 20 * SECOND
    office.monitoring.finish(office.last)
    office.work()
    assert not office.monitoring.busy
    _, (watch,) = office.told
    assert 18 <= int(watch.values["blocks"]) <= 23
    assert watch.values["alarms"] == "0"


def test_what_grows_alarms_in_the_log_once_and_on_the_topic():
    office = Office(monitor=(f"{LEVEL}=100%",), monitor_false_alarms="per 0.1 h")
    office.hear(100.0)
    office.work()
    office.hear(100.0, 3, level=1.6)
    while office.monitoring.busy:
        office.work()
    head, (watch,) = office.told
    assert head.values["state"] == watch.values["state"] == "alarm"
    assert head.level == Level.ERROR
    assert int(watch.values["first"]) > 101 * SECOND
    assert sum("changed by" in line for line in office.log) == 1
    (health,) = office.monitoring.health()
    assert (health.name, health.level) == ("wear", Level.ERROR)
    assert LEVEL in health.message


def test_after_a_jump_of_the_clock_what_was_learnt_stays():
    office = Office(monitor=(f"{LEVEL}=60%",), monitor_false_alarms="per 1 h")
    office.hear(70.0)
    office.work()
    office.buffer.clear()
    office.monitoring.restart()
    office.hear(30.0, 4, start=5 * SECOND)
    looks = [one for one in office.jobs if one.work.func is check_stretch]
    assert len(office.jobs) == 1 + len(looks)
    assert looks[0].new_run
    assert looks[0].record.start_ns >= 5 * SECOND
    while office.monitoring.busy:
        office.work()
    assert not office.jobs[-1].new_run
    assert office.told[1][0].values["blocks"] != "0"


def test_only_what_is_still_needed_is_kept():
    office = Office()
    assert office.monitoring.oldest is None
    office.hear(30.0)
    assert office.monitoring.oldest == office.buffer.first
    office.hear(40.0, 2)
    assert office.monitoring.oldest == office.buffer.first  # until it is known how long the observer takes to settle
    office.work()
    office.monitoring.follow(office.last)
    assert office.monitoring.oldest > office.buffer.first


@pytest.mark.parametrize(
    ("parameters", "word"),
    (
        ({"monitor": ("backlash@motor",)}, "backlash@motor"),
        ({"monitor": (LEVEL,), "monitor_false_alarms": "never"}, "per 1000 h"),
        ({"monitor": (USUAL,), "monitor_reference": ("nowhere",)}, "nowhere"),
    ),
)
def test_what_cannot_be_watched_is_said_and_given_up(parameters, word):
    office = Office(**parameters)
    office.hear(70.0)
    job = office.jobs[-1]
    try:
        job.work(lambda share, text: None)
    except IdloopError as error:
        job.failed(str(error))
    head, _ = office.told
    assert word in head.values["error"]
    assert word in office.log[-1]
    assert head.level == Level.WARN
    office.hear(30.0, 2)
    assert len(office.jobs) == 1
    assert not office.monitoring.busy


def test_a_stretch_that_cannot_be_read_leaves_what_was_known():
    office = Office(monitor=(f"{LEVEL}=60%",), monitor_false_alarms="per 1 h")
    office.hear(80.0)
    office.work()
    office.monitoring.follow(office.last)
    _, known = office.told
    office.jobs[-1].failed("too few samples")
    head, watches = office.told
    assert watches == known
    assert head.message == head.values["error"] == "too few samples"
    assert head.level == Level.WARN


def test_nothing_is_watched_unless_asked_for():
    office = Office(monitor=())
    office.hear(80.0)
    assert office.jobs == []
    assert office.monitoring.health() == []
