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
    from idloop.reporting.figures.evidence import Decided
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

ORDERS = ("assess", "diagnose", "add", "undo", "experiment", "refit", "reset", "show", "automatic")


# Models with their versions: a page asks for those of the same two or three of them several times a second.
_versions: dict[int, tuple[Model, str]] = {}
_MOST_VERSIONS = 8


def model_version(model: Model) -> str:
    """Short checksum of a model with its values: equal for what is computed from the same model."""
    known = _versions.get(id(model))
    if known is None or known[0] is not model:
        if len(_versions) >= _MOST_VERSIONS:
            _versions.clear()
        known = _versions[id(model)] = model, hashlib.sha256(model.to_yaml().encode()).hexdigest()[:8]
    return known[1]


@dataclass(frozen=True)
class Health:
    """One check of one node.

    Attributes
    ----------
    name : str
        ``node: check``.
    level : int
        OK, WARN, ERROR or STALE.
    """

    name: str
    level: int = OK
    message: str = ""
    values: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Fit:
    """What the newest fit is worth on samples that it did not use.

    Attributes
    ----------
    unseen, seen : dict of str to float
        FIT by output [%] on samples after the fit's window, and on those of the fit.
    seconds : float
        Length of the unseen samples [s].
    effects : tuple of str
        In the model that was fitted.
    error : str
        Why there is no fit; empty when there is one.
    """

    unseen: Mapping[str, float] = field(default_factory=dict)
    seen: Mapping[str, float] = field(default_factory=dict)
    seconds: float = 0.0
    effects: tuple[str, ...] = ()
    error: str = ""


@dataclass(frozen=True)
class Missing:
    """What the newest diagnosis found.

    Attributes
    ----------
    verdict : str
        ``missing``, ``adequate``, ``unknown_structure`` or ``not_excited``.
    line : str
        The verdict for a person.
    candidates : tuple of Candidate
        Best first.
    set : tuple of str
        Effects that this data cannot distinguish from the best one, that one included.
    pair : tuple of str
        Two that show only together.
    untestable, findings : tuple of str
        What this data cannot show, and what it can.
    passed_over : mapping of str to str
        Effects that are significant and were not taken for what is missing, and why.
    left : tuple of ResidualFinding
        Residual tests of the model on the fitted data.
    error : str
        Why there is no diagnosis; empty when there is one.
    """

    verdict: str = ""
    line: str = ""
    candidates: tuple[Candidate, ...] = ()
    set: tuple[str, ...] = ()
    pair: tuple[str, ...] = ()
    untestable: tuple[str, ...] = ()
    findings: tuple[str, ...] = ()
    unknown: UnknownStructure | None = None
    error: str = ""
    passed_over: Mapping[str, str] = field(default_factory=dict)
    left: tuple[ResidualFinding, ...] = ()


@dataclass(frozen=True)
class TrustedEstimate:
    """One estimate of a live graph, with its 95 % interval, whether it may be trusted, and why."""

    name: str
    text: str
    trusted: bool
    why: str


@dataclass(frozen=True)
class Evidence:
    """How the evidence for missing effects has grown, on a live graph or over a recording.

    Attributes
    ----------
    line : str
        The newest look for a person.
    effects : tuple of str
        Of the model that they were weighed against.
    seconds : tuple of float
        New samples that had been scored at each look [s].
    lines : mapping of str to tuple of float
        Log-evidence at each look by effect; NaN before an effect was weighed.
    threshold : float
        Log-evidence that decides.
    ended : str
        Why the experiment has been ended; empty where it has not.
    recorded : bool
        Of a recording: every stretch is scored by fits to the others.
    """

    line: str = ""
    effects: tuple[str, ...] = ()
    seconds: tuple[float, ...] = ()
    lines: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    threshold: float = float("inf")
    decided: Mapping[str, Decided] = field(default_factory=dict)
    estimates: tuple[TrustedEstimate, ...] = ()
    ended: str = ""
    recorded: bool = False


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
    """Everything that the page shows beside the streams.

    Attributes
    ----------
    version : int
        Grows with every change.
    live : bool
        A graph that runs, not recordings.
    model : Model or None
        The present one, behind every number.
    looks : int
        Diagnoses that have come in so far.
    suggested : dict or None
        The next experiment as `idloop suggest` writes it.
    suggestion : Suggestion or None
        The same with its rivals, for the figures; a live graph sends none.
    note : Note or None
        Answer to the last order.
    limits : tuple of (str, str)
        What an experiment may do: name, value with unit.
    automatic : tuple of str, or None
        Those of `AUTOMATIC` that are switched on; None where there is nothing to switch.
    stop : str
        `FREE`; `SENT`: the stop is set or asked for, and not seen to work; `STOPPED`: the last node before the motor
        has confirmed it, and neutral commands have been seen since; `RELEASING`: the reset is asked for.
    moves : bool
        There is a motor that a button could move.
    assessment : Assessment or None
        Where the model fails.
    pictures : dict of str to Characteristic, or None
        Of effects that may be missing, by ``effect@site``; None while they are being drawn.
    recordings : tuple of str
        That may be shown, and `shown`, which of them is.
    bags, validate : tuple of str
        Paths of the recordings that are fitted, and of those that no fit sees; empty where nobody has said.
    options : tuple of str
        Words of the command line for how they are judged.
    model_file : (str, str)
        A file that is there and the version of the model in it, as `model_version` gives it; empty where there is none.
    inspected : tuple of str
        What the inspection says of the recordings that are fitted.
    computing : str
        What the next model has or lacks while it is computed: until then no number of the present one is the newest.
    reason : str
        Why the present model is another one than that with which the page was opened.
    given : Step or None
        The model as the page was opened with it, where the first step of the ladder has other values.
    """

    version: int = 0
    live: bool = False
    title: str = ""
    model: Model | None = None
    fit: Fit | None = None
    missing: Missing | None = None
    evidence: Evidence | None = None
    looks: int = 0
    ladder: Ladder | None = None
    suggested: Mapping[str, Any] | None = None
    suggestion: Suggestion | None = None
    activity: Activity | None = None
    note: Note | None = None
    health: tuple[Health, ...] = ()
    limits: tuple[tuple[str, str], ...] = ()
    automatic: tuple[str, ...] | None = None
    stop: str = FREE
    moves: bool = False
    assessment: Assessment | None = None
    pictures: Mapping[str, Characteristic] | None = field(default_factory=dict)
    recordings: tuple[str, ...] = ()
    shown: int = 0
    bags: tuple[str, ...] = ()
    validate: tuple[str, ...] = ()
    options: tuple[str, ...] = ()
    model_file: tuple[str, str] = ("", "")
    inspected: tuple[str, ...] = ()
    computing: str = ""
    reason: str = ""
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

        Parameters
        ----------
        what : str
            ``effect@site`` for ``add``, the number of a recording for ``show``, one of `AUTOMATIC` with `` on`` or
            `` off`` for ``automatic``.

        Returns
        -------
        str
            What was started, for the reader.

        Raises
        ------
        InputError
            It cannot be given now, and why.
        """

    def file(self, name: str) -> bytes:
        """Content of one of `idloop.reporting.workbench.files.offered`; InputError where there is none now."""

    def stop(self) -> str:
        """Stop the motor at once, whatever else goes on; return what was done."""
