"""Identify a black-box model from arrays, and judge it on data that was not fitted."""

import numpy as np

import idloop


def measured(seed: int) -> idloop.Record:
    """Ten seconds of a motor at 100 Hz: velocity with a lag of 0.1 s, and sensor noise."""
    random = np.random.default_rng(seed)
    command = np.repeat(random.choice([-1.0, 1.0], 100), 10)
    velocity = np.zeros(1000)
    for k in range(999):
        velocity[k + 1] = np.exp(-0.1) * velocity[k] + (1.0 - np.exp(-0.1)) * 4.0 * command[k]
    velocity += 0.02 * random.normal(size=1000)
    units = {"motor.velocity": "rad/s"}
    return idloop.Record.from_arrays(
        0.01 * np.arange(1000), command, {"motor.velocity": velocity},
        command_name="motor.effort", command_unit="V", units=units,
    )  # fmt: skip


found = idloop.identify(measured(1), "oe", validate=measured(2), order=(1, 2, 3))
system = found.linear.system  # of python-control
print(f"order {found.linear.order}, pole {system.poles()[0].real:.2f}, gain {system.dcgain().item():.1f} rad/s per V")
print(f"FIT on unseen data {found.fit['oe']['motor.velocity']:.0f} %")

# prints:
# order 1, pole 0.90, gain 4.0 rad/s per V
# FIT on unseen data 99 %
