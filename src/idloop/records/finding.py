"""Remarks on a recording."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Literal


@dataclass(frozen=True)
class Finding:
    """One remark about a recording.

    Parameters
    ----------
    kind : str
        Machine name: ``gap``, ``lost_samples``, ``duplicate_stamps``, ``out_of_order``, ``clock_reset``,
        ``jitter``, ``two_clocks``, ``clock_drift``, ``receive_stamps``, ``not_measured``, ``unread_topic``,
        ``cut``, ``processing``, ``no_motion``, ``differenced_velocity``, ...
    text : str
        One line for the user, with numbers and units.
    count : int
        How many samples or places it concerns.
    where : str
        Topic, column or file.
    level : {"note", "warning"}
        ``warning`` when a fit may be wrong because of it.
    evidence : mapping of str to float
        The numbers that show it.
    cure : str
        What to do; part of `text` as well.
    spoils : tuple of str
        What cannot be identified because of it; empty where it only lowers the accuracy.
    places : tuple of (float, float)
        Beginning and end of the places that show it [s from the first stamp of the recording].
    """

    kind: str
    text: str
    count: int = 1
    where: str = ""
    level: Literal["note", "warning"] = "note"
    evidence: Mapping[str, float] = field(default_factory=dict, hash=False)
    cure: str = ""
    spoils: tuple[str, ...] = ()
    places: tuple[tuple[float, float], ...] = ()

    def to_dict(self) -> dict[str, object]:
        """Return the finding as plain values for JSON."""
        return asdict(self)
