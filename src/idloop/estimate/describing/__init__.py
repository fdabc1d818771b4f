"""Describing functions: the gain of a nonlinear element for a sine of a given amplitude.

In closed form (`DeadZone`, `Saturation`, `Relay`, ...), computed for any effect of the catalogue
(`lone_effect`, `describing_function`), and measured from stepped-sine records
(`measure_describing_function`). `limit_cycles` holds −1/N(A) against G(jω), `relay_cycles` does without harmonics
for relays, `simulate_loop` checks them.
"""

from __future__ import annotations

from idloop.estimate.describing.describing_function import DescribingFunction, describing_function
from idloop.estimate.describing.dwell import Dwell, dwells_of, find_dwells
from idloop.estimate.describing.element import ClosedForm, Element
from idloop.estimate.describing.elements.coulomb_friction import CoulombFriction
from idloop.estimate.describing.elements.dead_zone import DeadZone
from idloop.estimate.describing.elements.friction_backlash import FrictionBacklash
from idloop.estimate.describing.elements.inertia_backlash import InertiaBacklash
from idloop.estimate.describing.elements.relay import Relay
from idloop.estimate.describing.elements.saturation import Saturation
from idloop.estimate.describing.limit_cycle import LimitCycle, LimitCycles, limit_cycles
from idloop.estimate.describing.lone_effect import LoneEffect, lone_effect
from idloop.estimate.describing.loop_simulation import LoopSimulation, simulate_loop
from idloop.estimate.describing.measured import MeasuredDescribingFunction, measure_describing_function
from idloop.estimate.describing.relay_cycle import RelayCycle, relay_cycles
from idloop.estimate.describing.sine_drive import SineAnswer, drive_by_sine

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
