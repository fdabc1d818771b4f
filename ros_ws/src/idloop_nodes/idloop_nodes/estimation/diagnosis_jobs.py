"""What the estimator orders from its worker when something is missing: diagnose, add, take back, suggest.

The ladder stays with the worker's side: the estimator keeps it as a pickle that it hands back with the next
order, because building its models anew would hold up the samples.
"""

from __future__ import annotations

import pickle
from dataclasses import dataclass

from idloop_nodes.codec import MissingSummary
from idloop_nodes.estimation.diagnosis_orders import (
    ADD_BEST,
    DIAGNOSE,
    EFFECTS,
    SUGGEST,
    UNDO,
    DiagnosisAnswer,
    DiagnosisOrder,
    MotionLimits,
)
from idloop_nodes.estimation.worker import Report

__all__ = [
    "ADD_BEST",
    "DIAGNOSE",
    "EFFECTS",
    "SUGGEST",
    "UNDO",
    "DiagnosisAnswer",
    "DiagnosisJob",
    "MotionLimits",
]


@dataclass(frozen=True)
class DiagnosisJob(DiagnosisOrder):
    """One order, as the worker carries it out."""

    def work(self, report: Report) -> DiagnosisAnswer:
        """Carry it out."""
        from idloop_nodes.estimation.ladder_state import Notebook

        notebook = pickle.loads(self.notebook) if self.notebook else Notebook()  # noqa: S301  (our own estimator's)
        return getattr(notebook, self.verb)(self, report)  # type: ignore[no-any-return]

    def failed(self, reason: str) -> DiagnosisAnswer:
        """Return the answer of an order that could not be carried out; what was known stays known."""
        missing = None
        if self.verb == DIAGNOSE:
            missing = MissingSummary(
                self.model.name,
                tuple(self.model.effect_names),
                criterion=self.criterion,
                level=self.level,
                error=reason,
            )
        return DiagnosisAnswer(self.number, self.verb, self.stamp, self.notebook, None, missing, None, reason)
