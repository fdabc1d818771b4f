"""Identify a black-box model from arrays, judge it on data that it has not seen, and keep it."""

import numpy as np

from idloop.estimation.black_box.identification import identify
from idloop.estimation.black_box.method import Choices
from idloop.estimation.black_box.sampled import SampledData
from idloop.validation.score import score


def measured(seed: int) -> SampledData:
    """Ten seconds of a motor at 100 Hz: velocity behind a lag of 0.1 s, and sensor noise."""
    random = np.random.default_rng(seed)
    command = np.repeat(random.choice([-1.0, 1.0], 100), 10)
    velocity = np.zeros(1000)
    for k in range(999):
        velocity[k + 1] = np.exp(-0.1) * velocity[k] + (1.0 - np.exp(-0.1)) * 4.0 * command[k]
    velocity += 0.02 * random.normal(size=1000)
    return SampledData(
        "motor", command[:, None], velocity[:, None], 0.01,
        ("motor.effort",), ("V",), ("motor.velocity",), ("rad/s",),
    )  # fmt: skip


found = identify(measured(1), "oe", Choices(order=(1, 2, 3)))
system = found.linear.system  # of python-control
print(f"order {found.order}, pole {system.poles()[0].real:.2f}, gain {system.dcgain().item():.1f} rad/s per V")
judged = score(found.model, [measured(2)], 10)
print(f"FIT on unseen data {judged.free_run[0]:.0f} %")

# prints:
# order 1, pole 0.90, gain 4.0 rad/s per V
# FIT on unseen data 99 %
