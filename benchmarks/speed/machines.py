"""The machines and records that several sections work on."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

STEP = 0.01  # s, of the torsion records
# The thesis's controller gains hold at 1 kHz; at 100 Hz the derivative has to be smaller.
PROPORTIONAL, DERIVATIVE = 2.0, 4.0
NOISE = 1.0 / 15.0  # degrees; twenty times that is the thesis's own
TORSION_OUTPUTS = ("motor", "load1", "load2", "load3")
ORDER_OF_FILTER = 2  # a steeper one leaves correlations so nearly singular that fast algorithms fall back on QR
QUIET = 500  # samples before the record, in which the filters settle


def torsion_record(samples: int, seed: int, noise: float = NOISE) -> tuple[Array, Array]:
    """Run the torsion preset in closed loop on a random reference below 10 Hz, sampled at 100 Hz.

    Parameters
    ----------
    samples, seed : int
    noise : float
        Deviation of the noise of each of the four angles [degrees].

    Returns
    -------
    u, y : ndarray, shapes (samples, 1), (samples, 4)
        [A], [rad]
    """
    from scipy.signal import butter, sosfilt

    import control
    from idloop.estimation.linear import c2d
    from idloop.estimation.linear.propagate import respond
    from idloop.physics import Engine, load_model

    linear = Engine(load_model("torsion")).linearise()
    plant = c2d(control.ss(linear.A, linear.B[:, None], linear.C, np.zeros((4, 1))), STEP)
    random = np.random.default_rng(seed)
    reference = sosfilt(
        butter(ORDER_OF_FILTER, 10.0, fs=1.0 / STEP, output="sos"), random.standard_normal(samples + QUIET)
    )[QUIET:]
    reference *= np.deg2rad(30.0) / reference.std()
    errors = np.deg2rad(noise) * random.standard_normal((samples, 4))
    # u = P (r - y1) - D (y1 - y1 before): linear in (r, e), with the last y1 as a ninth state.
    n, first = len(plant.A), plant.C[:1]
    total = PROPORTIONAL + DERIVATIVE
    law = np.hstack([-total * first, [[DERIVATIVE]]])
    drive = np.hstack([[[PROPORTIONAL, -total]], np.zeros((1, 3))])
    a = np.block([[plant.A, np.zeros((n, 1))], [first, np.zeros((1, 1))]])
    a[:n] += plant.B @ law
    b = np.vstack([plant.B @ drive, [[0.0, 1.0, 0.0, 0.0, 0.0]]])
    c = np.vstack([np.hstack([plant.C, np.zeros((4, 1))]), law])
    d = np.vstack([np.hstack([np.zeros((4, 1)), np.eye(4)]), drive])
    both = respond(a, b, c, d, np.zeros(n + 1), np.column_stack([reference, errors]))
    return both[:, 4:].copy(), both[:, :4].copy()
