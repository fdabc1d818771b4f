"""The estimator's jobs about missing effects: diagnose, add the best effect, undo, suggest an experiment.

The ladder stays with the worker: the estimator keeps it as a pickle that it sends with the next job, because building
its models again would hold up the samples.
"""

from __future__ import annotations

import pickle
from dataclasses import dataclass
from typing import TYPE_CHECKING

from idloop.worker_process import Report
from idloop_nodes.codec import LadderSummary, MissingSummary

if TYPE_CHECKING:
    from idloop.physics import Model
    from idloop.records import Record

DIAGNOSE, ADD_BEST, UNDO, EFFECTS, SUGGEST = "diagnose", "add_best_effect", "undo", "effects", "suggest"


@dataclass(frozen=True)
class MotionLimits:
    """What a suggested experiment may do, as the excitation node declares it.

    Attributes
    ----------
    amplitude, position_min, position_max, velocity : float or None
        None where nothing is declared.
    adds_to : {"command", "reference"}
        Where the node's samples go.
    absolute : bool
        Whether they are the reference itself, not added to it.
    """

    amplitude: float | None = None
    position_min: float | None = None
    position_max: float | None = None
    velocity: float | None = None
    adds_to: str = "command"
    absolute: bool = False

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
    """Result of a job.

    Attributes
    ----------
    number : int
        Of the job.
    verb : str
        What was ordered.
    stamp : int
        Of the newest sample that was used [ns].
    state : bytes
        Pickle of the ladder and the newest diagnosis, for the next job; as before when the job failed.
    model : Model or None
        Model to continue with where the job changed it.
    missing : MissingSummary or None
        New contents of ``estimator/missing_effects``.
    ladder : LadderSummary or None
        New contents of ``estimator/ladder``.
    error : str
        Why the job could not be done, one line.
    """

    number: int
    verb: str
    stamp: int
    state: bytes = b""
    model: Model | None = None
    missing: MissingSummary | None = None
    ladder: LadderSummary | None = None
    error: str = ""


@dataclass(frozen=True)
class DiagnosisJob:
    """One order.

    Attributes
    ----------
    number : int
    verb : str
        Method of `LadderState` that does it.
    stamp : int
        Of the newest sample [ns].
    model : Model
        As it is now; where there is no ladder yet, its start.
    state : bytes
        State that the last job returned; empty at the start.
    records, validation : tuple of Record
    windows : tuple of (int, int)
        First and last stamp of each stretch of data [ns].
    effects : tuple of str
        For EFFECTS: what the model is to have beside those of its file, as text.
    catalogue : tuple of str
        Candidate effects; the whole catalogue when empty.
    level : float
        Family-wise error rate.
    criterion : str
    minimum_improvement : float
        Part by which an effect must reduce the errors on unseen samples.
    seed : int
    experiments : int
        Experiments among the records.
    limits : MotionLimits
        For SUGGEST.
    """

    number: int
    verb: str
    stamp: int
    model: Model
    state: bytes = b""
    records: tuple[Record, ...] = ()
    validation: tuple[Record, ...] = ()
    windows: tuple[tuple[int, int], ...] = ()
    effects: tuple[str, ...] = ()
    catalogue: tuple[str, ...] = ()
    level: float = 0.01
    criterion: str = "auto"
    minimum_improvement: float = 0.01
    seed: int = 0
    experiments: int = 0
    limits: MotionLimits = MotionLimits()
    replaceable: bool = False

    def work(self, report: Report) -> DiagnosisAnswer:
        """Do it."""
        from idloop_nodes.estimation.ladder_state import LadderState

        state = pickle.loads(self.state) if self.state else LadderState()  # noqa: S301  (our own estimator's)
        return getattr(state, self.verb)(self, report)  # type: ignore[no-any-return]

    def failed(self, reason: str) -> DiagnosisAnswer:
        """Return the answer of a job that could not be done; earlier results stay."""
        missing = None
        if self.verb == DIAGNOSE:
            effects = tuple(self.model.effect_names)
            missing = MissingSummary(self.model.name, effects, criterion=self.criterion, level=self.level, error=reason)
        return DiagnosisAnswer(self.number, self.verb, self.stamp, self.state, None, missing, None, reason)
