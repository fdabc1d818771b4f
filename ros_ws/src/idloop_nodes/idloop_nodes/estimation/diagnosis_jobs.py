"""The estimator's orders about missing effects: diagnose, add the best effect, undo, suggest an experiment.

The ladder stays with the worker: the estimator keeps it as a pickle that it sends with the next order, because building
its models again would hold up the samples.
"""

from __future__ import annotations

import pickle
from dataclasses import dataclass
from typing import TYPE_CHECKING

from idloop.worker_process import Report
from idloop_nodes.codec import LadderSummary, MissingSummary, no_diagnosis

if TYPE_CHECKING:
    from idloop.physics import Model
    from idloop.records import Record

DIAGNOSE, ADD_BEST, UNDO, EFFECTS, SUGGEST = "diagnose", "add_best_effect", "undo", "effects", "suggest"
# As SUGGEST, which also runs the experiment: it is shown with its predicted motion before anything moves.
DESIGN = "design"


@dataclass(frozen=True)
class MotionLimits:
    """What a suggested experiment may do, as the excitation node declares it."""

    # None where nothing is declared
    amplitude: float | None = None
    position_min: float | None = None
    position_max: float | None = None
    velocity: float | None = None
    adds_to: str = "command"  # {"command", "reference"}: where the node's samples go
    absolute: bool = False  # whether they are the reference itself, not added to it

    @property
    def position(self) -> tuple[float, float] | None:
        """Range of positions; a reference stays within its own amplitude too. None where an end is open."""
        low, high = self.position_min, self.position_max
        if self.adds_to == "reference" and self.amplitude is not None:
            low = -self.amplitude if low is None else max(low, -self.amplitude)
            high = self.amplitude if high is None else min(high, self.amplitude)
        return None if low is None or high is None else (low, high)


@dataclass(frozen=True)
class DiagnosisAnswer:
    """Result of an order."""

    verb: str  # what was ordered
    stamp: int  # of the newest sample that was used [ns]
    state: bytes = b""  # pickle of the ladder and the newest diagnosis, for the next order; as before when it failed
    model: Model | None = None  # model to continue with where the order changed it
    missing: MissingSummary | None = None  # new contents of ``estimator/missing_effects``
    ladder: LadderSummary | None = None  # new contents of ``estimator/ladder``
    error: str = ""  # why the order could not be carried out, one line


@dataclass(frozen=True)
class DiagnosisOrder:
    """One order for the worker."""

    node: str  # name of the estimator
    verb: str  # method of `LadderState` that carries it out
    stamp: int  # of the newest sample [ns]
    model: Model  # as it is now; where there is no ladder yet, its start
    state: bytes = b""  # state that the last order returned; empty at the start
    records: tuple[Record, ...] = ()
    validation: tuple[Record, ...] = ()
    windows: tuple[tuple[int, int], ...] = ()  # first and last stamp of each stretch of data [ns]
    effects: tuple[str, ...] = ()  # for EFFECTS: what the model is to have beside those of its file, as text
    catalogue: tuple[str, ...] = ()  # candidate effects; the whole catalogue when empty
    level: float = 0.01  # family-wise error rate
    criterion: str = "auto"
    minimum_improvement: float = 0.01  # part by which an effect must reduce the errors on unseen samples
    seed: int = 0
    experiments: int = 0  # experiments among the records
    limits: MotionLimits = MotionLimits()  # for SUGGEST

    def carry_out(self, report: Report) -> DiagnosisAnswer:
        """Carry it out, in the worker."""
        from idloop_nodes.estimation.ladder_state import LadderState

        state = pickle.loads(self.state) if self.state else LadderState()  # noqa: S301  (our own estimator's)
        return getattr(state, self.verb)(self, report)  # type: ignore[no-any-return]

    def failed(self, reason: str) -> DiagnosisAnswer:
        """Return the answer when it could not be carried out; earlier results stay."""
        missing = None
        if self.verb == DIAGNOSE:
            missing = no_diagnosis(self.node, self.model, self.criterion, self.level, reason)
        return DiagnosisAnswer(self.verb, self.stamp, self.state, missing=missing, error=reason)
