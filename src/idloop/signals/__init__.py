"""Excitation signals.

``build_signal("prbs", sample_time=0.001, duration=10.0, band_hz=10.0)`` gives a `Signal`;
``SIGNALS`` lists the kinds with their parameters.
"""

from __future__ import annotations

from idloop.signals.base import LineGrid, Segment, SignalKind
from idloop.signals.generate import COMMON_PARAMETERS, SIGNALS, build_signal, check_signal
from idloop.signals.signal import Signal

__all__ = [
    "COMMON_PARAMETERS",
    "SIGNALS",
    "LineGrid",
    "Segment",
    "Signal",
    "SignalKind",
    "build_signal",
    "check_signal",
]
