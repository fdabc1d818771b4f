"""Free run by scipy.integrate.solve_ivp, the dry friction as a smooth step."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

SMOOTHING = 1e-3  # rad/s over which friction changes sign


def work(data: dict[str, Any], settings: dict[str, Any]) -> Callable[[], dict[str, Any]]:
    """Positions at each sample; no step passes over a command."""
    inertia, viscous, dry, stiffness, damping, gain = (
        data[key].tolist() for key in ("inertia", "viscous", "dry", "stiffness", "damping", "gain")
    )
    bodies, period, command = len(inertia), settings["period"], data["command"]
    stamps, last = np.arange(len(command)) * period, len(command) - 1
    # What the worker warms up on needs no more than a beginning.
    if "beginning" in data:
        stamps = stamps[:50]

    def one(t: float, state: Any) -> tuple[float, float]:
        v = state[1]
        force = gain[0] * command[min(int(t / period + 1e-9), last)] - viscous[0] * v
        return v, (force - dry[0] * np.tanh(v / SMOOTHING) if dry[0] else force) / inertia[0]

    def many(t: float, state: Any) -> Any:
        before = gain[0] * command[min(int(t / period + 1e-9), last)]
        found = [*state[bodies:]]
        for i in range(bodies):
            v, after = state[bodies + i], 0.0
            if i + 1 < bodies:
                after = stiffness[i] * (state[i] - state[i + 1]) + damping[i] * (v - state[bodies + i + 1])
            found.append((before - after - viscous[i] * v - dry[i] * np.tanh(v / SMOOTHING)) / inertia[i])
            before = after
        return found

    def act() -> dict[str, Any]:
        found = solve_ivp(
            one if bodies == 1 else many, (stamps[0], stamps[-1]), np.zeros(2 * bodies), method=settings["method"],
            t_eval=stamps, max_step=period, rtol=1e-6, atol=1e-9,
        )  # fmt: skip
        return {"position": found.y[:bodies].T}

    return act


def shorter(data: dict[str, Any]) -> dict[str, Any]:
    """Mark for the warm-up."""
    return data | {"beginning": np.ones(1)}
