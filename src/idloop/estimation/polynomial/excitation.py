"""Whether commands hold enough frequencies for the coefficients that are asked of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from idloop.estimation.black_box.sampled import SampledData
from idloop.estimation.polynomial.polynomials import Polynomials
from idloop.estimation.polynomial.regression import lagged, rows_in_blocks, triangle

Array = NDArray[np.float64]

_ROUNDING = 1e-9  # a direction of the windows of less than this part of the largest is none
_SOME = 20_000  # samples that nearly always tell


def excited_order(commands: Sequence[Array], most: int) -> int:
    """Order of which a command is persistently exciting (Ljung, 2nd ed., definition 13.1), `most` or less.

    `commands` (n_i,): the same command in several experiments. Returns: independent directions of its windows of `most`
    samples.
    """
    for few in (True, False):
        used = [command[:_SOME] if few else command for command in commands]
        blocks = [
            lagged(command, range(most), start, stop)
            for command in used
            for start, stop in rows_in_blocks(len(command), most - 1)
        ]
        if not blocks:
            return 0
        sizes = np.linalg.svd(triangle(blocks), compute_uv=False)
        order = int(np.sum(sizes > _ROUNDING * sizes[0]))
        if order == most or max(map(len, commands)) <= _SOME:
            break
    return order


def excitation_notes(
    data: Sequence[SampledData], polynomials: Sequence[Polynomials], instruments: bool = False
) -> list[str]:
    """What to tell of commands that are too poor for B and F (Ljung, 2nd ed., section 13.4); one note for each.

    Outputs excite A by their noise, whatever the command is.

    `polynomials`: of each output; `instruments`: whether instruments keep noise out, so that A needs the command as
    well.
    """
    notes = []
    for column, name in enumerate(data[0].input_names):
        used = [p.orders for p in polynomials if p.orders.nb[column]]
        needed = max((o.nb[column] + o.nf[column] + (o.na if instruments else 0) for o in used), default=0)
        if needed == 0:
            continue
        order = excited_order([one.input[:, column] for one in data], needed)
        if order < needed:
            kind = {1: ", as a constant is", 2: ", as a single sine is"}.get(order, "")
            notes.append(
                f"{name} is persistently exciting of order {order} only{kind}, and its polynomials need {needed}: their"
                " coefficients are chance; excite more frequencies or lower the orders"
            )
    return notes
