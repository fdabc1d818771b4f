"""What enters a record's loop from outside: signals that no noise of the outputs comes back in."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from idloop.errors import IdloopError
from idloop.estimation.black_box.sampled import held_sum, sampled
from idloop.estimation.feedback import loop_of

if TYPE_CHECKING:
    from idloop.records import Record

Array = NDArray[np.float64]

# What is asked of the position, and what is added to the command.
_COLUMNS = ((("reference", 0), ("excitation", 0)), (("excitation", 1),))


def may_be_fed_back(record: Record) -> bool:
    """Whether the command of a record follows a reference, or may depend on the outputs' noise.

    A record too short or too full of gaps to tell counts as one of an open loop.
    """
    try:
        return loop_of(sampled(record)).possible
    except IdloopError:
        return False


def signals_from_outside(record: Record, time: Array) -> list[Array]:
    """Recorded signals that enter the loop from outside, at given times.

    Parameters
    ----------
    record : Record
    time : array, shape (n,)
        [s].

    Returns
    -------
    list of array, shape (n,)
        What is asked of the position, and what is added to the command: those of them that were recorded and move.
    """
    sums = [held_sum(record, time, *columns) for columns in _COLUMNS]
    return [one for one in sums if one is not None and np.ptp(one) > 0.0]
