"""Describing functions: the gain of a nonlinear element for a sine of a given amplitude.

In closed form (`DeadZone`, `Saturation`, `Relay`, ...), computed for any effect of the catalogue
(`lone_effect`, `describing_function`), and measured from stepped-sine records
(`measure_describing_function`). `limit_cycles` holds −1/N(A) against G(jω), `relay_cycles` does without harmonics
for relays, `simulate_loop` checks them.
"""

from __future__ import annotations

from idloop.estimation.describing_functions.describing_function import DescribingFunction, describing_function
from idloop.estimation.describing_functions.dwell import Dwell, dwells_of, find_dwells
from idloop.estimation.describing_functions.element import ClosedForm, Element
from idloop.estimation.describing_functions.elements.coulomb_friction import CoulombFriction
from idloop.estimation.describing_functions.elements.dead_zone import DeadZone
from idloop.estimation.describing_functions.elements.friction_backlash import FrictionBacklash
from idloop.estimation.describing_functions.elements.inertia_backlash import InertiaBacklash
from idloop.estimation.describing_functions.elements.relay import Relay
from idloop.estimation.describing_functions.elements.saturation import Saturation
from idloop.estimation.describing_functions.limit_cycle import LimitCycle, LimitCycles, limit_cycles
from idloop.estimation.describing_functions.lone_effect import LoneEffect, lone_effect
from idloop.estimation.describing_functions.loop_simulation import LoopSimulation, simulate_loop
from idloop.estimation.describing_functions.measured import MeasuredDescribingFunction, measure_describing_function
from idloop.estimation.describing_functions.relay_cycle import RelayCycle, relay_cycles
from idloop.estimation.describing_functions.sine_drive import SineAnswer, drive_by_sine

__all__ = [
    "ClosedForm",
    "CoulombFriction",
    "DeadZone",
    "DescribingFunction",
    "Dwell",
    "Element",
    "FrictionBacklash",
    "InertiaBacklash",
    "LimitCycle",
    "LimitCycles",
    "LoneEffect",
    "LoopSimulation",
    "MeasuredDescribingFunction",
    "Relay",
    "RelayCycle",
    "Saturation",
    "SineAnswer",
    "describing_function",
    "drive_by_sine",
    "dwells_of",
    "find_dwells",
    "limit_cycles",
    "lone_effect",
    "measure_describing_function",
    "relay_cycles",
    "simulate_loop",
]
