"""Describing functions: the gain of a nonlinear element for a sine of a given amplitude.

In closed form (`DeadZone`, `Saturation`, `Relay`, ...), computed for any effect of the catalogue
(`effect_element`, `describing_function`), and measured from stepped-sine records
(`measure_describing_function`). `limit_cycles` holds −1/N(A) against G(jω), `relay_cycles` does without harmonics
for relays, `simulate_loop` checks them.
"""

from __future__ import annotations

from idloop.estimation.describing_functions.describing_function import (
    DescribingFunction,
    SineAnswer,
    describing_function,
    drive_by_sine,
)
from idloop.estimation.describing_functions.dwell import Dwell, dwells_of, find_dwells
from idloop.estimation.describing_functions.effect_element import EffectElement, effect_element
from idloop.estimation.describing_functions.elements import (
    ClosedForm,
    DeadZone,
    Element,
    FrictionBacklash,
    InertiaBacklash,
    Relay,
    Saturation,
)
from idloop.estimation.describing_functions.limit_cycle import LimitCycle, LimitCycles, limit_cycles
from idloop.estimation.describing_functions.loop_simulation import LoopSimulation, simulate_loop
from idloop.estimation.describing_functions.measured import MeasuredDescribingFunction, measure_describing_function
from idloop.estimation.describing_functions.relay_cycle import RelayCycle, relay_cycles

__all__ = [
    "ClosedForm",
    "DeadZone",
    "DescribingFunction",
    "Dwell",
    "EffectElement",
    "Element",
    "FrictionBacklash",
    "InertiaBacklash",
    "LimitCycle",
    "LimitCycles",
    "LoopSimulation",
    "MeasuredDescribingFunction",
    "Relay",
    "RelayCycle",
    "Saturation",
    "SineAnswer",
    "describing_function",
    "drive_by_sine",
    "dwells_of",
    "effect_element",
    "find_dwells",
    "limit_cycles",
    "measure_describing_function",
    "relay_cycles",
    "simulate_loop",
]
