"""Effects that stand in for what no effect of the catalogue is.

Where the inertia changes over the turn, a cogging of the right harmonics makes the one-step errors smaller, and the
motion worse; where a drag grows with the third power of the speed, a lag does. Two things tell such a stand-in: a
learnt curve explains far more than the effect does, and beside it nothing of the effect is left. An effect that is
itself little else than such a force over velocity, position or command is not judged so: it may be one of several.
Of these the best explains a good part. Where it explains next to nothing of a curve of its own kind, and the curve
stays as it was when it is added, it is none of them: a wave stands in for an end stop.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from idloop.diagnose.candidate import effect_parameters
from idloop.diagnose.confirm import Confirmed
from idloop.diagnose.curves import force_shapes
from idloop.diagnose.learnt import Learnt, learn
from idloop.diagnose.parallel import in_parallel
from idloop.diagnose.screen import Screen
from idloop.diagnose.unevenness import unevenness

Array = NDArray[np.float64]

# A curve must be worth so many times an effect to be asked whether it is the truth behind it.
_FAR_MORE = 1.5
# Part of what it explains that a curve of few heights, for small changes, may leave for others to explain, and part of
# an effect's own evidence that must be gone then.
_ROUGH, _MOSTLY = 0.05, 0.5
# Of several effects of a curve's kind the best explains more than this part of what the curve does, and once it is in
# the model less than this part of the curve is left.
_A_GOOD_PART, _AS_IT_WAS = 0.2, 0.5
# Part of its trace's power beyond a force's curve from which on an effect is none of the curve's kind.
_OF_ITS_KIND = 0.5


def stands_in(screen: Screen, found: Sequence[tuple[Learnt, float]], confirmed: Confirmed, bar: float) -> str:
    """Say what an effect stands in for.

    Parameters
    ----------
    screen : Screen
        Errors of the model without it.
    found : sequence of tuple
        Curves that they follow, best first, from `idloop.diagnose.learnt.remaining`.
    confirmed : Confirmed
        The effect.
    bar : float
        Statistic from which on it is significant.

    Returns
    -------
    str
        Empty where it stands in for nothing, as far as is known.
    """
    proposal = confirmed.proposal
    stronger = [learnt for learnt, _ in found if learnt.merit >= _FAR_MORE * 2.0 * confirmed.gain]
    if not stronger:
        return ""
    fitted = effect_parameters(confirmed.fit.model, proposal.name)
    change = screen.moved(proposal, {name: float(entry["value"]) for name, entry in fitted.items()})
    if change is None:
        return ""
    own = change - screen.basis @ (screen.basis.T @ change)
    alone, power = _score(own, screen.errors), float(own @ own)
    for learnt in stronger:
        rest = own - learnt.span @ (learnt.span.T @ own)
        if not learnt.shape.coefficient and float(rest @ rest) < _OF_ITS_KIND * power:
            if _is_none_of_several(screen, confirmed, learnt):
                return f"it may stand in for another: {learnt.shape.text} explains far more, and stays beside it"
            continue
        beside = _score(rest, screen.errors)
        if beside < bar or (beside < _MOSTLY * alone and beside < _ROUGH * learnt.merit):
            return (
                f"it stands in for something else: {learnt.shape.text} explains far more, and beside it next to nothing"
                " is left of this effect"
            )
    return ""


def _is_none_of_several(screen: Screen, confirmed: Confirmed, learnt: Learnt) -> bool:
    """Whether an effect of a curve's kind explains next to nothing of it, and leaves it as it was."""
    if 2.0 * confirmed.gain >= _A_GOOD_PART * learnt.merit:
        return False
    beside = Screen(screen.setting, confirmed.fit, 0)
    same = [shape for shape in force_shapes(beside) if (shape.over, shape.of) == (learnt.shape.over, learnt.shape.of)]
    again = in_parallel(partial(learn, beside), same)
    return any(found is not None and found.merit > _AS_IT_WAS * learnt.merit for found in again)


def _score(trace: Array, errors: Array) -> float:
    """Score statistic of a trace, less for a variance that is uneven along it."""
    size = float(np.linalg.norm(trace))
    if size == 0.0:
        return 0.0
    direction = trace / size
    score = float(direction @ errors)
    return score**2 / unevenness(direction[:, None], errors - score * direction)
