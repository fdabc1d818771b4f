"""The Granger test: whether the command improves the prediction of the motion, whatever the model.

An output is regressed on its own past, and on its own past and that of the command (Granger, Econometrica 37, 1969).
The reduction of the errors is compared with that by the same command after a shift along the record: such a command is
unrelated to the motion and has the same steps and colour, which an F distribution does not account for.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from idloop.records import Record

Array = NDArray[np.float64]

# Past samples of the output that take part.
_PAST = 10


def granger_causes(records: Sequence[Record], seed: int = 0) -> bool:
    """Whether the command helps to predict some output of the records beside its own past; `seed` is of the shifts."""
    for column in range(len(records[0].output_names)):
        for thin in (False, True):
            pairs = [_signals(record, column, thin) for record in records]
            pairs = [pair for pair in pairs if len(pair[0]) > 4 * _PAST]
            # It must explain three times as much as the best of 49 shifts, and a fiftieth of the errors.
            found = _share(pairs) if pairs else 0.0
            if found > 0.02 and found > 3.0 * max(_share(shifted) for shifted in _shifts(pairs, seed)):
                return True
    return False


def _signals(record: Record, column: int, thin: bool) -> tuple[Array, Array]:
    """An output where it was measured, and the command then; thinned to means of neighbours."""
    output = record.output[:, column]
    command = record.input_at(record.time)
    known = np.isfinite(output) & np.isfinite(command)
    output, command = output[known], command[known]
    # A thousand samples are left: neighbouring samples of a slow motion hardly differ.
    each = len(output) // 1000
    if not thin or each < 2:
        return output, command
    kept = len(output) // each * each
    return output[:kept].reshape(-1, each).mean(axis=1), command[:kept].reshape(-1, each).mean(axis=1)


def _shifts(pairs: Sequence[tuple[Array, Array]], seed: int) -> list[list[tuple[Array, Array]]]:
    """Pairs with their commands shifted by a quarter of a record or more."""
    generator = np.random.default_rng(seed)
    return [
        [(y, np.roll(u, int(generator.integers(len(y) // 4, len(y) - len(y) // 4)))) for y, u in pairs]
        for _ in range(49)
    ]


def _share(pairs: Sequence[tuple[Array, Array]]) -> float:
    """Part by which the command's past reduces the squared errors of a regression on the output's own."""
    longest = min(len(y) for y, _ in pairs) // 4
    tables = [_table(y, u, longest) for y, u in pairs]
    moment = sum(table.T @ table for table in tables)
    before, after = _residual_power(moment, 1 + _PAST), _residual_power(moment, len(moment) - 1)
    return 1.0 - after / before if before > 0.0 else 0.0


def _table(output: Array, command: Array, longest: int) -> Array:
    """Rows of a one, the output's past, the command's past, and the output.

    Of the command eight single samples, then means over stretches that double, up to the longest.
    """
    total = np.concatenate([[0.0], np.cumsum(command)])
    now = np.arange(max(_PAST, longest), len(output))
    stretches = [(k, k + 1) for k in range(8)]
    while 2 * stretches[-1][1] <= longest:
        stretches.append((stretches[-1][1], 2 * stretches[-1][1]))
    columns = [np.ones(len(now)), *(output[now - k] for k in range(1, _PAST + 1))]
    # The command at a sample acts after it: the one before acts on the way to it.
    columns += [(total[now + 1 - first] - total[now + 1 - last]) / (last - first) for first, last in stretches]
    return np.column_stack([*columns, output[now]])


def _residual_power(moment: Array, count: int) -> float:
    """Squared errors of the last column after a regression on the first ones."""
    size = np.sqrt(np.maximum(np.diag(moment), 1e-300))
    scaled = moment / np.outer(size, size)
    # A relative ridge keeps what is exactly tied solvable.
    inner = scaled[:count, :count] + 1e-10 * np.eye(count)
    cross = scaled[:count, -1]
    return float((scaled[-1, -1] - cross @ np.linalg.solve(inner, cross)) * size[-1] ** 2)
