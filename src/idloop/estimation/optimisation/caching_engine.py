"""Engine for estimation: without quantisation of outputs, and with a cache of compiled layouts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from idloop.arrays import Array
from idloop.physics.engine import Engine
from idloop.physics.layout import lay_out

if TYPE_CHECKING:
    from idloop.physics.layout import Layout

_KEPT = 64


class CachingEngine(Engine):
    """Engine that caches the layouts of the last parameter values.

    Laying a model out costs as much as simulating a thousand samples. Quantisation, which acts after a sensor's noise,
    is left out: it counts as noise and has no derivative.
    """

    _layouts: dict[bytes, Layout] | None = None

    def layout(self, theta: Array | None = None) -> Layout:
        """Arrays for one set of values, from the cache where possible."""
        if self._layouts is None:
            self._layouts = {}
        key = b"" if theta is None else np.asarray(theta, dtype=float).tobytes()
        if key not in self._layouts:
            if len(self._layouts) >= _KEPT:
                self._layouts.clear()
            self._layouts[key] = self._laid_out(theta)
        return self._layouts[key]

    def _laid_out(self, theta: Array | None) -> Layout:
        return lay_out(self.model, self.values(theta), final=False)
