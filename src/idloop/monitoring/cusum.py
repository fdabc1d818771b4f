"""Page's CUSUM of one watch: a sum that restarts at 0 and raises an alarm above a threshold."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import numpy as np

from idloop.monitoring.baseline import LEAST_SHARE, ReferenceStatistics
from idloop.monitoring.block_scores import EfficientScore
from idloop.monitoring.run_length import FEWEST_BLOCKS

_WIDTH = 1.959963984540054
# The newest growth is estimated from so many blocks that its standard error is this share of the watched growth.
_SHARP = 0.2


@dataclass(frozen=True)
class Growth:
    """Change of a parameter against the healthy machine, with a 95 % interval [unit]."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Alarm:
    """One alarm."""

    block: int  # at the end of which it was raised
    onset: int  # first block after the sum was last 0: the maximum-likelihood estimate of the change time
    # From the onset to the alarm. Biased upwards by the selection of an alarm; `Cusum.growth` is not.
    growth: Growth


@dataclass
class Cusum:
    """State of one watch."""

    sum: float = 0.0  # sum of log-likelihood ratios since the onset
    onset: int | None = None  # first block since the sum was last 0; None while it is 0
    # In order. After each the sum restarts, so that a lasting growth raises another alarm.
    alarms: list[Alarm] = field(default_factory=list)
    # Blocks processed, and the informative ones among them
    blocks: int = 0
    informative: int = 0
    information: float = 0.0  # of all blocks [1/unit²]
    squares: float = 0.0  # sum of the squared information [1/unit⁴]
    _since: tuple[float, float] = (0.0, 0.0)
    _newest: deque[tuple[float, float]] = field(default_factory=deque)
    _held: tuple[float, float] = (0.0, 0.0)

    def take(
        self, normal: ReferenceStatistics, index: np.ndarray[tuple[int], np.dtype[np.int64]], score: EfficientScore
    ) -> list[float]:
        """Process blocks in the order of time.

        `normal`: reference statistics of this watch; `index` (b,). Returns: sum after each block, before the restart at
        an alarm.
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

    def _add(self, normal: ReferenceStatistics, block: int, ratio: float, gradient: float, information: float) -> None:
        self.informative += 1
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
        enough = normal.variance_ratio / (_SHARP * normal.sensitivity * normal.watch.growth) ** 2
        while len(self._newest) > 1 and self._held[1] - self._newest[0][1] >= enough:
            old = self._newest.popleft()
            self._held = self._held[0] - old[0], self._held[1] - old[1]

    def _restart(self) -> None:
        self.sum, self.onset, self._since = 0.0, None, (0.0, 0.0)

    def growth(self, normal: ReferenceStatistics) -> Growth | None:
        """Growth estimated from the newest blocks; None before the first informative one."""
        return _estimate(normal, *self._held) if self._held[1] > 0.0 else None


def _estimate(normal: ReferenceStatistics, gradient: float, information: float) -> Growth:
    """Estimate of the change with its interval, which includes the uncertainty of the reference."""
    value = gradient / max(information, 1e-300) / normal.sensitivity
    own = np.sqrt(normal.variance_ratio / max(information, 1e-300))
    width = _WIDTH * float(np.hypot(own, normal.offset_stderr)) / normal.sensitivity
    return Growth(value, value - width, value + width)
