"""Whether a recording can be used, in one of three grades with the reason."""

from __future__ import annotations

from collections.abc import Iterable

from idloop.records.finding import Finding
from idloop.spelling import joined_names

USABLE, WITH_CARE, NOT_USABLE = "usable", "usable with care", "not usable for"
EVERYTHING = "identification"

# Why a recording of each verdict is of no use, or of little.
_VERDICTS = {
    "not_excited": "nothing can be identified: no excitation",
    "no_command": "no command found, nothing can be fitted without one",
    "contradictory": "a position is constant while its velocity moves",
    "several_runs": "several runs in one bag, the clock was set back between them",
    "too_short": "nothing can be identified: too few samples",
    "unreadable": "no signal can be read",
}


def what(finding: Finding) -> str:
    """Return what was seen, without the cure."""
    return finding.text.removesuffix(f"; {finding.cure}")


def grade(verdict: str, findings: Iterable[Finding]) -> tuple[str, str]:
    """Return the grade and its reason in one line, by the verdict of `idloop.records.Inspection` and its findings.

    The grade is ``usable``, ``usable with care``, or ``not usable for`` what the faults spoil.
    """
    if verdict in _VERDICTS:
        return f"{NOT_USABLE} {EVERYTHING}", _VERDICTS[verdict]
    faults = [one for one in findings if one.level == "warning"]
    severe = [one for one in faults if EVERYTHING in one.spoils]
    if severe:
        return f"{NOT_USABLE} {EVERYTHING}", _reason(severe)
    spoiling = [one for one in faults if one.spoils]
    if spoiling:
        spoilt = list(dict.fromkeys(name for one in spoiling for name in one.spoils))
        return f"{NOT_USABLE} {joined_names(spoilt)}", _reason(spoiling)
    if verdict == "short":
        return WITH_CARE, "too few samples for reliable estimates"
    return (WITH_CARE, _reason(faults)) if faults else (USABLE, "no fault found")


def _reason(faults: list[Finding]) -> str:
    more = f" (and {len(faults) - 1} more)" if len(faults) > 1 else ""
    return what(faults[0]) + more
