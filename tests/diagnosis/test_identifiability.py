"""The identifiability check counts what a comparison counts, and gives detection limits."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idloop.diagnosis.evidence.detection_limit import DetectionLimit, needed_power
from idloop.diagnosis.identifiability import NOT_REPEATED, _reversals, excitation_findings, gate, limited_to
from idloop.diagnosis.screening.proposals import proposals
from idloop.diagnosis.screening.score_test import Screened, Trace
from idloop.diagnosis.screening.typical_sizes import Sizes
from idloop.estimation.dataset import prepare
from idloop.estimation.likelihood.estimation_problem import EstimationProblem, prepare_estimation
from idloop.physics import load_model
from idloop.physics.model_file import from_text
from idloop.records import Record
from idloop.validation.operating_state import operating_state, since_reversal

from .conftest import record_of

TIME = np.arange(0.0, 10.0, 1e-3)


@pytest.mark.parametrize("hidden", [None, 0, 1])
@pytest.mark.parametrize("small", [0.0, 0.006])
def test_reversals_are_counted_as_a_comparison_counts_them(hidden: int | None, small: float) -> None:
    random = np.random.default_rng(0)
    w = 0.4 * np.pi
    # A motion that turns every 2.5 s, and swings of less than a hundredth of its range that turn it oftener.
    position = -np.cos(w * TIME) / w + small * np.sin(5.0 * np.pi * TIME)
    output = np.column_stack([position, np.gradient(position, TIME)]) + random.normal(size=(TIME.size, 2)) * [
        1e-5,
        1e-3,
    ]
    if hidden is not None:
        output[:, hidden] = np.nan
    model = load_model("dc_motor")
    units = tuple(one.unit for one in model.outputs)
    record = Record("r", TIME, np.sin(TIME), TIME, output, model.input.name, "V", model.output_names, units)
    (data,) = prepare(model, [record])
    direction = operating_state(model, data, "motor").direction
    assert direction is not None
    counted = len(since_reversal(data.time, direction)[1])
    assert _reversals(model, data) == counted
    assert (counted == 3) == (small == 0.0)


def test_the_command_of_a_stiff_loop_is_said_in_its_own_unit() -> None:
    """What effects at the input act on is the force of the loop, hundreds of times the set-point."""
    model = from_text(
        """
schema: idloop/model/1
name: servo
input: {joint: arm, field: position, unit: rad}
outputs: [{joint: arm, field: position, unit: rad, noise: 0.001}]
bodies: [{name: arm, inertia: 1.0, viscous_friction: 30.0}]
drive: {kind: position_loop, proportional: 500.0}
""",
        None,
    )
    found = excitation_findings(model, prepare_estimation(model, [record_of(model, 0, seconds=3.0)], "prediction"))
    largest = float(found[0].split("command up to ")[1].split(" rad")[0])
    assert largest < 10.0
    assert not any("one size only" in text for text in found)


@pytest.mark.parametrize(
    ("signs", "said"), [((1.0, 1.0), "friction and backlash hardly show"), ((1.0, -1.0), ": backlash hardly shows")]
)
def test_records_in_opposite_directions_show_friction(signs: tuple[float, float], said: str) -> None:
    """As stairs of the speed up one way, and then up the other way."""
    model = load_model("dc_motor")
    units = tuple(one.unit for one in model.outputs)
    speed = 1.0 + np.floor(TIME)
    records = [
        Record(
            "r",
            TIME,
            sign * speed,
            TIME,
            sign * np.column_stack([np.cumsum(speed) * 1e-3, speed]),
            model.input.name,
            "V",
            model.output_names,
            units,
        )
        for sign in signs
    ]
    found = excitation_findings(model, prepare_estimation(model, records, "prediction"))
    assert any(text.startswith("the axis reverses 0 times") and text.endswith(said) for text in found), found


@pytest.fixture(scope="module")
def estimation() -> EstimationProblem:
    model = load_model("axis")
    return prepare_estimation(model, [record_of(model, 0, seconds=3.0)], "prediction")


@pytest.mark.parametrize(
    ("name", "size", "power", "message"),
    (
        ("sensor_offset@position[axis]", {"offset": 1.0}, 1e-3, "larger than the whole travel of "),
        ("dead_zone@input", {"width": 1.0}, 1e-3, "larger than the largest command of "),
        ("gain_asymmetry@input", {"ratio": 0.1}, 1e-3, "larger than it can be, 0.95, so"),
        ("coulomb_friction@axis", {"level": 1.0}, 1e-3, "it would show with level ≥ "),
        ("dead_zone@input", {"width": 1e-3}, 1.0, "it would show with width ≥ "),
    ),
)
def test_no_size_is_named_that_the_machine_cannot_have(
    estimation: EstimationProblem, name: str, size: dict[str, float], power: float, message: str
) -> None:
    model = load_model("axis")
    (proposal,) = proposals(model, [name])
    trace = Trace([size], 0.0, np.zeros(1), power, 1.0, np.zeros((1, 0)), np.zeros(0), power)
    found = gate(model, estimation, [Screened(proposal, [trace])], 9.0)
    assert found.testable[name] == "no"
    assert message in found.why[name]
    assert ("this experiment cannot show it" in found.why[name]) == ("≥" not in found.why[name])


@pytest.mark.parametrize(("typical", "answer"), [(0.5, "weak"), (2.0, "yes")])
def test_an_effect_is_testable_whose_typical_size_is_above_the_detection_limit(
    estimation: EstimationProblem, typical: float, answer: str
) -> None:
    chance, (proposal,) = 9.0, proposals(load_model("axis"), ["coulomb_friction"])
    power = typical**2 * needed_power(chance)
    trace = Trace([{"level": 1.0}], 0.0, np.zeros(1), power, 1.0, np.zeros((1, 0)), np.zeros(0), power, typical=power)
    found = gate(load_model("axis"), estimation, [Screened(proposal, [trace])], chance)
    assert found.testable[proposal.name] == answer
    assert (found.limits[proposal.name].least < 1.0) is (answer == "yes")


def test_of_a_size_that_depends_on_the_shape_only_what_can_be_is_named() -> None:
    limit = DetectionLimit("offset", "m", 0.1, 5.3)
    assert limited_to(limit, 0.128).short == "offset ≥ 0.1 m"
    assert limited_to(limit, np.inf) == limit
    soft = replace(limit, at_most=True)
    assert limited_to(soft, 0.01) == soft


@pytest.mark.parametrize(
    ("name", "shape", "shown", "message"),
    (
        # The axis has 200 samples a second and an inertia of 0.01.
        ("input_delay@input", {"delay": 0.005}, "delay", "a delay of one sample, 5 ms, would not show: excite faster"),
        ("sensor_delay@velocity[axis]", {"delay": 0.005}, "delay", "a delay of one sample, 5 ms, would not show"),
        (
            "compliance@axis",
            {"stiffness": 0.0025 * (2.0 * np.pi * 20.0) ** 2, "damping": 0.1, "split": 0.5, "viscous_split": 0.5},
            "stiffness",
            "a joint that swings at more than ",
        ),
    ),
)
def test_effects_as_fast_as_the_samples_need_a_fast_excitation(estimation, name, shape, shown, message):
    """The trace of a delay of one sample, and of a joint that swings once in ten, weak and strong."""
    model = load_model("axis")
    (proposal,) = proposals(model, [name])

    def judged(power):
        trace = Trace([shape], 0.0, np.zeros(1), power, 1.0, np.zeros((1, 1)), np.zeros(1), power, typical=1e6)
        return gate(model, estimation, [Screened(proposal, [trace])], 20.0)

    weak, strong = judged(1.0), judged(1e4)
    assert (weak.testable[name], strong.testable[name]) == ("no", "yes")
    assert weak.why[name].startswith(message)
    assert weak.untestable == (name,)
    assert weak.limits[name].parameter == shown
    assert strong.untestable == ()


@given(turns=st.floats(0.0, 20.0), known=st.lists(st.integers(2, 400), max_size=3))
@pytest.mark.parametrize("name", ["cogging", "sensor_ripple@position[axis]"])
def test_a_wave_is_tried_where_the_motion_covers_two_of_its_periods(
    estimation: EstimationProblem, name: str, turns: float, known: list[int]
) -> None:
    """Where none of those that were found repeats, no other one is tried in their place."""
    model = load_model("axis")
    (proposal,) = proposals(model, [name])
    scales = replace(
        Sizes(model, estimation).at(proposal.effect.site, proposal.at), turns=turns, harmonics=tuple(known)
    )
    tried = {trial["harmonic"] for trials in proposal.alternatives(scales) for trial in trials}
    assert all(order * turns >= 2.0 for order in tried)


def test_a_wave_that_the_motion_does_not_repeat_is_said_to_be_a_curve() -> None:
    model = load_model("axis")
    record = record_of(model, 0, seconds=3.0)
    short = replace(record, output=record.output * [0.3 / np.ptp(record.output[:, 0]), 1.0])
    problem = prepare_estimation(model, [short], "prediction")
    (proposal,) = proposals(model, ["sensor_ripple@position[axis]"])
    screened = Screened(proposal, [], bool(proposal.alternatives(Sizes(model, problem).at("output", proposal.at))))
    assert gate(model, problem, [screened], 9.0).why[proposal.name] == NOT_REPEATED
