"""Wear as diagnostic statuses and back: one for the monitor, one for each watched parameter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from idloop_nodes.codec.diagnostics import Level, Status
from idloop_nodes.codec.key_values import from_values, reading, to_values

LEARNING, ALARM, QUIET, CANNOT_TELL = "learning", "alarm", "quiet", "cannot_tell"


@dataclass(frozen=True)
class WatchSummary:
    """One parameter that is watched."""

    parameter: str
    unit: str
    value: float  # of the healthy machine [unit]
    watched: float  # growth that is to be noticed [unit]
    state: str  # ``alarm``, ``quiet`` or ``cannot_tell``
    able: bool = True  # whether the reference allows an alarm at all
    why: str = ""  # why it cannot tell; empty otherwise
    # Growth that the newest samples show, with its 95 % interval [unit]; None before any informative sample
    growth: float | None = None
    low: float | None = None
    high: float | None = None
    # Sum of log-likelihood ratios, and where it alarms
    evidence: float = 0.0
    threshold: float = float("inf")
    # Blocks, and the informative ones among them
    blocks: int = 0
    telling: int = 0
    # Expected time from the watched growth to its alarm in motions as recorded [s]; infinite where there is none
    delay: float = float("inf")
    alarms: int = 0  # raised so far
    # Stamps of the first and the newest alarm, and of the likeliest onset before the newest [ns]; 0 without alarms
    first: int = 0
    newest: int = 0
    onset: int = 0

    @property
    def level(self) -> Level:
        """An alarm is an error, a watch that can never alarm a warning; a machine at rest is neither."""
        if self.state == ALARM:
            return Level.ERROR
        return Level.OK if self.able else Level.WARN

    @property
    def line(self) -> str:
        """For a person."""
        grown = ""
        if self.growth is not None and self.low is not None and self.high is not None:
            grown = f"{self.growth:+.3g} {self.unit} ({self.low:.3g} .. {self.high:.3g})"
        if self.state == ALARM:
            return f"changed by {grown} against {self.value:.4g} {self.unit}" if grown else "changed"
        if self.state == QUIET:
            return f"no growth of {self.watched:.3g} {self.unit}; {grown}"
        return f"this data cannot tell: {self.why}"


@dataclass(frozen=True)
class WearSummary:
    """The monitor."""

    model: str  # name of the model
    state: str = LEARNING  # the worst of the watches' states, or ``learning``
    false_alarm_hours: float = 0.0  # running time between two false alarms [h]
    reference: float = 0.0  # length of the healthy reference [s]
    watches: tuple[WatchSummary, ...] = ()
    error: str = ""  # why the newest data were not looked at, one line; empty when they were

    @property
    def level(self) -> Level:
        """The worst of the watches' levels; at least a warning after an error."""
        worst = max((watch.level for watch in self.watches), default=Level.OK)
        return max(worst, Level.WARN) if self.error else worst

    @property
    def line(self) -> str:
        """For a person."""
        if self.error:
            return self.error
        alarms = [watch.parameter for watch in self.watches if watch.state == ALARM]
        if alarms:
            return f"wear: {', '.join(alarms)}"
        if not self.watches:
            return "learning what is normal"
        unsure = [watch.parameter for watch in self.watches if watch.state == CANNOT_TELL]
        if unsure:
            return f"no alarm; this data cannot tell about {', '.join(unsure)}"
        return f"no wear; one false alarm in {self.false_alarm_hours:.4g} h"


def wear_to_statuses(node: str, summary: WearSummary) -> list[Status]:
    """Return the statuses of ``estimator/wear``."""
    head = Status(f"{node}: wear", summary.line, summary.level, to_values(summary), summary.model)
    watches = [
        Status(f"{node}: {one.parameter}", one.line, one.level, to_values(one), one.parameter)
        for one in summary.watches
    ]
    return [head, *watches]


def wear_from_statuses(statuses: Sequence[Status]) -> WearSummary:
    """Return the summary that `wear_to_statuses` wrote; CdrError when it cannot be read."""
    with reading("estimator/wear", statuses) as values:
        watches = tuple(from_values(WatchSummary, one.values) for one in statuses[1:])
        return from_values(WearSummary, values, watches=watches)
