"""Wear monitoring: detects the growth of a parameter at a stated rate of false alarms."""

from __future__ import annotations

from idloop.monitoring.baseline import Baseline, learn
from idloop.monitoring.monitor import ALARM, CANNOT_TELL, QUIET, Monitor, Trace, WatchState
from idloop.monitoring.watch import Watch, choose_watches, parse_false_alarms, parse_watch

__all__ = [
    "ALARM",
    "CANNOT_TELL",
    "QUIET",
    "Baseline",
    "Monitor",
    "Trace",
    "Watch",
    "WatchState",
    "choose_watches",
    "learn",
    "parse_false_alarms",
    "parse_watch",
]
