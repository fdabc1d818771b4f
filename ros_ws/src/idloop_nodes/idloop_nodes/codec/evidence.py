"""The evidence for missing effects as it grows, as diagnostic statuses and back, without loss."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass

from idloop.documents import read_json
from idloop_nodes.codec.diagnostics import Level, Status
from idloop_nodes.codec.key_values import as_json, reading
from idloop_nodes.codec.results import ParameterSummary

SCHEMA = "idloop/live_evidence/1"


@dataclass(frozen=True)
class EffectEvidence:
    """Evidence for one effect."""

    name: str  # ``effect@site``
    log_e: float  # log-evidence, natural logarithm
    # End of the stretch that decided it [ns], and measurements that had been scored by then; None while it is open
    decided_stamp: int | None = None
    decided_samples: int | None = None
    pending: str = ""  # why it is open although its evidence is above the threshold; empty where it is not

    @property
    def decided(self) -> bool:
        """Whether it has reached the threshold."""
        return self.decided_stamp is not None


@dataclass(frozen=True)
class EvidenceSummary:
    """Evidence after one stretch of samples."""

    model: str  # name of the model
    effects: tuple[str, ...] = ()  # effects that it has
    stamp: int = 0  # end of the newest stretch [ns]
    # Probability of deciding for any effect where nothing is missing, and the log-evidence that decides
    level: float = 0.01
    threshold: float = math.inf
    # Stretches and measurements that have been scored
    looks: int = 0
    samples: int = 0
    seconds: float = 0.0  # length of these [s]
    candidates: tuple[EffectEvidence, ...] = ()  # the most evidence first
    doubtful: tuple[str, ...] = ()  # not decided, and of better odds than one over the level
    parameters: tuple[ParameterSummary, ...] = ()  # newest estimates, and whether they may be trusted
    ended: str = ""  # why the experiment was ended; empty where it was not
    error: str = ""  # why the newest stretch was not scored; empty when it was

    @property
    def decided(self) -> tuple[str, ...]:
        """Effects that have reached the threshold, the first to do so first."""
        found = [(one.decided_stamp, one.name) for one in self.candidates if one.decided_stamp is not None]
        return tuple(name for _, name in sorted(found))

    @property
    def line(self) -> str:
        """For a person."""
        if self.error:
            return self.error
        if self.decided:
            found = f"decided: {', '.join(self.decided)}"
        elif self.candidates:
            best = self.candidates[0]
            found = f"nothing decided; most for {best.name}, log E {best.log_e:.1f} of {self.threshold:.1f}"
            found += f", but {best.pending}" if best.pending else ""
        else:
            found = "no candidate effect"
        return f"{found}; {self.seconds:.4g} s of new samples so far"


def evidence_to_statuses(node: str, summary: EvidenceSummary) -> list[Status]:
    """Return the statuses of ``estimator/evidence``: one for all, one for each effect."""
    values = {
        "stamp": str(summary.stamp),
        "threshold": repr(float(summary.threshold)),
        "samples": str(summary.samples),
        "seconds": repr(float(summary.seconds)),
        "decided": " ".join(summary.decided),
        "ended": summary.ended,
        "document": as_json({"schema": SCHEMA, **asdict(summary)}),
        "error": summary.error,
    }
    level = Level.WARN if summary.error or summary.decided else Level.OK
    head = Status(f"{node}: evidence", summary.line, level, values, summary.model)
    return [head, *(_status(node, one, summary.threshold) for one in summary.candidates)]


def _status(node: str, one: EffectEvidence, threshold: float) -> Status:
    values = {
        "log_e": repr(float(one.log_e)),
        "threshold": repr(float(threshold)),
        "decided": "true" if one.decided else "false",
        "decided_stamp": "" if one.decided_stamp is None else str(one.decided_stamp),
        "decided_samples": "" if one.decided_samples is None else str(one.decided_samples),
    }
    text = f"log E {one.log_e:.1f}{', decided' if one.decided else ''}"
    return Status(f"{node}: {one.name}", text, Level.WARN if one.decided else Level.OK, values, one.name)


def evidence_from_statuses(statuses: Sequence[Status]) -> EvidenceSummary:
    """Return the summary that `evidence_to_statuses` wrote; CdrError when it cannot be read."""
    with reading("estimator/evidence", statuses) as values:
        found = read_json(values["document"], "evidence")
        del found["schema"]
        # JSON has no infinity: before the first score there is no threshold.
        found["threshold"] = math.inf if found["threshold"] is None else found["threshold"]
        found["candidates"] = tuple(EffectEvidence(**one) for one in found["candidates"])
        found["parameters"] = tuple(ParameterSummary(**one) for one in found["parameters"])
        found |= {name: tuple(found[name]) for name in ("effects", "doubtful")}
        return EvidenceSummary(**found)
