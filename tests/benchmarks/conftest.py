"""The suite's files are scripts beside each other: they are found where they lie."""

from __future__ import annotations

import sys
from pathlib import Path

SUITE = Path(__file__).resolve().parents[2] / "benchmarks" / "diagnosis"
if str(SUITE) not in sys.path:
    sys.path.insert(0, str(SUITE))
