"""State of the page: plain objects that a live graph or a set of recordings fill in, and the page shows."""

from __future__ import annotations

import hashlib
import math
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from idloop.diagnosis import Candidate, Ladder, Step, UnknownStructure
    from idloop.diagnosis.design.suggest import Suggestion
    from idloop.physics import Model
    from idloop.reporting.figures.effects import Decided
    from idloop.reporting.residual_findings import ResidualFinding
    from idloop.reporting.workbench.assessment import Assessment
    from idloop.reporting.workbench.signals import Signals
    from idloop.validation.characteristic import Characteristic

# What a live graph may do automatically.
AUTOMATIC = ("add", "experiment")

OK, WARN, ERROR, STALE = 0, 1, 2, 3  # as in diagnostic_msgs

# What is known of the stop, see `Snapshot`.
FREE, SENT, STOPPED, RELEASING = "", "sent", "stopped", "releasing"

_LATELY = 2.0  # seconds; a page that can be seen asks more often

ORDERS = ("assess", "diagnose", "add", "undo", "design", "experiment", "refit", "reset", "show", "automatic")


# By the identity of a model, which is kept: a page asks for the same two or three of them several times a second.
_versions: dict[int, tuple[Model, str]] = {}
_MOST_VERSIONS = 8


def model_version(model: Model) -> str:
    """Short checksum of a model with its values: equal for what is computed from the same model."""
    if id(model) not in _versions:
        if len(_versions) >= _MOST_VERSIONS:
            _versions.clear()
        _versions[id(model)] = model, hashlib.sha256(model.to_yaml().encode()).hexdigest()[:8]
    return _versions[id(model)][1]


@dataclass(frozen=True)
class Health:
    """One check of one node."""

    name: str  # ``node: check``
    level: int = OK  # OK, WARN, ERROR or STALE
    message: str = ""
    values: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Fit:
    """What the newest fit is worth on samples that it did not use."""

    # FIT by output [%] on samples after the fit's window, and on those of the fit
    unseen: Mapping[str, float] = field(default_factory=dict)
    seen: Mapping[str, float] = field(default_factory=dict)
    seconds: float = 0.0  # length of the unseen samples [s]
    effects: tuple[str, ...] = ()  # in the model that was fitted
    error: str = ""  # why there is no fit; empty when there is one


@dataclass(frozen=True)
class Missing:
    """What the newest diagnosis found."""

    verdict: str = ""  # ``missing``, ``adequate``, ``unknown_structure`` or ``not_excited``
    line: str = ""  # the verdict for a person
    candidates: tuple[Candidate, ...] = ()  # best first
    set: tuple[str, ...] = ()  # effects that this data cannot distinguish from the best one, that one included
    pair: tuple[str, ...] = ()  # two that show only together
    # What this data cannot show, and what it can
    untestable: tuple[str, ...] = ()
    findings: tuple[str, ...] = ()
    unknown: UnknownStructure | None = None
    error: str = ""  # why there is no diagnosis; empty when there is one
    # Effects that are significant and were not taken for what is missing, and why
    passed_over: Mapping[str, str] = field(default_factory=dict)
    left: tuple[ResidualFinding, ...] = ()  # residual tests of the model on the fitted data


@dataclass(frozen=True)
class TrustedEstimate:
    """One estimate of a live graph, with its 95 % interval, whether it may be trusted, and why."""

    name: str
    text: str
    trusted: bool
    why: str


@dataclass(frozen=True)
class Evidence:
    """How the evidence for missing effects has grown, on a live graph or over a recording."""

    line: str = ""  # the newest look for a person
    effects: tuple[str, ...] = ()  # of the model that they were weighed against
    seconds: tuple[float, ...] = ()  # new samples that had been scored at each look [s]
    # Log-evidence at each look by effect; NaN before an effect was weighed
    lines: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    threshold: float = float("inf")  # log-evidence that decides
    decided: Mapping[str, Decided] = field(default_factory=dict)
    estimates: tuple[TrustedEstimate, ...] = ()
    ended: str = ""  # why the experiment has been ended; empty where it has not
    recorded: bool = False  # of a recording: every stretch is scored by fits to the others


@dataclass(frozen=True)
class Activity:
    """What is being worked out, and what waits for it; `share` is None while nobody knows how far it is."""

    text: str
    share: float | None = None
    then: str = ""


@dataclass(frozen=True)
class Note:
    """An answer to the reader, with the level of a `Health`."""

    text: str
    level: int = OK


@dataclass(frozen=True)
class Snapshot:
    """Everything that the page shows beside the streams."""

    version: int = 0  # grows with every change
    live: bool = False  # a graph that runs, not recordings
    title: str = ""
    model: Model | None = None  # the present one, behind every number
    fit: Fit | None = None
    missing: Missing | None = None
    evidence: Evidence | None = None
    looks: int = 0  # diagnoses that have come in so far
    ladder: Ladder | None = None
    suggested: Mapping[str, Any] | None = None  # the next experiment as `idloop suggest` writes it
    suggestion: Suggestion | None = None  # the same with its rivals, for the figures; a live graph sends none
    activity: Activity | None = None
    note: Note | None = None  # answer to the last order
    health: tuple[Health, ...] = ()
    limits: tuple[tuple[str, str], ...] = ()  # what an experiment may do: name, value with unit
    # Those of `AUTOMATIC` that are switched on; None where there is nothing to switch
    automatic: tuple[str, ...] | None = None
    # `FREE`; `SENT`: the stop is set or asked for, and not seen to work; `STOPPED`: the last node before the motor has
    # confirmed it, and neutral commands have been seen since; `RELEASING`: the reset is asked for
    stop: str = FREE
    moves: bool = False  # there is a motor that a button could move
    assessment: Assessment | None = None  # where the model fails
    # Of effects that may be missing, by ``effect@site``; None while they are being drawn
    pictures: Mapping[str, Characteristic] | None = field(default_factory=dict)
    recordings: tuple[str, ...] = ()  # that may be shown, and `shown`, which of them is
    shown: int = 0
    # Paths of the recordings that are fitted, and of those that no fit sees; empty where nobody has said
    bags: tuple[str, ...] = ()
    validate: tuple[str, ...] = ()
    options: tuple[str, ...] = ()  # words of the command line for how they are judged
    # A file that is there and the version of the model in it, as `model_version` gives it; empty where there is none
    model_file: tuple[str, str] = ("", "")
    inspected: tuple[str, ...] = ()  # what the inspection says of the recordings that are fitted
    # What the next model has or lacks while it is computed: until then no number of the present one is the newest
    computing: str = ""
    reason: str = ""  # why the present model is another one than that with which the page was opened
    # The model as the page was opened with it, where the first step of the ladder has other values
    given: Step | None = None

    @property
    def effects(self) -> tuple[str, ...]:
        """Effects of the present model."""
        return () if self.model is None else tuple(self.model.effect_names)

    @property
    def assessed(self) -> bool:
        """Whether `assessment` is of the present model; on a live graph of one with the same effects."""
        found = self.assessment
        if found is None or self.model is None:
            return False
        if self.live:  # which is fitted again all the time
            return tuple(found.model.effect_names) == self.effects
        return model_version(found.model) == model_version(self.model)

    @property
    def fitted(self) -> bool:
        """Whether `fit` is of the present model."""
        return self.fit is not None and self.fit.effects == self.effects

    @property
    def pending(self) -> bool:
        """Whether another model is being computed: no number of the present one is the newest."""
        outrun = self.live and self.fit is not None and not self.fit.error and not self.fitted
        return bool(self.computing) or outrun


class State:
    """The newest snapshot; any thread may change and read it."""

    def __init__(self, first: Snapshot) -> None:
        self._lock = threading.Lock()
        self._snapshot = first
        self._looked = -math.inf

    @property
    def snapshot(self) -> Snapshot:
        """The newest one."""
        return self._snapshot

    @property
    def looked_at(self) -> bool:
        """Whether a browser has asked for it of late."""
        return time.monotonic() - self._looked < _LATELY

    def look(self) -> Snapshot:
        """The newest one, for a browser."""
        self._looked = time.monotonic()
        return self._snapshot

    def change(self, **values: Any) -> None:
        """Put new values in; the version grows where something has really changed."""
        with self._lock:
            before = self._snapshot
            same = (getattr(before, name) is value or getattr(before, name) == value for name, value in values.items())
            if not all(same):
                self._snapshot = replace(before, version=before.version + 1, **values)


class Source(Protocol):
    """What a page is made for: a live graph or recordings."""

    state: State
    signals: Signals

    def order(self, verb: str, what: str = "") -> str:
        """Start one of `ORDERS`; what comes of it appears in the state.

        `what`: ``effect@site`` for ``add``, the number of a recording for ``show``, one of `AUTOMATIC` with `` on`` or
        `` off`` for ``automatic``.
        Returns: what was started, for the reader.
        Raises InputError: it cannot be given now, and why.
        """

    def file(self, name: str) -> bytes:
        """Content of one of `idloop.reporting.workbench.files.offered`; InputError where there is none now."""

    def stop(self) -> str:
        """Stop the motor at once, whatever else goes on; return what was done."""
