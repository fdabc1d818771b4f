"""Subspace identification: state-space models by projections, without a search.

``n4sid``, ``moesp`` and ``cva`` for open loops, ``vodma`` for a loop whose controller is known (``vodma_direct`` is
the same without it), ``pbsid`` for any loop. ``select_order`` shows how many states the data have.
"""

from __future__ import annotations

from idloop.estimation.subspace.compression import default_horizon
from idloop.estimation.subspace.known_controller import vodma, vodma_direct
from idloop.estimation.subspace.open_loop import cva, moesp, n4sid, select_order
from idloop.estimation.subspace.order import OrderSelection
from idloop.estimation.subspace.predictor_based import pbsid

__all__ = [
    "OrderSelection",
    "cva",
    "default_horizon",
    "moesp",
    "n4sid",
    "pbsid",
    "select_order",
    "vodma",
    "vodma_direct",
]
