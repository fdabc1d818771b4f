"""solve_ivp and least_squares: what one writes first. The friction is a smooth step, the start as for all."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

SMOOTHING = 1e-3  # rad/s over which friction changes sign


def shorter(data: dict[str, Any]) -> dict[str, Any]:
    """Beginning of the record."""
    return {key: value[:300] if len(value) > 300 else value for key, value in data.items()}


def work(data: dict[str, Any], settings: dict[str, Any]) -> Callable[[], dict[str, Any]]:
    """Stops after `most` slopes: the rest of the answer is what was reached by then."""
    names, period = list(settings["names"]), settings["period"]
    start = np.array([settings["start"][name] for name in names])
    command = data["command"].tolist()
    stamps, last, count = np.arange(len(command)) * period, len(command) - 1, [0]

    def errors(scaled: Any) -> Any:
        count[0] += 1
        gain, viscous, coulomb, static, velocity = (scaled * start).tolist()

        def rate(t: float, state: Any) -> tuple[float, float]:
            v = state[1]
            level = coulomb + (static - coulomb) * np.exp(-((v / velocity) ** 2))
            return v, gain * command[min(int(t / period + 1e-9), last)] - viscous * v - level * np.tanh(v / SMOOTHING)

        run = solve_ivp(
            rate, (0.0, stamps[-1]), [0.0, 0.0], method="LSODA", t_eval=stamps, max_step=period, rtol=1e-6, atol=1e-9
        )
        return ((data["output"] - run.y.T) / data["deviations"]).ravel()

    def act() -> dict[str, Any]:
        count[0] = 0
        found = least_squares(
            errors, np.ones(len(start)), bounds=(1e-6, np.inf), x_scale="jac", max_nfev=settings.get("most")
        )
        return dict(zip(names, found.x * start, strict=True)) | {
            "evaluations": count[0],
            "stopped": float(found.status == 0),
        }

    return act
