import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from idloop.validation.breakdown import Breakdown, break_down, sums
from idloop.validation.edges import MOST_BINS, decade_edges, few_levels, level_edges, round_edges, since_edges

N = 80
VALUES = arrays(float, N, elements=st.floats(-1e3, 1e3, allow_subnormal=False))
ERRORS = arrays(float, N, elements=st.floats(-1e3, 1e3, allow_subnormal=False))


def by_velocity(values: np.ndarray, error: np.ndarray) -> Breakdown:
    return break_down("velocity", "velocity of motor", "rad/s", values, error, round_edges(values))


@given(VALUES, ERRORS)
def test_every_sample_and_all_of_the_error_is_in_exactly_one_bin(values: np.ndarray, error: np.ndarray) -> None:
    found = by_velocity(values, error)
    assert np.sum(found.error) == pytest.approx(1.0)
    assert np.sum(found.usual) == pytest.approx(1.0)
    assert np.all(found.error >= 0.0)
    assert len(found.names) == len(found.error) == len(found.mean) == len(found.rms)


@given(VALUES, ERRORS, st.randoms(use_true_random=False))
def test_the_order_of_the_samples_does_not_matter(values: np.ndarray, error: np.ndarray, random) -> None:
    order = list(range(N))
    random.shuffle(order)
    one, two = by_velocity(values, error), by_velocity(values[order], error[order])
    np.testing.assert_allclose(one.error, two.error, atol=1e-9)
    np.testing.assert_array_equal(one.usual, two.usual)
    np.testing.assert_allclose(one.mean, two.mean, atol=1e-9)


@given(VALUES, ERRORS, st.floats(1e-3, 1e3))
def test_the_unit_of_the_error_moves_means_and_not_shares(values: np.ndarray, error: np.ndarray, scale: float) -> None:
    one, two = by_velocity(values, error), by_velocity(values, -scale * error)
    np.testing.assert_allclose(one.error, two.error, atol=1e-9)
    np.testing.assert_allclose(-scale * one.mean, two.mean, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(scale * one.rms, two.rms, rtol=1e-6, atol=1e-6)
    assert one.follows == pytest.approx(two.follows, abs=1e-6)


@given(VALUES, ERRORS)
def test_means_and_rms_add_up_to_those_of_the_whole(values: np.ndarray, error: np.ndarray) -> None:
    found = by_velocity(values, error)
    filled = found.usual > 0.0
    assert np.all(np.isnan(found.mean[~filled]))
    weight, mean, rms = found.usual[filled], found.mean[filled], found.rms[filled]
    assert weight @ mean == pytest.approx(np.mean(error), abs=1e-6)
    assert weight @ rms**2 == pytest.approx(np.mean(error**2), abs=1e-6)
    assert np.all(np.abs(mean) <= rms * (1.0 + 1e-9) + 1e-9)
    assert -1e-9 <= found.follows <= 1.0 + 1e-9


@given(VALUES, ERRORS)
def test_the_worst_part_is_made_of_its_bins_and_is_worse_than_usual(values: np.ndarray, error: np.ndarray) -> None:
    found = by_velocity(values, error)
    worst = found.worst
    bins = slice(worst.first, worst.last + 1)
    assert worst.error == pytest.approx(np.sum(found.error[bins]))
    assert worst.usual == pytest.approx(np.sum(found.usual[bins]))
    assert worst.error >= worst.usual - 1e-9
    assert found.stands_out == (worst.error - worst.usual >= 0.1)


def test_the_worst_part_is_where_the_error_was_put() -> None:
    values = np.linspace(-1.0, 1.0, 2001)
    found = by_velocity(values, np.where((values > 0.2) & (values < 0.6), 1.0, 0.01))
    assert found.edges is not None
    assert found.edges[found.worst.first] == pytest.approx(0.2)
    assert found.edges[found.worst.last + 1] == pytest.approx(0.6)
    assert (
        found.worst.text == "100 % of the error falls in the 20 % of the time at velocities between 0.2 and 0.6 rad/s"
    )
    assert found.worst.mean == pytest.approx(1.0, abs=0.01)


def test_an_error_that_is_a_curve_follows_its_variable() -> None:
    values = np.linspace(-1.0, 1.0, 4000)
    assert by_velocity(values, np.sign(values)).follows > 0.97
    assert by_velocity(values, np.where(np.arange(4000) % 2, 1.0, -1.0)).follows < 0.01
    # A constant part is no curve.
    assert by_velocity(values, np.full(4000, 3.0)).follows == pytest.approx(0.0, abs=1e-9)


def test_no_error_is_spread_as_the_time_is() -> None:
    values = np.linspace(-1.0, 1.0, 100)
    found = by_velocity(values, np.zeros(100))
    np.testing.assert_array_equal(found.error, found.usual)
    assert not found.stands_out
    assert found.follows == 0.0


def test_a_turn_closes() -> None:
    angle = np.linspace(0.0, 360.0, 3600, endpoint=False)
    error = np.where((angle < 30.0) | (angle >= 330.0), 1.0, 0.0)
    found = break_down("position", "position", "°", angle, error, np.linspace(0.0, 360.0, 13), circular=True)
    assert (found.worst.first, found.worst.last) == (11, 0)
    assert found.worst.text.endswith("between 330° and 30° of a turn")
    assert found.worst.usual == pytest.approx(1 / 6)


def test_samples_before_the_first_event_are_a_kind_of_their_own() -> None:
    since = np.concatenate([np.full(50, np.inf), np.linspace(0.0, 1.0, 50)])
    error = np.concatenate([np.full(50, 2.0), np.ones(50)])
    edges = since_edges(since[50:])
    found = break_down("since_reversal", "time since reversal", "s", since, error, edges, "before the first reversal")
    assert found.names[-1] == "before the first reversal"
    assert found.error[-1] == pytest.approx(0.8)
    assert found.worst.text == "80 % of the error falls in the 50 % of the time before the first reversal"
    assert found.to_dict()["bins"][-1]["from"] is None


def test_kinds_are_not_neighbours() -> None:
    index = np.repeat([0, 1, 2], 10)
    kinds = ("moving backward", "standing", "moving forward")
    found = Breakdown("direction", "direction", "", None, kinds, *sums(index, 1.0 + index, 3))
    assert found.worst.text == "64 % of the error falls in the 33 % of the time moving forward"


def test_huge_errors_have_shares_too() -> None:
    values = np.linspace(0.0, 1.0, 100)
    found = by_velocity(values, np.full(100, 1e200))
    np.testing.assert_allclose(found.error, found.usual)


@given(VALUES, st.floats(0.0, 10.0))
def test_edges_are_few_and_enclose_the_values(values: np.ndarray, floor: float) -> None:
    edges = round_edges(values, floor)
    assert np.all(np.diff(edges) > 0.0)
    assert len(edges) <= MOST_BINS + 3
    room = 0.05 * max(edges[-1] - edges[0], 1e-12)
    assert edges[0] <= np.min(values) + room
    assert edges[-1] >= np.max(values) - room


def test_edges_are_round_numbers() -> None:
    values = np.linspace(-0.097, 0.101, 500)
    np.testing.assert_allclose(round_edges(values), 0.02 * np.arange(-5, 6), atol=1e-12)


def test_standing_gets_its_own_bin() -> None:
    edges = round_edges(np.linspace(-1.0, 1.0, 500), floor=0.0204)
    assert {-0.02, 0.02} <= set(edges)
    assert 0.0 not in edges


def test_few_levels_are_told_apart() -> None:
    levels = few_levels(np.array([-1.0, 0.0, 2.0, 2.0 + 1e-12, -1.0]))
    assert levels is not None
    np.testing.assert_allclose(levels, [-1.0, 0.0, 2.0])
    np.testing.assert_allclose(level_edges(levels), [-1.5, -0.5, 1.0, 3.0])
    assert few_levels(np.linspace(0.0, 1.0, 100)) is None
    assert few_levels(np.zeros(5)) is None


@given(st.floats(1e-4, 1e3), st.floats(1.1, 1e5))
def test_decades_lie_between_their_ends(low: float, ratio: float) -> None:
    edges = decade_edges(low, low * ratio)
    assert np.all((edges > low) & (edges < low * ratio))
    assert np.all(np.diff(edges) > 0.0)


@given(arrays(float, 50, elements=st.floats(0.0, 100.0, allow_subnormal=False)))
def test_edges_since_an_event_start_at_it(since: np.ndarray) -> None:
    edges = since_edges(since)
    assert edges[0] == 0.0
    assert np.all(np.diff(edges) > 0.0)
    assert edges[-1] >= np.max(since)
