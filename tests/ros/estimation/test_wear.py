"""Watching wear in the estimator: messages back and forth, and which stretch of data is looked at when."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop.diagnosis.design.experiment import Experiment
from idloop.errors import IdloopError
from idloop.physics import load_model
from idloop.records.bags.cdr import SECOND
from idloop_nodes.codec import (
    CdrError,
    Level,
    Status,
    WatchSummary,
    WearSummary,
    decode_diagnostics,
    encode_diagnostics,
    wear_from_statuses,
    wear_to_statuses,
)
from idloop_nodes.descriptions import describe
from idloop_nodes.estimation.estimator_context import EstimatorContext
from idloop_nodes.estimation.wear import USUAL, WearSchedule, check_stretch, learn_normal
from idloop_nodes.streams.sample_buffer import SampleBuffer

LEVEL = "coulomb_friction@motor.level"
texts = st.text(st.characters(exclude_characters="\x00", exclude_categories=("Cs",)), max_size=12)
numbers = st.floats(allow_nan=False)
stamps = st.integers(0, 2**62)
maybe = st.none() | numbers
watches = st.builds(
    WatchSummary, texts, texts, numbers, numbers, texts, st.booleans(), texts, maybe, maybe, maybe, numbers, numbers,
    stamps, stamps, numbers, stamps, stamps, stamps, stamps,
)  # fmt: skip
summaries = st.builds(WearSummary, texts, texts, numbers, numbers, st.lists(watches, max_size=3).map(tuple), texts)


@given(summaries)
def test_what_is_known_of_wear_comes_back(summary):
    stamp, statuses = decode_diagnostics(encode_diagnostics(7, wear_to_statuses("estimator", summary)))
    assert (stamp, wear_from_statuses(statuses)) == (7, summary)


@pytest.mark.parametrize("values", ({}, {"model": "m", "state": "quiet"}))
def test_a_message_of_something_else_is_refused(values):
    with pytest.raises(CdrError):
        wear_from_statuses([Status("estimator: wear", values=values)])
    with pytest.raises(CdrError):
        wear_from_statuses([])


def test_an_alarm_is_an_error_and_a_watch_that_never_can_alarm_a_warning():
    alarm = WatchSummary(LEVEL, "N·m", 0.8, 0.2, "alarm", growth=0.3, low=0.2, high=0.4, alarms=1)
    blind = WatchSummary("backlash@a-b.gap", "rad", 0.1, 0.02, "cannot_tell", able=False, why="its motion is too slow")
    rest = replace(blind, able=True)
    levels = [
        one.level for one in wear_to_statuses("estimator", WearSummary("m", "alarm", watches=(alarm, blind, rest)))
    ]
    assert levels == [Level.ERROR, Level.ERROR, Level.WARN, Level.OK]
    assert "+0.3 N·m (0.2 .. 0.4)" in alarm.line
    assert "cannot tell" in blind.line
    assert WearSummary("m", error="no data").level == Level.WARN
    assert WearSummary("m").line == "learning what is normal"


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
        return wear_from_statuses(decode_diagnostics(self.published[-1])[1])

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
    assert office.told.reference == pytest.approx(60.0, abs=0.02)
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
    (watch,) = office.told.watches
    assert 18 <= watch.blocks <= 23
    assert watch.alarms == 0


def test_what_grows_alarms_in_the_log_once_and_on_the_topic():
    office = Office(monitor=(f"{LEVEL}=100%",), monitor_false_alarms="per 0.1 h")
    office.hear(100.0)
    office.work()
    office.hear(100.0, 3, level=1.6)
    while office.monitoring.busy:
        office.work()
    (watch,) = office.told.watches
    assert office.told.state == watch.state == "alarm"
    assert office.told.level == Level.ERROR
    assert watch.first > 101 * SECOND
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
    assert office.told.watches[0].blocks > 0


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
    assert word in office.told.error
    assert word in office.log[-1]
    assert office.told.level == Level.WARN
    office.hear(30.0, 2)
    assert len(office.jobs) == 1
    assert not office.monitoring.busy


def test_a_stretch_that_cannot_be_read_leaves_what_was_known():
    office = Office(monitor=(f"{LEVEL}=60%",), monitor_false_alarms="per 1 h")
    office.hear(80.0)
    office.work()
    office.monitoring.follow(office.last)
    known = office.told.watches
    office.jobs[-1].failed("too few samples")
    assert office.told.watches == known
    assert office.told.error == "too few samples"
    assert office.told.level == Level.WARN


def test_nothing_is_watched_unless_asked_for():
    office = Office(monitor=())
    office.hear(80.0)
    assert office.jobs == []
    assert office.monitoring.health() == []
