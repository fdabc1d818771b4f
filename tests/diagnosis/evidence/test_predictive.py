"""Evidence on samples that a fit has not seen."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idloop.diagnosis.evidence.predictive import FOLDS, Course, Evidence, Scores, deal


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


def test_the_course_of_the_evidence_ends_with_it() -> None:
    _, blocks = deal(np.array([0, 1000, 1500]))
    better = np.random.default_rng(3).normal(0.1, 0.3, 1500)
    found = Scores(better, blocks, start=2.0).against(Scores(np.zeros(1500), blocks))
    assert found.course.samples[-1] == found.samples == 1500
    assert found.course.log_e[-1] == pytest.approx(found.log)
    # In the order of time: the first stretch is the beginning of the first record.
    assert found.course.log_e[0] == pytest.approx(np.sum(better[blocks[0]]) / found.design_effect + 2.0)
    # Of more choices, as of pairs, the same threshold takes as much less.
    assert found.course.less(3.0).log_e[-1] == pytest.approx(found.log - 3.0)


@pytest.mark.parametrize(
    ("log_e", "place"), [((1.0, 9.0, 7.0, 8.0, 12.0), 3), ((9.0, 9.0), 0), ((9.0, 7.0), None), ((), None)]
)
def test_an_effect_is_decided_where_its_evidence_stays_above_the_threshold(
    log_e: tuple[float, ...], place: int | None
) -> None:
    assert Course(tuple(range(len(log_e))), log_e).decided(8.0) == place


def test_improvement_and_probability() -> None:
    evidence = Evidence(difference=100.0, design_effect=10.0, spread=20.0, samples=1000)
    assert evidence.log == pytest.approx(10.0)
    assert evidence.improvement == pytest.approx(1.0 - np.exp(-0.1))
    assert evidence.distinguishable
    assert evidence.p_value(27) == pytest.approx(27 * np.exp(-10.0))
    assert Evidence(-5.0, 1.0, 1.0, 10).p_value(27) == 1.0
