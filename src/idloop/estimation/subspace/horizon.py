"""How far a subspace method looks back and ahead, when the user does not say."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from idloop.errors import InputError
from idloop.estimation.black_box.sampled import SampledData, together
from idloop.estimation.subspace.compression import Compression, compress, not_exciting

_LONGEST = 60  # samples
_SHORTEST = 10
_ROWS_PER_WINDOW = 0.25  # share of the data that the regressors of the longest horizon may take up
_FLOOR = 1e-10  # deviation of an innovation that counts as none, in deviations of its output


def default_horizon(
    data: SampledData | Sequence[SampledData], order: int | None = None, feedthrough: bool = False
) -> int:
    """Length of past and future: the order of the best long ARX model by Akaike's criterion.

    That choice lets the neglected past vanish as the data grow (Larimore, Proc. ACC 1983; Bauer, Automatica 41,
    2005, section 5). It is never below 10 samples nor below the order and two more, and at most 60.

    Parameters
    ----------
    data : SampledData or sequence of SampledData
    order : int, optional
        Number of states, where it is known.
    feedthrough : bool
        Whether the command of a sample acts on its own measurement.

    Returns
    -------
    int
        [samples]

    Raises
    ------
    InputError
        Too few samples.
    """
    experiments = together(data)
    wide = experiments[0].input.shape[1] + experiments[0].output.shape[1]
    samples = sum(len(one) for one in experiments)
    room = int(_ROWS_PER_WINDOW * samples / (2 * wide))
    shortest = max(_SHORTEST, 0 if order is None else order + 2)
    if room < 3:
        raise InputError(
            f"{experiments[0].name}: {samples} samples of {wide} signals are too few for a subspace method;"
            " record for longer"
        )
    longest = min(_LONGEST, room, min(len(one) for one in experiments) // 4)
    longest = max(longest, 2)
    return int(np.clip(_arx_order(compress(experiments, longest + 1), feedthrough), min(shortest, longest), longest))


def halved_windows(
    data: SampledData | Sequence[SampledData],
    horizon: int | None,
    order: int | None,
    feedthrough: bool,
    exact: bool = False,
) -> Compression:
    """Windows of past and future of one length: the user's, or the longest by the rule that the commands excite.

    `feedthrough`: as for `default_horizon`; `exact`: as for `compress`. Returns: of windows of twice the horizon.
    Raises InputError: a horizon below 2, or commands that excite too little for any, or for the order.
    """
    if horizon is not None:
        if horizon < 2:
            raise InputError(f"horizon of {horizon} samples; give at least 2")
        return compress(data, 2 * horizon, exact=exact)
    found = compress(data, 2 * default_horizon(data, order, feedthrough), exact=exact)
    excited = found.excited()
    shown = excited // (2 * found.inputs)
    least = 1 + (1 if order is None else -(-order // found.outputs))
    if 2 * shown < found.length and shown < least:
        raise not_exciting(found, excited, 2 * least)
    # Narrow excitation: shorter windows are told apart where long ones are not.
    return found if 2 * shown >= found.length else compress(data, 2 * max(shown, 2), exact=exact)


def _arx_order(compression: Compression, feedthrough: bool) -> int:
    """Lags that minimise AIC of y(k) on the past of both signals."""
    longest, outputs = compression.length - 1, compression.outputs
    target = compression.y(longest, longest + 1)
    # Newest lag first: the regressors of a shorter model are the first rows of those of a longer one.
    past = np.concatenate([compression.both(lag, lag + 1) for lag in range(longest - 1, -1, -1)])
    present = compression.u(longest, longest + 1) if feedthrough else target[:0]
    rotated, _ = np.linalg.qr(np.concatenate([present, past, target]).T)
    parts = target @ rotated
    wide = past.shape[0] // longest
    best, chosen = np.inf, 1
    for lags in range(1, longest + 1):
        rest = parts[:, len(present) + lags * wide :]
        covariance = rest @ rest.T + _FLOOR**2 * np.eye(outputs)
        criterion = compression.windows * np.linalg.slogdet(covariance)[1] + 2.0 * lags * wide * outputs
        if criterion < best:
            best, chosen = criterion, lags
    return chosen
