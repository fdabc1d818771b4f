"""Describing functions of effects, and the limit cycle of a loop that has one."""

import numpy as np

import control
from idloop.estimation.describing_functions import (
    DeadZone,
    Relay,
    describing_function,
    effect_element,
    limit_cycles,
    relay_cycles,
    simulate_loop,
)

# In closed form, and computed for any effect of the catalogue.
amplitude = np.array([0.2, 0.5, 2.0])
exact = describing_function(DeadZone(0.12), amplitude, input_unit="V")
effect = describing_function(effect_element("dead_zone", width=0.12), amplitude, input_unit="V")
print("gain of the dead zone", np.round(exact.gain.real, 3), "and of the effect", np.round(effect.gain.real, 3))

# Where −1/N(A) meets G(jω) the loop oscillates; the simulation says whether it does.
plant = control.tf([1.0], [1.0, 2.0, 1.0, 0.0])
(cycle,) = limit_cycles(plant, Relay(1.0)).cycles
print(f"predicted: amplitude {cycle.amplitude:.3f}, {cycle.frequency:.3f} Hz, stable: {cycle.stable}")
run = simulate_loop(plant, Relay(1.0), cycle, start=1.5)
print(f"simulated: amplitude {run.amplitude:.3f}, {run.frequency:.3f} Hz")

# Behind a lag of first order the two never meet, and yet a thermostat oscillates: exactly, without harmonics.
lag, thermostat = control.tf([1.0], [1.0, 1.0]), Relay(1.0, on=0.3, off=-0.3)
(cycle,) = relay_cycles(lag, thermostat)
print(f"thermostat: {len(limit_cycles(lag, thermostat).cycles)} by harmonics; peak {cycle.peak:.3f}", end=", ")
print(f"{cycle.frequency:.3f} Hz, simulated {simulate_loop(lag, thermostat, cycle).frequency:.3f} Hz")

# prints:
# gain of the dead zone [0.285 0.697 0.924] and of the effect [0.285 0.697 0.924]
# predicted: amplitude 0.637, 0.159 Hz, stable: True
# simulated: amplitude 0.667, 0.155 Hz
# thermostat: 0 by harmonics; peak 0.300, 0.808 Hz, simulated 0.808 Hz
