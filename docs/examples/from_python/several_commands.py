"""Two commands that move one axis, told apart: one column of the input for each."""

import numpy as np
from scipy.signal import lfilter

from idloop.estimation.black_box.identification import identify
from idloop.estimation.black_box.method import Choices
from idloop.estimation.black_box.sampled import SampledData

random = np.random.default_rng(1)
left, right = np.repeat(random.choice([-1.0, 1.0], (2, 200)), 10, axis=1)
speed = lfilter([0.0, 0.1], [1.0, -0.9], left + 0.5 * right) + 0.02 * random.normal(size=2000)

commands = np.column_stack([left, right])
data = SampledData("axis", commands, speed[:, None], 0.01, ("left", "right"), ("N·m", "N·m"), ("speed",), ("rad/s",))
found = identify(data, "n4sid", Choices(order=1))
print("gains [rad/s per N·m]", np.round(found.linear.system.dcgain(), 1).ravel())

# prints:
# gains [rad/s per N·m] [1.  0.5]
