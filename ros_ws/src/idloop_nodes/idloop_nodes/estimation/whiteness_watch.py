"""When a residual is not white any more: once for each change, not at every fit."""

from __future__ import annotations

from collections.abc import Mapping

BAD, GOOD = 1e-4, 1e-2  # probabilities under whiteness: below BAD it is not white, from GOOD on it is again
IN_A_ROW = 2  # one bad fit may be a bump
GROWTH = 2.0  # a residual that never was white again must have grown so much before it counts again


class WhitenessWatch:
    """Hysteresis over the residuals of successive fits.

    It triggers once, after the residual was not white several times in a row. Then it stays silent until the
    residual has been white again, has grown clearly, or `arm` announces a new model.
    """

    def __init__(self) -> None:
        self.armed = True
        self._bad = 0
        self._error = 0.0

    def arm(self) -> None:
        """Begin again: the model or the excitation has changed."""
        self.armed, self._bad, self._error = True, 0, 0.0

    def look(self, whiteness: Mapping[str, float], fit: Mapping[str, float]) -> bool:
        """Take in p-values of the whiteness test and FIT [%] by output; return whether to diagnose now."""
        if not whiteness:
            return False
        worst = min(whiteness.values())
        error = max((100.0 - value for value in fit.values()), default=0.0)
        if worst >= GOOD:
            self.arm()
            return False
        if not self.armed and error > GROWTH * self._error:
            self.arm()
        if not self.armed or worst >= BAD:
            return False
        self._bad += 1
        if self._bad < IN_A_ROW:
            return False
        self.armed, self._bad, self._error = False, 0, error
        return True
