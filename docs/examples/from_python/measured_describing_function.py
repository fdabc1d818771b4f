"""A describing function measured from sines that are stepped through frequencies, one recording for each amplitude."""

import numpy as np

from idloop.estimation.describing_functions import DeadZone, describing_function, measure_describing_function
from idloop.physics import load_model
from idloop.physics.simulation import simulate
from idloop.records import Record
from idloop.signals import build_signal

amplitudes = np.array([0.05, 0.1, 0.2])
axis = load_model("axis")
machine = axis.with_effects(["dead_zone@input(width=0.02)"])


def recorded(amplitude: float) -> Record:
    """Two frequencies at one amplitude; of a bag: `idloop.records.read_record("bags/run", axis)`."""
    sine = build_signal(
        "stepped_sine", amplitude=amplitude, frequencies=[1.0, 4.0], periods=4, settle_periods=2, sample_time=0.002
    )
    time = np.arange(len(sine.value)) * 0.002
    noise = np.random.default_rng(1).normal(size=(len(time), 2)) * [o.noise or 0.0 for o in axis.outputs]
    output = simulate(machine, time, sine.value, time, noise=noise).output
    return Record("stepped sine", time, sine.value, time, output, axis.input.name, axis.input.unit,
                  axis.output_names, tuple(o.unit for o in axis.outputs))  # fmt: skip


measured = measure_describing_function([recorded(a) for a in amplitudes], None, "axis.velocity")
# What the linear axis makes of a sine is divided out: the gain of the dead zone is left.
s = 2j * np.pi * measured.frequency
linear = 1.0 / (axis.values["axis.inertia"] * s + axis.values["axis.viscous_friction"])
theory = describing_function(DeadZone(0.02), measured.amplitude, input_unit="N·m")
for at in range(len(measured.gain)):
    print(
        f"{measured.frequency[at]:.0f} Hz, {measured.amplitude[at]:.2f} N·m: measured "
        f"{abs(measured.gain[at] / linear[at]):.3f}, in theory {abs(theory.gain[at]):.3f}"
    )

# prints:
# 1 Hz, 0.05 N·m: measured 0.505, in theory 0.505
# 4 Hz, 0.05 N·m: measured 0.505, in theory 0.505
# 1 Hz, 0.10 N·m: measured 0.747, in theory 0.747
# 4 Hz, 0.10 N·m: measured 0.748, in theory 0.747
# 1 Hz, 0.20 N·m: measured 0.873, in theory 0.873
# 4 Hz, 0.20 N·m: measured 0.875, in theory 0.873
