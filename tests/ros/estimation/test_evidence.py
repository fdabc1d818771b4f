"""Weighing effects in the estimator: which samples are scored when, which estimates are trusted, what ends it all."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")
pytest.importorskip("rclpy", reason="no rclpy: run launch_scripts/test, or source a ROS 2")

from idloop.physics import load_model
from idloop.records.bags.cdr import SECOND
from idloop_nodes.codec import (
    EffectEvidence,
    FitSummary,
    MissingSummary,
    ParameterSummary,
    Status,
    decode_diagnostics,
    encode_diagnostics,
    evidence_from_statuses,
    parameters_from_statuses,
)
from idloop_nodes.descriptions import describe
from idloop_nodes.estimation.estimator_context import EstimatorContext
from idloop_nodes.estimation.evidence import EvidenceSchedule
from idloop_nodes.streams.sample_buffer import SampleBuffer

STEP = SECOND // 100
START = SECOND
GAIN = ParameterSummary("drive.gain", 8.0, 0.01, "N·m/V")
FIT = FitSummary("dc_motor", missed={"motor.position": 1.0})
FRICTION = EffectEvidence("coulomb_friction@motor", 12.0, 6 * SECOND, 200)
SLIP = EffectEvidence("slip@motor", -1.0)


class Bench:
    """The looks with a worker, a diagnosis and an end that only note what they are told."""

    def __init__(self, **values):
        table = {one.name: one.default for one in describe("estimator").parameters()}
        self.values = table | {"sample_time": 0.01, "evidence_period": 2.0, "diagnose_window": 4.0} | values
        self.jobs, self.diagnoses, self.ends, self.evidence, self.estimates = [], [], [], [], []
        self.busy = False
        self.missing = None
        self.buffer = SampleBuffer(2)
        self.stamp = START
        context = EstimatorContext("estimator", *[lambda text: None] * 3, self.values, self.buffer, self, self.publish)
        self.looks = EvidenceSchedule(
            context, load_model("dc_motor"), lambda: self.missing, self.diagnoses.append, self
        )

    def submit(self, work, done, failed):
        known = self.looks.summary
        self.jobs.append(SimpleNamespace(**work.keywords, done=done, failed=failed, known=known))

    def end(self):
        self.ends.append(self.looks.summary.ended)

    def publish(self, name, stamp, statuses):
        _, received = decode_diagnostics(encode_diagnostics(stamp, statuses))
        if name == "evidence":
            self.evidence.append(evidence_from_statuses(received))
        else:
            self.estimates.append(parameters_from_statuses(received))

    def drive(self, seconds):
        for _ in range(round(100 * seconds)):
            self.buffer.first = self.buffer.first or self.stamp
            self.buffer.commands.append(self.stamp, (float(self.stamp // STEP % 7),))
            self.buffer.outputs.append(self.stamp, (float(self.stamp // STEP % 11), float(self.stamp // STEP % 13)))
            self.looks.follow(self.stamp)
            self.stamp += STEP

    def answer(self, *candidates, looks=2, **more):
        job = self.jobs[-1]
        summary = replace(
            job.known, stamp=job.stamp, looks=looks, samples=200 * looks, seconds=2.0 * looks, threshold=7.9,
            candidates=candidates, **more,
        )  # fmt: skip
        job.done((b"state", summary))


def test_every_sample_is_scored_once_by_those_before_it():
    bench = Bench()
    spans = []
    for _ in range(4):
        bench.drive(2.0)
        if len(bench.jobs) > len(spans):
            job = bench.jobs[-1]
            first, last = job.new.start_ns, job.new.start_ns + round(1e9 * job.new.time[-1])
            spans.append((first, last))
            assert job.earlier.start_ns + round(1e9 * job.earlier.time[-1]) == first - STEP
            assert job.earlier.duration <= 4.0
            bench.answer()
    assert spans == [(START + k * 2 * SECOND, START + (k + 1) * 2 * SECOND - STEP) for k in (1, 2, 3)]
    assert [job.state for job in bench.jobs] == [b"", b"state", b"state"]


def test_in_real_time_a_look_waits_for_the_worker_and_then_scores_all_that_has_come():
    bench = Bench(mode="realtime")
    bench.busy = True
    bench.drive(7.0)
    assert not bench.jobs
    bench.busy = False
    bench.drive(0.01)
    assert bench.jobs[0].new.time.size == 501


def test_without_a_period_nobody_looks():
    bench = Bench(evidence_period=0.0)
    bench.drive(10.0)
    assert not bench.jobs
    assert bench.looks.oldest is bench.looks.due is None
    assert bench.looks.health() == []


def test_another_model_is_weighed_anew_and_an_answer_about_the_one_before_is_in_vain():
    bench = Bench()
    bench.drive(4.0)
    bench.looks.begin(load_model("dc_motor").with_effects(["dead_zone@input(width=0.1)"]))
    bench.answer(FRICTION)
    assert not bench.evidence
    bench.drive(2.0)
    assert bench.jobs[-1].state == b""
    assert bench.jobs[-1].known.effects == ("dead_zone@input",)
    assert bench.jobs[-1].new.start_ns == START + 4 * SECOND


def test_estimates_are_trusted_once_effects_have_been_weighed_and_nothing_is_missing():
    bench = Bench()
    bench.looks.take_fit(FIT, [GAIN], 1)
    assert not bench.estimates[-1][0].trusted
    bench.drive(4.0)
    bench.answer(SLIP, looks=1)
    assert not bench.estimates[-1][0].trusted
    bench.drive(2.0)
    bench.answer(SLIP)
    assert bench.estimates[-1][0].trusted
    assert bench.evidence[-1].parameters == tuple(bench.estimates[-1])
    bench.missing = MissingSummary((Status("e", values={"verdict": "missing", "set": "gravity@motor"}),))
    bench.looks.take_fit(FIT, [GAIN], 2)
    assert not bench.estimates[-1][0].trusted
    assert "gravity@motor" in bench.estimates[-1][0].why
    assert not bench.ends


def test_estimates_of_another_model_say_nothing_of_this_one():
    bench = Bench(end_when_decided=True)
    bench.looks.take_fit(replace(FIT, effects=("dead_zone@input",)), [GAIN], 1)
    assert bench.estimates[-1] == [GAIN]
    bench.drive(4.0)
    bench.answer(SLIP)
    assert not bench.ends


@pytest.mark.parametrize("candidates", [(FRICTION, SLIP), (SLIP,)])
def test_what_is_decided_or_trusted_ends_the_experiment_once_and_only_if_asked(candidates):
    for asked in (False, True):
        bench = Bench(end_when_decided=asked)
        bench.looks.take_fit(FIT, [GAIN], 1)
        bench.drive(4.0)
        bench.answer(*candidates)
        assert len(bench.ends) == asked
        assert bool(bench.evidence[-1].ended) is asked
        assert len(bench.diagnoses) == (asked and FRICTION in candidates)
        bench.drive(4.0)
        assert len(bench.jobs) == (1 if asked else 2), "after the end there is nothing to learn"
    bench.looks.restart()
    bench.drive(0.01)
    assert not bench.looks.summary.ended


@pytest.mark.parametrize("autopilot", ["auto_add", "auto_experiment"])
def test_a_graph_that_goes_on_by_itself_after_a_diagnosis_is_not_ended_by_it(autopilot):
    bench = Bench(end_when_decided=True, **{autopilot: True})
    bench.drive(4.0)
    bench.answer(FRICTION)
    assert not bench.ends


def test_a_stretch_that_cannot_be_scored_changes_nothing_that_was_known():
    bench = Bench()
    bench.drive(4.0)
    bench.answer(FRICTION)
    bench.drive(2.0)
    bench.jobs[-1].failed("the command never changes")
    assert bench.evidence[-1].candidates == (FRICTION,)
    assert bench.evidence[-1].error == "the command never changes"
    assert bench.evidence[-1].stamp == bench.jobs[-1].stamp
