"""Scores of blocks: what others explain is taken out, and overlapping stretches count once."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from idloop.monitoring.block_scores import Scores, efficient_score, join


def made(k, blocks, seed, change=None, samples=40):
    """Blocks of a linear model with white errors of unit variance."""
    rng = np.random.default_rng(seed)
    slopes = rng.normal(size=(blocks, samples, k))
    errors = rng.normal(size=(blocks, samples)) + (0.0 if change is None else slopes @ change)
    gradient = np.einsum("bsk,bs->bk", slopes, errors)
    return Scores(np.arange(blocks), gradient, np.einsum("bsk,bsj->bkj", slopes, slopes))


@given(seed=st.integers(0, 1000), other=st.floats(-3.0, 3.0), own=st.floats(-1.0, 1.0))
def test_a_change_of_another_parameter_does_not_show(seed, other, own):
    same = efficient_score(made(3, 20, seed, np.array([own, 0.0, 0.0])), 0, np.ones(3))
    moved = efficient_score(made(3, 20, seed, np.array([own, other, -other])), 0, np.ones(3))
    assert np.allclose(same.information, moved.information)
    # What is left is held back by the bound of ten typical changes alone.
    assert np.allclose(same.gradient, moved.gradient, atol=0.05 * (1.0 + abs(other)))


def test_the_estimate_of_each_block_is_that_of_least_squares():
    scores = made(3, 5, 1, np.array([0.5, 1.0, -2.0]))
    found = efficient_score(scores, 0, 1e4 * np.ones(3))
    exact = [np.linalg.solve(h, g)[0] for g, h in zip(scores.gradient, scores.information, strict=True)]
    assert np.allclose(found.gradient / found.information, exact, rtol=1e-6)
    assert np.allclose(found.information, [1 / np.linalg.inv(h)[0, 0] for h in scores.information], rtol=1e-6)


def test_where_another_explains_all_nothing_is_left():
    scores = made(1, 10, 3)
    twin = Scores(
        scores.index, np.repeat(scores.gradient, 2, axis=1), np.repeat(np.repeat(scores.information, 2, 1), 2, 2)
    )
    assert np.all(efficient_score(twin, 0, np.ones(2)).information < 1e-2 * scores.information[:, 0, 0])


def test_alone_nothing_is_taken_out():
    scores = made(1, 4, 5)
    found = efficient_score(scores, 0, np.ones(1))
    assert np.array_equal(found.gradient, scores.gradient[:, 0])


def test_overlapping_stretches_count_once():
    scores = made(2, 10, 7)
    first, second = (
        Scores(scores.index[p], scores.gradient[p], scores.information[p]) for p in (slice(0, 7), slice(5, 10))
    )
    whole = join([first, second])
    assert np.array_equal(whole.index, scores.index)
    assert np.array_equal(whole.gradient, scores.gradient)
