"""Projections of the future on the past: the heart that all subspace methods with instruments share."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from idloop.estimation.subspace.compression import Compression, check_excitation
from idloop.estimation.subspace.projection import project, regress, row_basis

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Future:
    """Rows of the future and what the past says of them, in the columns of the compression.

    M = U + H Y is the command plus what the controller's response to the measurements takes off it. With a known
    controller noise of the future does not reach M, and without feedback M is the command itself (paper of the
    torsion system, eq. 3.6; Van Overschee and De Moor, Automatica 33, 1997).

    `z`, `z_next` (p i, columns), (p (i - 1), columns): orthogonal projections Z of the future outputs, eq. 3.16 and
    3.17; `beside`, `explained` (p i, columns): future outputs with M taken out, and the part of that which the past
    explains; `now`, `command_now` (p, columns), (m, columns): outputs and M at lag i.
    """

    horizon: int  # samples i of past and of future
    command: Array  # shape (m i, columns): M over the lags i to 2 i - 1
    command_next: Array  # shape (m (i - 1), columns): M over the lags i + 1 to 2 i - 1
    z: Array
    z_next: Array
    oblique: Array  # shape (p i, columns): projection of the future outputs on the past along M, eq. 3.18
    beside: Array
    explained: Array
    now: Array
    command_now: Array

    def correlations(self) -> Array:
        """Canonical correlations between future outputs and past, both with M taken out, largest first."""
        # In orthonormal bases of both row spaces the correlations are plain singular values.
        future, past = row_basis(self.beside, size=float(np.linalg.norm(self.now))), row_basis(self.explained)
        return np.asarray(np.minimum(np.linalg.svd(future @ past.T, compute_uv=False), 1.0))


def toeplitz(markov: list[Array]) -> Array:
    """Lower block triangular Toeplitz matrix of a system's Markov parameters (eq. 3.5)."""
    rows, columns = markov[0].shape
    count = len(markov)
    whole = np.zeros((count * rows, count * columns))
    for down in range(count):
        for across in range(down + 1):
            whole[down * rows : (down + 1) * rows, across * columns : (across + 1) * columns] = markov[down - across]
    return whole


def project_future(compression: Compression, feedback: list[Array] | None = None) -> Future:
    """Split each window in past and future halves and project.

    `compression`: of windows of 2 i samples; `feedback` (m, p): markov parameters D_c, C_c B_c, C_c A_c B_c, ... of the
    controller in u = r - controller(y), one for each lag of the future, in scaled units; none for direct
    identification. Raises InputError: the command excites less than the windows can tell apart.
    """
    i = compression.length // 2
    commands, outputs = compression.u(i, 2 * i), compression.y(i, 2 * i)
    check_excitation(compression)
    m, p = compression.inputs, compression.outputs
    command, command_next = commands, commands[m:]
    if feedback is not None:
        command = commands + toeplitz(feedback[:i]) @ outputs
        command_next = commands[m:] + toeplitz(feedback[: i - 1]) @ outputs[p:]
    past = np.concatenate([compression.u(0, i), compression.y(0, i)])
    longer = np.concatenate([compression.u(0, i + 1), compression.y(0, i + 1)])
    basis = row_basis(command)
    size = float(np.sqrt(np.linalg.eigvalsh(past @ past.T)[-1]))
    beside = outputs - project(outputs, basis)
    past_beside = past - project(past, basis)
    now = outputs[:p]
    return Future(
        horizon=i,
        command=command,
        command_next=command_next,
        z=project(outputs, row_basis(np.concatenate([past, command]))),
        z_next=project(outputs[p:], row_basis(np.concatenate([longer, command_next]))),
        oblique=regress(beside, past_beside, size) @ past,
        beside=beside,
        explained=project(beside, row_basis(past_beside, size)),
        now=now,
        command_now=command[:m],
    )
