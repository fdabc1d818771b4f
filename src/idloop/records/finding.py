"""Remarks on a recording."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Literal


@dataclass(frozen=True)
class Finding:
    """One remark about a recording."""

    # Machine name: ``gap``, ``lost_samples``, ``duplicate_stamps``, ``out_of_order``, ``clock_reset``, ``jitter``,
    # ``two_clocks``, ``clock_drift``, ``receive_stamps``, ``not_measured``, ``unread_topic``, ``cut``, ``processing``,
    # ``no_motion``, ``differenced_velocity``, ...
    kind: str
    text: str  # one line for the user, with numbers and units
    count: int = 1  # how many samples or places it concerns
    where: str = ""  # topic, column or file
    level: Literal["note", "warning"] = "note"  # ``warning`` when a fit may be wrong because of it
    evidence: Mapping[str, float] = field(default_factory=dict, hash=False)  # the numbers that show it
    cure: str = ""  # what to do; part of `text` as well
    spoils: tuple[str, ...] = ()  # what cannot be identified because of it; empty where it only lowers the accuracy
    # Beginning and end of the places that show it [s from the first stamp of the recording]
    places: tuple[tuple[float, float], ...] = ()

    def to_dict(self) -> dict[str, object]:
        """Return the finding as plain values for JSON."""
        return asdict(self)
