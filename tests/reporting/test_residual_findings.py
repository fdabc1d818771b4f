"""What is left beside a verdict that reads as if it were noise."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from idloop.diagnosis import Candidate, Ladder
from idloop.diagnosis.ladder import Step
from idloop.physics import load_model
from idloop.physics.simulation import simulate
from idloop.records import Record
from idloop.reporting.estimates import parameter_estimates
from idloop.reporting.residual_findings import ResidualFinding, findings_on_records, residual_warnings
from idloop.reporting.verdicts import significant_not_added


@dataclass(frozen=True)
class Test:
    """As `idloop.validation.residual.ResidualTest`, as far as words need it."""

    __test__ = False

    name: str
    coloured: bool
    follows: bool
    ljung_box_p: float = 0.5
    cross_p: float = 0.5
    against: str = "input"


def left(record: str, name: str, *, white: bool = True, free: bool = True, against: str = "input") -> ResidualFinding:
    p = 0.5 if white else 1e-9
    return ResidualFinding(record, Test(name, not white, not free, p, 0.5 if free else 0.004, against))  # type: ignore[arg-type]


@pytest.mark.parametrize("verdict", ("adequate", "not_excited"))
def test_a_verdict_that_reads_like_noise_is_contradicted_where_it_must_be(verdict):
    assert residual_warnings(verdict, [left("a", "position"), left("a", "velocity")]) == []
    (line,) = residual_warnings(verdict, [left("a", "position", white=False), left("a", "velocity", white=False)])
    assert line.startswith(
        "but the one-step errors of position and velocity on the fitted data are not white (Ljung-Box p < 0.001)"
    )
    follows, coloured = residual_warnings(
        verdict, [left("a", "position", white=False, free=False), left("a", "velocity", white=False)]
    )
    assert follows.startswith(
        "but the one-step error of position on the fitted data still follows the command (p 0.004)"
    )
    assert coloured.startswith("but the one-step error of velocity on the fitted data is not white")
    (line,) = residual_warnings(verdict, [left("a", "position", free=False, against="reference")])
    assert line.startswith("but the one-step error of position on the fitted data still follows the reference")


@pytest.mark.parametrize(("share", "told"), [(1e-6, 0), (0.05, 1)])
def test_what_is_left_of_exact_data_is_no_structure(share: float, told: int):
    model = load_model("axis")
    time = np.arange(0.0, 4.0, 0.01)
    command = np.repeat(np.random.default_rng(1).normal(size=40), 10)
    output = simulate(model, time, command, time).output
    # What a coarser integration of the same equations would add.
    output = output * (1.0 + share * np.sin(time)[:, None])
    record = Record("a", time, command, time, output, "axis.effort", "N·m", model.output_names, ("rad", "rad/s"))
    assert len(residual_warnings("adequate", findings_on_records(model, [record]))) >= told
    assert bool(findings_on_records(model, [record])) is bool(told)


def test_of_several_records_it_says_in_how_many():
    (line,) = residual_warnings("adequate", [left("a", "position"), left("b", "position", white=False)])
    assert "position in 1 of 2 records of the fitted data is not white" in line


@pytest.mark.parametrize("verdict", ("unknown_structure", "missing"))
def test_a_verdict_that_says_so_already_is_not_contradicted(verdict):
    assert residual_warnings(verdict, [left("a", "position", white=False, free=False)]) == []


def test_what_was_significant_and_not_added_is_named():
    start = load_model("dc_motor")
    last = start.with_effects(["dead_zone@input(width=0.1)"])
    weak = Candidate("saturation", "input", "yes", "", "", gain=30.0, p_value=1e-5)
    cases = (
        weak,
        replace(weak, effect="gain_asymmetry", p_value=0.4),
        replace(weak, effect="imbalance", at="motor", gain=float("nan")),
        replace(weak, effect="coulomb_friction", at="motor"),  # a tie of the step
        replace(weak, effect="dead_zone"),  # added
        replace(weak, effect="input_offset", p_value=1e-7),
    )
    step = Step(Candidate("dead_zone", "input", "yes", "", ""), last, set=("dead_zone@input", "coulomb_friction@motor"))
    ladder = Ladder((Step(None, start), step), "adequate", candidates=cases)
    assert [one.name for one in significant_not_added(ladder)] == ["input_offset@input", "saturation@input"]


def test_the_parameters_are_those_of_a_fit_with_their_intervals():
    model = load_model("dc_motor")
    (first, *_), gain = model.free, next(p for p in model.parameters if p.name == "drive.gain")
    known = replace(
        model, parameters=tuple(replace(p, stderr=0.1) if p.name == "drive.gain" else p for p in model.parameters)
    )
    found = parameter_estimates(known)
    assert set(found) == set(model.free)
    low, high = found["drive.gain"]["interval"]
    assert (low, high) == pytest.approx((gain.value - 0.196, gain.value + 0.196), abs=1e-4)
    assert found["drive.gain"]["unit"] == gain.unit
    assert found[first]["interval"] == [None, None]
    assert found[first]["stderr"] is None
