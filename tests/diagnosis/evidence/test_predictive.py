"""Evidence on samples that a fit has not seen."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idloop.diagnosis.evidence.predictive import FOLDS, Evidence, Scores, deal


@given(st.lists(st.integers(4, 3000), min_size=1, max_size=40))
def test_every_row_is_dealt_once(lengths: list[int]) -> None:
    starts = np.concatenate([[0], np.cumsum(lengths)])
    folds, blocks = deal(starts)
    assert len(folds) == FOLDS
    np.testing.assert_array_equal(np.sort(np.concatenate(folds)), np.arange(starts[-1]))
    np.testing.assert_array_equal(np.sort(np.concatenate(blocks)), np.arange(starts[-1]))


def test_stretches_that_hang_together_temper_the_evidence() -> None:
    _, blocks = deal(np.array([0, 4000]))
    alone = np.random.default_rng(1).normal(0.1, 1.0, 4000)
    together = np.empty(4000)
    for block, value in zip(blocks, np.random.default_rng(2).normal(0.1, 1.0, len(blocks)), strict=True):
        together[block] = value
    nothing = Scores(np.zeros(4000), blocks)
    one, other = Scores(alone, blocks).against(nothing), Scores(together, blocks).against(nothing)
    assert one.design_effect == pytest.approx(1.0, abs=0.6)
    assert other.design_effect == pytest.approx(4000 / len(blocks), rel=0.1)
    assert other.log < 0.1 * one.log


def test_improvement_and_probability() -> None:
    evidence = Evidence(difference=100.0, design_effect=10.0, spread=20.0, samples=1000)
    assert evidence.log == pytest.approx(10.0)
    assert evidence.improvement == pytest.approx(1.0 - np.exp(-0.1))
    assert evidence.distinguishable
    assert evidence.p_value(27) == pytest.approx(27 * np.exp(-10.0))
    assert Evidence(-5.0, 1.0, 1.0, 10).p_value(27) == 1.0
