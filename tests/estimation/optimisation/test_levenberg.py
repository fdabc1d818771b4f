from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from idloop.estimation.optimisation.levenberg import Minimum, minimise

WIDE = np.full(2, np.inf)
INSTANTS = np.linspace(0.0, 3.0, 40)


def rosenbrock(x: np.ndarray) -> np.ndarray:
    return np.array([10.0 * (x[1] - x[0] ** 2), 1.0 - x[0]])


def decaying(x: np.ndarray) -> np.ndarray:
    """Misfit of a decaying exponential, with errors so that something is left at the minimum."""
    errors = np.sin(40.0 * INSTANTS)
    return np.asarray(20.0 * (x[0] * np.exp(-x[1] * INSTANTS) - 2.0 * np.exp(-1.5 * INSTANTS)) + errors)


def counted(
    function: Callable[[np.ndarray], np.ndarray],
    start: list[float],
    low: list[float],
    high: list[float],
    quick: bool,
    tolerance: float = 1e-12,
    leading: int | None = None,
) -> tuple[Minimum, int]:
    """Minimum and how often the function was evaluated for it."""
    count = 0

    def evaluated(x: np.ndarray) -> np.ndarray:
        nonlocal count
        count += 1
        return function(x)

    found = minimise(
        evaluated, np.array(start), np.array(low), np.array(high), np.ones(len(start)),
        max_iterations=200, tolerance=tolerance, quick=quick, leading=leading,
    )  # fmt: skip
    return found, count


def test_rosenbrock() -> None:
    found = minimise(
        rosenbrock, np.array([-1.2, 1.0]), -WIDE, WIDE, np.ones(2), max_iterations=200, tolerance=1e-14,
    )  # fmt: skip
    assert found.point == pytest.approx([1.0, 1.0], abs=1e-4)


def test_an_exact_jacobian_replaces_differences() -> None:
    def slopes(x: np.ndarray) -> np.ndarray:
        return np.array([[-20.0 * x[0], 10.0], [-1.0, 0.0]])

    evaluated = 0

    def counting(x: np.ndarray) -> np.ndarray:
        nonlocal evaluated
        evaluated += 1
        return rosenbrock(x)

    found = minimise(
        counting, np.array([-1.2, 1.0]), -WIDE, WIDE, np.ones(2), max_iterations=200, tolerance=1e-20,
        derivative=slopes,
    )  # fmt: skip
    assert found.point == pytest.approx([1.0, 1.0], abs=1e-8)
    # One evaluation a trial step: nothing was spent on differences.
    assert evaluated < 3 * found.iterations


@given(st.lists(st.floats(-3.0, 3.0), min_size=2, max_size=2), st.integers(0, 1000))
def test_stays_in_the_box_and_never_gets_worse(start: list[float], seed: int) -> None:
    rng = np.random.default_rng(seed)
    matrix, target = rng.normal(size=(5, 2)), rng.normal(size=5)
    low, high = np.array([-1.0, 0.0]), np.array([1.0, 2.0])

    def residual(x: np.ndarray) -> np.ndarray:
        assert np.all(x >= low - 1e-12) or np.any(np.abs(x - np.clip(x, low, high)) < 0.1)
        return np.asarray(matrix @ x - target)

    begin = np.clip(start, low, high)
    found = minimise(residual, begin, low, high, np.ones(2))
    assert np.all((found.point >= low) & (found.point <= high))
    assert found.cost <= 0.5 * np.sum(residual(begin) ** 2) + 1e-12


def test_bound_holds_a_parameter_and_the_other_is_right() -> None:
    # The free minimum is at (-1, 2); with the first held at 0 the other moves to 1.5.
    matrix = np.array([[1.0, 0.5], [0.5, 1.0], [0.3, 0.3]])
    target = matrix @ np.array([-1.0, 2.0])
    found = minimise(
        lambda x: matrix @ x - target, np.array([1.0, 0.0]), np.array([0.0, -9.0]), WIDE, np.ones(2), tolerance=1e-12
    )
    expected = matrix[:, 1] @ target / (matrix[:, 1] @ matrix[:, 1])
    assert found.point == pytest.approx([0.0, expected], abs=1e-6)
    assert found.converged


def test_jacobian_beside_a_bound() -> None:
    found = minimise(
        lambda x: np.array([x[0] ** 2 + x[0], x[1]]) * 100.0,
        np.zeros(2), np.zeros(2), WIDE, np.ones(2),
    )  # fmt: skip
    assert found.jacobian[:, 0] == pytest.approx([100.0, 0.0], rel=1e-3)


def test_a_parameter_without_influence_does_not_move() -> None:
    found = minimise(lambda x: np.array([x[0] - 3.0]), np.array([0.0, 7.0]), -WIDE, WIDE, np.ones(2), tolerance=1e-12)
    assert found.point == pytest.approx([3.0, 7.0])


def test_values_that_cannot_be_simulated_are_stepped_around() -> None:
    found = minimise(
        lambda x: np.array([np.sqrt(x[0]) - 0.1 if x[0] > 0 else np.nan]),
        np.array([4.0]), np.array([-np.inf]), np.array([np.inf]), np.ones(1), tolerance=1e-12,
    )  # fmt: skip
    assert found.point[0] == pytest.approx(0.01, abs=1e-3)


@pytest.mark.parametrize(
    ("function", "start", "low", "high", "expected"),
    [
        (rosenbrock, [-1.2, 1.0], [-9.0, -9.0], [9.0, 9.0], [1.0, 1.0]),
        (rosenbrock, [3.0, 3.0], [-9.0, -9.0], [9.0, 9.0], [1.0, 1.0]),
        (rosenbrock, [0.5, 1.0], [-9.0, -9.0], [0.8, 9.0], [0.8, 0.64]),
        (rosenbrock, [0.5, 1.0], [-9.0, -9.0], [9.0, 0.5], None),
        (decaying, [1.0, 0.3], [0.0, 0.0], [9.0, 9.0], None),
        (decaying, [4.0, 0.9], [0.0, 0.0], [9.0, 1.0], None),
        (decaying, [3.0, 1.0], [2.5, 0.0], [9.0, 9.0], None),
    ],
)
def test_a_quick_search_ends_at_the_same_minimum_with_fewer_evaluations(
    function: Callable[[np.ndarray], np.ndarray],
    start: list[float],
    low: list[float],
    high: list[float],
    expected: list[float] | None,
) -> None:
    plain, many = counted(function, start, low, high, quick=False)
    quick, few = counted(function, start, low, high, quick=True)
    assert quick.converged
    assert quick.point == pytest.approx(plain.point if expected is None else expected, abs=1e-4)
    assert quick.cost == pytest.approx(plain.cost, rel=1e-6, abs=1e-10)
    assert few < 0.5 * many


def test_a_poorly_determined_nuisance_does_not_prolong_the_search() -> None:
    matrix = 100.0 * np.random.default_rng(1).normal(size=(40, 2))

    def residual(x: np.ndarray) -> np.ndarray:
        # The others run down a curved valley of their own.
        return np.concatenate([matrix @ (x[:2] - [1.0, 2.0]), rosenbrock(x[2:])])

    start, box = [0.0, 0.0, -1.2, 1.0], ([-np.inf] * 4, [np.inf] * 4)
    all_of_it, many = counted(residual, start, *box, quick=True, tolerance=1e-5)
    asked, few = counted(residual, start, *box, quick=True, tolerance=1e-5, leading=2)
    assert asked.converged
    # A third of a standard error, as for any quick search.
    error = np.sqrt(np.diag(np.linalg.inv(matrix.T @ matrix)))
    for found in (asked, all_of_it):
        assert np.all(np.abs(found.point[:2] - [1.0, 2.0]) < error / 3.0)
    assert few < many


@given(st.lists(st.floats(-2.0, 2.0), min_size=3, max_size=3), st.integers(0, 1000))
def test_a_quick_search_ends_well_within_a_standard_error(start: list[float], seed: int) -> None:
    rng = np.random.default_rng(seed)
    matrix, errors = np.eye(30, 3) + 0.3 * rng.normal(size=(30, 3)), rng.normal(size=30)

    def bent(x: np.ndarray) -> np.ndarray:
        return 20.0 * (matrix @ x + 0.2 * np.sin(matrix @ x))

    def residual(x: np.ndarray) -> np.ndarray:
        return np.asarray(bent(x) - bent(np.array([1.0, -0.5, 0.2])) + errors)

    unbounded = [-np.inf] * 3, [np.inf] * 3
    plain, many = counted(residual, start, *unbounded, quick=False, tolerance=1e-5)
    quick, few = counted(residual, start, *unbounded, quick=True, tolerance=1e-5)
    # In the log-likelihood a third of a standard error is 0.05.
    assert quick.cost == pytest.approx(plain.cost, abs=0.05)
    assert few < many
    np.testing.assert_array_equal(quick.residual, residual(quick.point))


@given(seed=st.integers(0, 10_000), quick=st.booleans())
def test_the_minimum_in_a_box_is_that_of_scipy(seed: int, quick: bool) -> None:
    random = np.random.default_rng(seed)
    matrix = random.standard_normal((6, 3)) * 10.0 ** random.uniform(-1.0, 1.0, 3)
    offset, start = 5.0 * random.standard_normal(6), random.uniform(-1.0, 1.0, 3)
    one = np.ones(3)
    found = minimise(lambda x: matrix @ x - offset, start, -one, one, one, quick=quick)
    assert found.cost == pytest.approx(lsq_linear(matrix, offset, (-1.0, 1.0), tol=1e-12).cost, abs=1e-3)


@pytest.mark.parametrize("quick", [False, True])
@pytest.mark.parametrize(
    ("start", "low", "high"), [([0.5, 0.2], [-9.0, -9.0], [0.8, 9.0]), ([-2.0, 2.0], [-3.0, -3.0], [0.8, 3.0])]
)
def test_a_step_clipped_by_the_box_is_no_convergence(
    start: list[float], low: list[float], high: list[float], quick: bool
) -> None:
    found = minimise(
        rosenbrock, np.array(start), np.array(low), np.array(high), np.ones(2), max_iterations=100, quick=quick
    )
    assert found.point == pytest.approx([0.8, 0.64], abs=1e-3)
