"""The yardstick: compiled Runge-Kutta 4 with stick and slip, least_squares with finite differences."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit
from scipy.optimize import least_squares


@njit
def friction(speed: float, coulomb: float, static: float, velocity: float) -> float:
    """Stribeck's curve."""
    ratio = speed / velocity
    return coulomb + (static - coulomb) * math.exp(-ratio * ratio)


@njit
def step(v: float, h: float, drive: float, mode: float, theta: Any) -> tuple[float, float]:
    """Runge-Kutta 4: way and speed after h."""
    k1 = drive - theta[1] * v - mode * friction(v, theta[2], theta[3], theta[4])
    v2 = v + 0.5 * h * k1
    k2 = drive - theta[1] * v2 - mode * friction(v2, theta[2], theta[3], theta[4])
    v3 = v + 0.5 * h * k2
    k3 = drive - theta[1] * v3 - mode * friction(v3, theta[2], theta[3], theta[4])
    v4 = v + h * k3
    k4 = drive - theta[1] * v4 - mode * friction(v4, theta[2], theta[3], theta[4])
    return h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4), v + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)


@njit
def simulate(theta: Any, command: Any, period: float) -> Any:
    """Free run from rest; a step in which the motor comes to rest is cut there."""
    out = np.empty((len(command), 2))
    x, v = 0.0, 0.0
    for k in range(len(command)):
        out[k, 0], out[k, 1] = x, v
        drive, left = theta[0] * command[k], period
        for _ in range(20):
            if v == 0.0:
                if abs(drive) <= theta[3]:
                    break
                mode = 1.0 if drive > 0.0 else -1.0
            else:
                mode = 1.0 if v > 0.0 else -1.0
            way, after = step(v, left, drive, mode, theta)
            if after * mode >= 0.0:
                x, v = x + way, after
                break
            h = left * v / (v - after)
            for _ in range(3):
                way, after = step(v, h, drive, mode, theta)
                h = min(max(h - after * h / (after - v), 0.0), left)
            way, after = step(v, h, drive, mode, theta)
            x, v = x + way, 0.0
            left -= h
            if left < 1e-15:
                break
    return out


def work(data: dict[str, Any], settings: dict[str, Any]) -> Callable[[], dict[str, Any]]:
    """Weighted free-run errors, parameters of unit size at the start."""
    names = list(settings["names"])
    start = np.array([settings["start"][name] for name in names])

    def errors(scaled: Any) -> Any:
        theta = np.array([0.0, 0.0, 0.0, 0.0, 1.0])
        theta[: len(names)] = scaled * start
        return ((data["output"] - simulate(theta, data["command"], settings["period"])) / data["deviations"]).ravel()

    def act() -> dict[str, Any]:
        found = least_squares(errors, np.ones(len(start)), bounds=(1e-6, np.inf), x_scale="jac", ftol=1e-8, xtol=1e-8)
        return dict(zip(names, found.x * start, strict=True)) | {"evaluations": found.nfev * (1 + len(names))}

    return act
