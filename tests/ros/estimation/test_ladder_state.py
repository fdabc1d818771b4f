"""What the worker does with a finding, without data and without a graph."""

from __future__ import annotations

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop.diagnosis import Ladder, Step
from idloop_nodes.estimation.diagnosis_jobs import ADD_BEST, UNDO, DiagnosisOrder
from idloop_nodes.estimation.ladder_state import LadderState


def test_both_effects_of_a_pair_are_added_and_taken_back_one_by_one(missing_pair):
    gain, load = missing_pair.candidates
    start, first, both = missing_pair.model, missing_pair.alone.model, gain.model
    state = LadderState(Ladder((Step(None, start),)), missing_pair)
    job = DiagnosisOrder("estimator", ADD_BEST, 0, start)
    answer = state.add_best_effect(job, lambda share, text: None)
    assert answer.model is both
    assert state.ladder.added == (gain.name, load.name)
    assert [step.model for step in state.ladder.steps] == [start, first, both]
    assert state.ladder.steps[2].set == (load.name, "input_offset@input")
    assert state.ladder.steps[1].p_value == state.ladder.steps[2].p_value == 0.001
    state.undo(DiagnosisOrder("estimator", UNDO, 0, both), lambda share, text: None)
    assert state.ladder.added == (gain.name,)
