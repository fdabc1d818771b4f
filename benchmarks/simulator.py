"""Speed and accuracy of the compiled simulator beside scipy.integrate.solve_ivp, in one run.

The DC motor preset with Coulomb friction, 30 s at 1 kHz, command held over each sample. SciPy
gets the friction as a smooth step (it cannot stick) and may not step over a command. Both are
compared with the exact solution between events.

    .venv/bin/python benchmarks/simulator.py
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from statistics import median

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from idloop.physics import load_model, simulate

GAIN, VISCOUS, LEVEL = 8.255, 2.306, 1.0
SMOOTHING = 1e-3  # rad/s over which SciPy's friction changes sign

Array = NDArray[np.float64]


def exact(stamps: Array, command: Array) -> Array:
    """Solve piecewise between commands and standstills; returns position and velocity (n, 2)."""
    out = np.zeros((len(stamps), 2))
    x = v = 0.0
    for k in range(len(stamps) - 1):
        left, drive = stamps[k + 1] - stamps[k], GAIN * command[k]
        while left > 0.0:
            direction = np.sign(v) if v != 0.0 else np.sign(drive) * (abs(drive) > LEVEL)
            if direction == 0.0:
                break
            end = (drive - LEVEL * direction) / VISCOUS
            stop = np.log((v - end) / -end) / VISCOUS if v * end < 0.0 else np.inf
            step = min(left, stop)
            decay = np.exp(-VISCOUS * step)
            x += end * step + (v - end) * (1.0 - decay) / VISCOUS
            v = end + (v - end) * decay if stop > left else 0.0
            left -= step
        out[k + 1] = x, v
    return out


def with_scipy(stamps: Array, command: Array, method: str) -> Array:
    """Solve with a smoothed friction; the step is bounded so that no command is passed over."""
    period = stamps[1] - stamps[0]
    last = len(command) - 1

    def rate(t: float, state: Array) -> tuple[float, float]:
        u = command[min(int(t / period + 1e-9), last)]
        v = state[1]
        return v, GAIN * u - VISCOUS * v - LEVEL * np.tanh(v / SMOOTHING)

    return solve_ivp(
        rate, (stamps[0], stamps[-1]), [0.0, 0.0], method=method, t_eval=stamps, max_step=period, rtol=1e-6, atol=1e-9
    ).y.T


def timed(work: Callable[[], Array], runs: int) -> tuple[float, Array]:
    """Median time of some runs, and the result."""
    times = []
    for _ in range(runs):
        start = time.perf_counter()
        result = work()
        times.append(time.perf_counter() - start)
    return median(times), result


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=30.0, help="length of the run [s] (default 30)")
    parser.add_argument("--seed", type=int, default=1, help="seed of the command (default 1)")
    arguments = parser.parse_args()
    stamps = np.arange(int(arguments.seconds * 1000)) * 1e-3
    random = np.random.default_rng(arguments.seed)
    command = np.repeat(random.uniform(-1.0, 1.0, len(stamps) // 200 + 1), 200)[: len(stamps)]
    model = load_model("dc_motor").with_effect("coulomb_friction", "motor", level=LEVEL)

    simulate(model, stamps[:10], command[:10], stamps[:10])  # compiled and cached before the clock starts
    truth = exact(stamps, command)
    ours, output = timed(lambda: simulate(model, stamps, command, stamps).output, 21)
    print(f"{'':24s}{'time':>12s}{'ratio':>8s}{'largest error of position':>28s}")
    print(f"{'idloop':24s}{ours * 1e3:9.2f} ms{1:8.0f}{np.abs(output - truth)[:, 0].max():24.1e} rad")
    for method in ("RK45", "LSODA", "Radau"):
        theirs, output = timed(lambda name=method: with_scipy(stamps, command, name), 1)  # type: ignore[misc]
        error = np.abs(output - truth)[:, 0].max()
        print(f"{'solve_ivp ' + method:24s}{theirs * 1e3:9.0f} ms{theirs / ours:8.0f}{error:24.1e} rad")


if __name__ == "__main__":
    main()
