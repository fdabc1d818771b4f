"""Effects that mask each other: found together, and by chance no more often than the level."""

import numpy as np
import pytest

from idloop.diagnosis import Ladder, diagnose, refine
from idloop.diagnosis.diagnosis import tied_members
from idloop.diagnosis.screening.proposals import Proposal, proposals
from idloop.diagnosis.screening.score_test import Screen, Screened, Trace
from idloop.diagnosis.search.pairs import MOST_TRACES, Pairs
from idloop.estimation.likelihood.estimation_problem import prepare_estimation
from idloop.estimation.likelihood.refit import refit
from idloop.physics import Model, load_model
from idloop.physics.effect import BODY, Effect, EffectParameter
from idloop.physics.simulation import simulate
from idloop.records import Record

ROWS = 400


def an_effect(name: str, one_sided: bool = False, **more: object) -> Effect:
    low = 0.0 if one_sided else -np.inf
    return Effect(name, BODY, "It is there.", (EffectParameter("size", "-", min=low),), **more)  # type: ignore[arg-type]


def screened(
    columns: np.ndarray, errors: np.ndarray, one_sided: bool = False, effects: list[Effect] | None = None
) -> list[Screened]:
    """Every column as the only trace of an effect of its own."""
    base = load_model("axis")
    found = []
    for i, column in enumerate(columns.T):
        direction = column / np.linalg.norm(column)
        score = float(direction @ errors)
        effect = effects[i] if effects is not None else an_effect(f"effect_{i}", one_sided)
        statistic = 0.0 if one_sided and score < 0.0 else score**2
        size, scores = np.array([score / np.linalg.norm(column)]), np.array([score])
        trace = Trace([{"size": 1.0}], statistic, size, float(column @ column), 1.0, direction[:, None], scores)
        found.append(Screened(Proposal(effect, "axis", base), [trace]))
    return found


def two_columns(alike: float, seed: int = 0) -> np.ndarray:
    """Two directions with a given correlation."""
    q = np.linalg.qr(np.random.default_rng(seed).normal(size=(ROWS, 2)))[0]
    return np.column_stack([q[:, 0], alike * q[:, 0] + np.sqrt(1.0 - alike**2) * q[:, 1]])


@pytest.mark.parametrize("one_sided", [False, True])
def test_two_effects_that_compensate_each_other_are_found(one_sided: bool) -> None:
    columns = np.column_stack([two_columns(-0.95), np.random.default_rng(1).normal(size=(ROWS, 6))])
    errors = np.random.default_rng(2).normal(size=ROWS) + columns[:, :2] @ [20.0, 20.0]
    single = screened(columns, errors, one_sided)
    assert max(s.statistic for s in single) < 10.0
    pairs = Pairs(single)
    best = pairs.ranked()[0]
    assert {pairs.traces[i][0].name for i in (best.first, best.second)} == {"effect_0@axis", "effect_1@axis"}
    # Size of both in units of their standard deviation, from the normal equations.
    expected = 2.0 * 20.0**2 * (1.0 - 0.95)
    assert best.statistic == pytest.approx(expected, abs=4.0 * np.sqrt(4.0 * expected))


def test_the_joint_statistic_is_that_of_a_regression_on_both() -> None:
    columns = two_columns(0.7)
    errors = columns @ [30.0, -25.0] + np.random.default_rng(4).normal(size=ROWS)
    rest = errors - columns @ np.linalg.lstsq(columns, errors)[0]
    best = Pairs(screened(columns, errors)).ranked()[0]
    assert best.statistic == pytest.approx(float(errors @ errors - rest @ rest), rel=1e-9)


@pytest.mark.parametrize(("alike", "sizes"), [(-0.95, (-20.0, -20.0)), (0.95, (20.0, -20.0))])
def test_effects_that_can_only_grow_do_not_pair_with_a_wrong_sign(alike: float, sizes: tuple[float, float]) -> None:
    columns = two_columns(alike)
    errors = columns @ sizes
    assert Pairs(screened(columns, errors)).ranked()
    assert not Pairs(screened(columns, errors, one_sided=True)).ranked()


def test_effects_that_do_not_hide_each_other_are_no_pair() -> None:
    columns = two_columns(0.7)
    assert not Pairs(screened(columns, columns @ [20.0, 20.0])).ranked()


@pytest.mark.parametrize("alike", [0.995, -0.995, 0.05])
def test_parallel_and_orthogonal_traces_are_no_pair(alike: float) -> None:
    columns = two_columns(alike)
    assert not np.any(Pairs(screened(columns, np.zeros(ROWS))).allowed)


def test_an_effect_does_not_pair_with_one_that_contains_it() -> None:
    plain = an_effect("plain", one_sided=True)
    rich = an_effect("rich", one_sided=True, contains={"plain": {"size": "size"}})
    edge = an_effect("edge", one_sided=True, degenerates_to=("plain",))
    columns = two_columns(-0.8)
    for other in (rich, edge):
        assert not np.any(Pairs(screened(columns, np.zeros(ROWS), True, [plain, other])).allowed)
    assert np.any(Pairs(screened(columns, np.zeros(ROWS), True, [rich, edge])).allowed)


def test_what_takes_part_does_not_depend_on_the_errors() -> None:
    rng = np.random.default_rng(5)
    base, effects = load_model("axis"), [an_effect(f"effect_{i}") for i in range(20)]

    def search(errors: np.ndarray) -> Pairs:
        draws = np.random.default_rng(6)
        groups = []
        for effect in effects:
            traces = [s.traces[0] for s in screened(draws.normal(size=(ROWS, 15)), errors)]
            groups.append(Screened(Proposal(effect, "axis", base), traces))
        return Pairs(groups)

    one, other = search(np.zeros(ROWS)), search(10.0 * rng.normal(size=ROWS))
    assert len(one.traces) <= MOST_TRACES
    assert len({p.name for p, _ in one.traces}) == len(effects)
    assert np.array_equal(one.allowed, other.allowed)


def test_nothing_to_pair_is_no_error() -> None:
    for few in ([], screened(two_columns(0.5)[:, :1], np.zeros(ROWS))):
        pairs = Pairs(few)
        assert pairs.ranked() == []


def test_rivals_are_sorted_by_the_effect_whose_place_they_take() -> None:
    rivals = [("gain", "load"), ("lag", "drag"), ("lag", "offset")]
    assert tied_members("offset", "gain", rivals) == ("offset", "load")
    assert tied_members("gain", "offset", rivals) == ("gain", "lag")


# An axis whose drive pushes harder in one direction, against a load that takes just this away: the
# command is always about the same size, so that the two leave nearly opposite traces.
COMPENSATED = ["gain_asymmetry@input(ratio=0.01)", "load_torque@axis(torque=-0.01)"]


def record_of(machine: Model, seed: int) -> Record:
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 6.0, 0.005)
    steps = rng.choice([-1.0, 1.0], 25) * (1.0 + 0.3 * rng.uniform(-1.0, 1.0, 25))
    command = steps[(4.0 * time).astype(int)]
    noise = np.column_stack([rng.normal(size=len(time)) * float(o.noise or 0.0) for o in machine.outputs])
    output = simulate(machine, time, command, time, noise=noise).output
    names, units = tuple(o.name for o in machine.outputs), tuple(o.unit for o in machine.outputs)
    return Record("run", time, command, time, output, "axis.effort", machine.input.unit, names, units)


@pytest.fixture(scope="module")
def start() -> Model:
    model = load_model("axis")
    return model.with_values({p.name: 0.7 * p.value for p in model.parameters if p.free})


@pytest.fixture(scope="module")
def compensated() -> Record:
    return record_of(load_model("axis").with_effects(COMPENSATED), 1)


def test_two_effects_that_only_show_together_are_named(start: Model, compensated: Record) -> None:
    found = diagnose(start, [compensated])
    assert found.verdict == "missing"
    assert found.pair is not None
    assert found.best is not None
    assert found.best.name == found.pair[0] == "gain_asymmetry@input"
    # A constant load on the driven body and an offset of the command are the same equation.
    constants = {"load_torque@axis", "input_offset@input"}
    assert {found.pair[1], *found.rungs[1].set} == constants
    assert found.set == ("gain_asymmetry@input",)
    together = [c for c in found.candidates if c.name in {*found.pair, *constants}]
    assert all(c.p_value < 1e-6 for c in together)
    assert all(c.p_value > 0.05 for c in found.candidates if c not in together)
    assert found.best.model is found.candidates[1].model
    assert found.best.parameters["ratio"]["value"] == pytest.approx(0.01, rel=0.05)
    value = next(iter(found.candidates[1].parameters.values()))
    assert abs(value["value"]) == pytest.approx(0.01, rel=0.05)
    document = found.to_dict()
    assert document["pair"] == list(found.pair)
    assert len(document["rival_pairs"]) == 1
    assert found.pair[0] == "gain_asymmetry@input"


def test_either_effect_alone_explains_far_less_than_both(start: Model, compensated: Record) -> None:
    for name in ("gain_asymmetry", "load_torque"):
        # asked for one effect only, so with no catalogue to make up for, and still not at what both reach
        found = diagnose(start, [compensated], effects=[name], level=1e-5)
        assert found.best is None
        assert found.pair is None


@pytest.mark.slow
def test_the_ladder_takes_both_steps_and_keeps_both(start: Model, compensated: Record) -> None:
    unseen = record_of(load_model("axis").with_effects(COMPENSATED), 2)
    ladder = refine(start, [compensated], [unseen])
    assert ladder.added[0] == "gain_asymmetry@input"
    assert len(ladder.added) == 2
    assert set(ladder.steps[2].set) == {"load_torque@axis", "input_offset@input"}
    assert ladder.verdict == "adequate"
    first, second = ladder.steps[1:]
    assert first.p_value == second.p_value
    assert first.model.effect_names == ladder.added[:1]
    assert set(second.model.effect_names) == set(ladder.added)
    errors = [step.validation["nrmse"]["axis.velocity"] for step in ladder.steps]
    assert errors[2] < min(errors[:2])
    again = Ladder.from_dict(ladder.to_dict())
    assert again.added == ladder.added
    # With room for one effect only there is no half of a pair.
    assert refine(start, [compensated], [unseen], most=1).added == ()


def test_sketches_preserve_the_inner_products_of_traces(start: Model, compensated: Record) -> None:
    estimation = prepare_estimation(start, [compensated], "prediction")
    screen = Screen(estimation, refit(estimation, start), seed=0)
    names = ["coulomb_friction", "quadratic_drag", "gain_asymmetry", "load_torque", "dead_zone", "input_delay"]
    traces = screen.all(proposals(screen.parent.model, names))
    for trace in (t for s in traces for t in s.traces if len(t.scores) == len(t.trials) == 1):
        # A positive score asks for a positive size, whichever way a factorisation has turned the direction.
        assert trace.size[0] == pytest.approx(trace.scores[0] / np.sqrt(trace.detectable), rel=1e-9)
    pairs = Pairs(traces)
    ranked = pairs.ranked()
    assert ranked
    for scored in ranked[:5]:
        (one, first), (other, second) = pairs.traces[scored.first], pairs.traces[scored.second]
        joint = screen.joint((one, first.trials[0]), (other, second.trials[0]))
        assert joint is not None
        assert joint.statistic * joint.uneven == pytest.approx(scored.statistic, rel=0.15, abs=0.5)
