"""A speed that the drive does not exceed, however large the command.

The steady speed of an axis grows with its command, whatever its friction. Where a drive limits it, the axis stays at
one speed under commands of many sizes.
"""

from __future__ import annotations

import numpy as np

from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.fault import fault

# Band below the largest speed, which lies above the limit by the noise itself: at least this share of it and so many
# times the noise, at most the second share.
_BAND, _NOISE, _WIDEST = 0.01, 4.0, 0.06
# Share of the time in the band, visits to it from below the two bands under it, and how much fuller it is than these.
_SHARE, _VISITS, _FULLER = 0.03, 2, 3.0
# Spread of the commands there, and the smallest usual one, as shares of the largest.
_SPREAD, _PUSHES = 0.12, 0.4
# Largest speeds left out, and blocks that a record is averaged to at least.
_ODD, _BLOCKS = 0.005, 200


def check(axis: Axis) -> list[Finding]:
    """Look for a speed at which the axis stays under commands of many sizes."""
    grid = axis.grid
    if grid is None:
        return []
    known = np.isfinite(grid.speed) & np.isfinite(grid.command)
    speed, command, time = grid.speed[known], grid.command[known], grid.time[known]
    if speed.size < 2 * _BLOCKS or not np.any(command):
        return []
    top = float(np.quantile(np.abs(speed), 1.0 - _ODD))
    block = int(np.clip((2.0 * grid.noise / max(_BAND * top, 1e-300)) ** 2, 1, speed.size // _BLOCKS))
    count = speed.size // block
    speed, command, time = (one[: count * block].reshape(count, block).mean(axis=1) for one in (speed, command, time))
    largest = float(np.max(np.abs(command)))
    for sign in (1.0, -1.0):
        forward, pushes = sign * speed, sign * command
        top = float(np.quantile(forward, 1.0 - _ODD))
        band = max(_NOISE * grid.noise / block**0.5, _BAND * top)
        if top <= 0.0 or band > _WIDEST * top:
            continue
        at = forward > top - band
        left = forward <= top - 3.0 * band
        below = np.count_nonzero(~left & ~at)
        # Noise takes a speed out of the band and back within one stay.
        certain = np.flatnonzero(at | left)
        visits = certain[np.diff(at[certain].astype(np.int8), prepend=0) > 0]
        if at.mean() < _SHARE or visits.size < _VISITS or np.count_nonzero(at) < _FULLER * below:
            continue
        low, high = np.quantile(pushes[at], [0.1, 0.9]) / largest
        if high - low < _SPREAD or low < _PUSHES:
            continue
        name, unit = axis.command_name, axis.unit("command")
        return [
            fault(
                "not_followed",
                name,
                f"{axis.joint} does not exceed {sign * top:.4g} {axis.unit('velocity')}, under {name} from"
                f" {sign * low * largest:.3g} to {sign * high * largest:.3g} {unit} ({100 * at.mean():.2g} % of the"
                " time): the drive limits its speed",
                "raise the speed limit of the drive, or command less",
                evidence={"speed": sign * top, "share": float(at.mean()), "low": low * largest, "high": high * largest},
                spoils=("viscous friction",),
                count=int(visits.size),
                places=[(float(time[k]), float(time[min(k + 1, time.size - 1)])) for k in visits],
            )
        ]
    return []
