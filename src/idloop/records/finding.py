"""Remarks on a recording."""

from __future__ import annotations

from dataclasses import asdict, dataclass
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
    """

    kind: str
    text: str
    count: int = 1
    where: str = ""
    level: Literal["note", "warning"] = "note"

    def to_dict(self) -> dict[str, object]:
        """Return the finding as plain values for JSON."""
        return asdict(self)
