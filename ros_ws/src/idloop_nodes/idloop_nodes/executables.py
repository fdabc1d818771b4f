"""The scripts: one function for each executable, named like it, as the entry points of setup.py want them."""

from __future__ import annotations

import sys
from collections.abc import Callable

from idloop_nodes.descriptions import KINDS
from idloop_nodes.runtime import run


def __getattr__(kind: str) -> Callable[[], None]:
    if kind not in KINDS:
        raise AttributeError(kind)
    return lambda: sys.exit(run(kind))
