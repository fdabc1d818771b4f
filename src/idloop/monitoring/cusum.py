"""Page's CUSUM of one watch: a sum that starts again at 0 and alarms above a threshold, and what it has seen."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import numpy as np

from idloop.monitoring.baseline import LEAST_SHARE, Normal
from idloop.monitoring.block_scores import Evident
from idloop.monitoring.run_length import FEWEST_BLOCKS

_WIDTH = 1.959963984540054
# The newest growth is estimated from as many blocks as make its standard error this share of the watched growth.
_SHARP = 0.2


@dataclass(frozen=True)
class Growth:
    """Change of a parameter against the healthy machine, with a 95 % interval [unit]."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Alarm:
    """One alarm.

    Attributes
    ----------
    block : int
        At whose end it was raised.
    onset : int
        First block after the sum last was 0: the likeliest instant of the change.
    growth : Growth
        From the onset to the alarm. It tends to be too large, as the alarm waits for blocks that look like growth; what
        `Cusum.growth` says of the newest blocks does not.
    """

    block: int
    onset: int
    growth: Growth


@dataclass
class Cusum:
    """State of one watch.

    Attributes
    ----------
    sum : float
        Of log-likelihood ratios since the onset.
    onset : int or None
        First block since the sum last was 0; None while it is.
    alarms : list of Alarm
        In order. After each the sum starts again, so that a growth that stays alarms again.
    blocks, telling : int
        Blocks seen, and those that told anything.
    information : float
        Of all blocks [1/unit²].
    squares : float
        Sum of the squared information [1/unit⁴].
    """

    sum: float = 0.0
    onset: int | None = None
    alarms: list[Alarm] = field(default_factory=list)
    blocks: int = 0
    telling: int = 0
    information: float = 0.0
    squares: float = 0.0
    _since: tuple[float, float] = (0.0, 0.0)
    _newest: deque[tuple[float, float]] = field(default_factory=deque)
    _held: tuple[float, float] = (0.0, 0.0)

    def take(self, normal: Normal, index: np.ndarray[tuple[int], np.dtype[np.int64]], score: Evident) -> list[float]:
        """Take in blocks in the order of time.

        Parameters
        ----------
        normal : Normal
            What is normal for this watch.
        index : array of int, shape (b,)
        score : Evident

        Returns
        -------
        list of float, length b
            The sum after each block, before it starts again at an alarm.
        """
        least = LEAST_SHARE * normal.information
        sums = []
        for block, ratio, gradient, information in zip(
            index.tolist(),
            normal.ratio(score).tolist(),
            score.gradient.tolist(),
            score.information.tolist(),
            strict=True,
        ):
            self.blocks += 1
            if normal.evidence is not None and information > least:
                self._add(normal, block, ratio, gradient - information * normal.offset, information)
            sums.append(self.sum)
            if self.sum > normal.threshold:
                onset = block if self.onset is None else self.onset
                self.alarms.append(Alarm(block, onset, _estimate(normal, *self._since)))
                self._restart()
        return sums

    def _add(self, normal: Normal, block: int, ratio: float, gradient: float, information: float) -> None:
        self.telling += 1
        self.information += information
        self.squares += information**2
        self.sum += min(ratio, normal.threshold / FEWEST_BLOCKS)
        if self.sum <= 0.0:
            self._restart()
        else:
            self.onset = block if self.onset is None else self.onset
            self._since = self._since[0] + gradient, self._since[1] + information
        self._newest.append((gradient, information))
        self._held = self._held[0] + gradient, self._held[1] + information
        enough = normal.spread / (_SHARP * normal.echo * normal.watch.growth) ** 2
        while len(self._newest) > 1 and self._held[1] - self._newest[0][1] >= enough:
            old = self._newest.popleft()
            self._held = self._held[0] - old[0], self._held[1] - old[1]

    def _restart(self) -> None:
        self.sum, self.onset, self._since = 0.0, None, (0.0, 0.0)

    def growth(self, normal: Normal) -> Growth | None:
        """Growth that the newest blocks show; None before any of them told anything."""
        return _estimate(normal, *self._held) if self._held[1] > 0.0 else None


def _estimate(normal: Normal, gradient: float, information: float) -> Growth:
    """Estimate of the change and its interval: that of the data and that of the reference together."""
    value = gradient / max(information, 1e-300) / normal.echo
    own = np.sqrt(normal.spread / max(information, 1e-300))
    width = _WIDTH * float(np.hypot(own, normal.offset_stderr)) / normal.echo
    return Growth(value, value - width, value + width)
