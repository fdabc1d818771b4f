"""jax-sysid: the motor's equations in JAX, L-BFGS with exact gradients on the free-run errors."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax_sysid.models import Model

jax.config.update("jax_enable_x64", True)


def work(data: dict[str, Any], settings: dict[str, Any]) -> Callable[[], dict[str, Any]]:
    """Viscous motor: the exact step of the held command; parameters of unit size at the start."""
    names, period = list(settings["names"]), settings["period"]
    start = np.array([settings["start"][name] for name in names])
    weight = jnp.asarray(1.0 / data["deviations"])

    @jax.jit
    def move(x: Any, u: Any, params: Any) -> Any:
        gain, viscous = params[0] * start
        end = gain * u[0] / viscous
        decay = jnp.exp(-viscous * period)
        return jnp.array([x[0] + end * period + (x[1] - end) * (1.0 - decay) / viscous, end + (x[1] - end) * decay])

    @jax.jit
    def see(x: Any, u: Any, params: Any) -> Any:
        return x * weight

    inputs, outputs = data["command"][:, None], data["output"] / data["deviations"]

    def act() -> dict[str, Any]:
        model = Model(2, 2, 1, state_fcn=move, output_fcn=see)
        model.init(params=[np.ones(len(names))], x0=np.zeros(2))
        model.loss(rho_x0=0.0, rho_th=0.0, train_x0=False)
        model.optimization(adam_epochs=0, lbfgs_epochs=200, iprint=-1)
        model.fit(outputs, inputs)
        return dict(zip(names, np.asarray(model.params[0]) * start, strict=True))

    return act
