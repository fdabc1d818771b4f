"""What the benchmark is doing, on stderr."""

from __future__ import annotations

import sys
import time

_BEGIN = time.monotonic()


def say(text: str) -> None:
    """One line with the time since the start."""
    passed = time.monotonic() - _BEGIN
    print(f"[{int(passed // 60):3d}:{passed % 60:04.1f}] {text}", file=sys.stderr, flush=True)
