"""The engine of an estimate: smooth, and it remembers the layouts of the parameter values it saw last."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from idloop.physics.engine import Engine
from idloop.physics.layout import lay_out

if TYPE_CHECKING:
    from idloop.physics.layout import Layout

_KEPT = 64


class RememberingEngine(Engine):
    """Engine for a search, which asks for the same parameter values many times over.

    Laying a model out costs as much as simulating a thousand samples. What acts after the noise of a sensor, its
    rounding, is noise to an estimate: it has no slope, and a difference sees its steps alone.
    """

    _layouts: dict[bytes, Layout] | None = None

    def layout(self, theta: NDArray[np.float64] | None = None) -> Layout:
        """Arrays for one set of values, from memory where they were asked for before."""
        if self._layouts is None:
            self._layouts = {}
        key = b"" if theta is None else np.asarray(theta, dtype=float).tobytes()
        if key not in self._layouts:
            if len(self._layouts) >= _KEPT:
                self._layouts.clear()
            self._layouts[key] = self._laid_out(theta)
        return self._layouts[key]

    def _laid_out(self, theta: NDArray[np.float64] | None) -> Layout:
        return lay_out(self.model, self.values(theta), final=False)
