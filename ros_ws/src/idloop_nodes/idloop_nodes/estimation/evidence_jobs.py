"""The estimator's job to score effects on the newest samples, and its answer.

The scores stay with the worker: the estimator keeps them as a pickle that it sends with the next job.
"""

from __future__ import annotations

import pickle
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from idloop.worker_process import Report
from idloop_nodes.codec import EffectEvidence, EvidenceSummary

if TYPE_CHECKING:
    from idloop.diagnosis.evidence.live_evidence import LiveEvidence
    from idloop.physics import Model
    from idloop.records import Record


@dataclass(frozen=True)
class EvidenceAnswer:
    """Result of a job."""

    number: int  # of the job
    state: bytes  # pickle of the evidence; empty before the first job
    summary: EvidenceSummary  # without the estimates


@dataclass(frozen=True)
class EvidenceJob:
    """Score a stretch of samples by fits to earlier ones."""

    number: int
    stamp: int  # of the end of the stretch [ns]
    model: Model  # against which effects are scored
    state: bytes  # pickle of the evidence so far; empty at the start
    # Samples that are fitted, and the stretch after them
    earlier: Record
    new: Record
    known: EvidenceSummary  # newest result before it
    level: float = 0.01
    minimum_improvement: float = 0.01
    catalogue: tuple[str, ...] = ()  # candidate effects; the whole catalogue when empty
    replaceable: bool = False

    def work(self, report: Report) -> EvidenceAnswer:
        """Score it."""
        from idloop.diagnosis.evidence.live_evidence import LiveEvidence

        before = LiveEvidence(self.model, self.level, self.minimum_improvement, self.catalogue)
        evidence: LiveEvidence = pickle.loads(self.state) if self.state else before  # noqa: S301  (our own estimator's)
        evidence = evidence.update([self.earlier], self.new, self.stamp)
        return EvidenceAnswer(self.number, pickle.dumps(evidence), summarise_evidence(evidence, self.stamp))

    def failed(self, reason: str) -> EvidenceAnswer:
        """Return the answer of a stretch that could not be scored; earlier results stay."""
        return EvidenceAnswer(self.number, self.state, replace(self.known, stamp=self.stamp, error=reason))


def summarise_evidence(evidence: LiveEvidence, stamp: int) -> EvidenceSummary:
    """Return the contents of ``estimator/evidence``, without the estimates."""
    decided = evidence.decided
    candidates = []
    for name, log_e in evidence.logs.items():
        when = decided.get(name)
        stamp_, samples = (None, None) if when is None else (when.stamp, when.samples)
        candidates.append(EffectEvidence(name, log_e, stamp_, samples, evidence.pending(name)))
    return EvidenceSummary(
        evidence.model.name,
        tuple(evidence.model.effect_names),
        stamp,
        evidence.level,
        evidence.threshold,
        evidence.looks,
        evidence.samples,
        evidence.seconds,
        tuple(candidates),
        evidence.doubtful,
    )
