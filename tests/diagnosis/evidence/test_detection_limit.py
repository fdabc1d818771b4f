"""Detection limits."""

import math
from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.diagnosis.conftest import record_of

from idloop.diagnosis.diagnose import diagnose
from idloop.diagnosis.evidence.detection_limit import DetectionLimit, detection_limit
from idloop.diagnosis.screening.proposals import Proposal, proposals
from idloop.diagnosis.screening.score_test import Screened, Trace
from idloop.physics import load_model
from idloop.reporting.verdicts import detection_limits

# Power of a trace that shows where chance reaches 9.
NEEDED = (2.5 * (3.0 + 1.645)) ** 2


def trace(trials: list[dict[str, float]], detectable: float, weakest: float | None = None) -> Trace:
    none = np.zeros((1, 0))
    return Trace(
        trials, 0.0, np.zeros(1), detectable, 1.0, none, np.zeros(0),
        detectable if weakest is None else weakest,
    )  # fmt: skip


def proposal(name: str) -> Proposal:
    (found,) = proposals(load_model("axis"), [name])
    return found


@given(st.floats(1e-3, 1e3), st.floats(1.0, 1e6))
def test_the_power_of_a_trace_grows_with_the_square_of_its_size(width: float, power: float) -> None:
    limit = detection_limit(Screened(proposal("dead_zone"), [trace([{"width": width}], power)]), 9.0)
    assert limit is not None
    assert limit.least == limit.sure == pytest.approx(2.5 * width * (3.0 + 1.645) / math.sqrt(power))
    assert limit.undetectable(0.99 * limit.least)
    assert DetectionLimit.from_dict(limit.to_dict()) == limit


def test_a_soft_joint_shows_up_to_a_stiffness() -> None:
    values = {"stiffness": 100.0, "damping": 0.1, "split": 0.5}
    stiffer = {**values, "stiffness": 200.0}
    traces = [trace([values], 4.0 * NEEDED), trace([stiffer], 1.01 * NEEDED), trace([stiffer], 0.99 * NEEDED)]
    limit = detection_limit(Screened(proposal("compliance"), traces), 9.0)
    assert limit is not None
    assert limit.least == 200.0, "no limit beyond the trials"
    assert limit.undetectable(201.0)
    assert not limit.undetectable(199.0)
    assert limit.text.startswith("it would show with stiffness ≤ 200 N·m/rad")
    limit = detection_limit(Screened(proposal("compliance"), [trace([values], 0.25 * NEEDED)]), 9.0)
    assert limit is not None
    assert limit.least == pytest.approx(50.0)


def test_each_shape_has_the_limit_of_its_nearest_trial() -> None:
    slow = [{"amplitude": 1.0, "harmonic": 2.0, "phase": 0.0}], [{"amplitude": 0.1, "harmonic": 2.0, "phase": 0.0}]
    fast = [{"amplitude": 1.0, "harmonic": 9.0, "phase": 0.0}]
    traces = [trace(slow[0], 1e9), trace(slow[1], NEEDED), trace(fast, NEEDED, 0.0)]
    limit = detection_limit(Screened(proposal("cogging"), traces), 9.0)
    assert limit is not None
    assert limit.least == pytest.approx(0.1)
    assert limit.sure == math.inf
    assert limit.to_dict()["sure"] is None


def test_what_begins_at_a_level_or_cannot_be_simulated_has_no_limit() -> None:
    assert detection_limit(Screened(proposal("saturation"), [trace([{"limit": 1.0}], 9.0)]), 9.0) is None
    assert detection_limit(Screened(proposal("dead_zone"), []), 9.0) is None


@dataclass
class _Ladder:
    model: object
    limits: dict[str, DetectionLimit]
    untestable: tuple[str, ...] = ()
    added: tuple[str, ...] = ()
    steps: tuple[object, ...] = field(default=())
    passed_over: dict[str, str] = field(default_factory=dict)
    verdict: str = "adequate"


def test_a_report_states_no_size_for_what_was_found_or_cannot_be_shown() -> None:
    limit = DetectionLimit("level", "N·m", 0.01, 0.01)
    names = ("coulomb_friction@axis", "quadratic_drag@axis", "imbalance@axis", "cogging@axis")
    model = load_model("axis").with_effect("stribeck_friction", "axis", coulomb=0.1, static=0.2, velocity=0.1)
    ladder = _Ladder(model, dict.fromkeys(names, limit), untestable=(names[2],), passed_over={names[3]: "too slight"})
    assert detection_limits(ladder) == {"quadratic_drag@axis": "level ≥ 0.01 N·m"}  # type: ignore[arg-type]


@pytest.mark.slow
def test_an_effect_of_twice_the_stated_size_is_found_and_a_twentieth_of_it_is_not() -> None:
    machine = load_model("axis")
    clean = diagnose(machine, [record_of(machine, 1, disturbance=0.02)], effects=["dead_zone", "coulomb_friction"])
    assert not clean.set
    limit = clean.gate.limits["coulomb_friction@axis"]
    answers = []
    for part in (0.05, 2.0):
        stuck = machine.with_effect("coulomb_friction", "axis", level=part * limit.sure)
        record = record_of(stuck, 2, disturbance=0.02)
        answers.append(diagnose(machine, [record], effects=["dead_zone", "coulomb_friction"]).set)
    assert not answers[0]
    assert "coulomb_friction@axis" in answers[1]
