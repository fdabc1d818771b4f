"""The linear part of a controller, for identification methods that use it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from idloop.control import build_controller
from idloop.errors import InputError

if TYPE_CHECKING:
    import control

# Limits make the law nonlinear; the linear part has none.
_BOUNDS = ("limit", "velocity_limit")


def linear_feedback(
    spec: Mapping[str, Any] | None, sample_time: float | None = None, where: str = "controller"
) -> dict[str, control.StateSpace]:
    """Systems from the measured outputs to the feedback that the controller subtracts from the command.

    Without limits the compiled step is affine in its state and its measurements, so that one step from each unit
    vector gives its matrices exactly.

    `spec`: ``controller:`` section of a model file. `sample_time`: sample time [s] of the law; that of the controller
    by default. `where`: place named at the start of an error line. Returns: by measured output, such as
    ``motor.position``; discrete, one input and one output each. Raises InputError: no controller, or one without
    feedback.
    """
    import control

    if spec is None:
        raise InputError(f"{where}: the model file has no controller; add the one that ran during the recording")
    free = {name: value for name, value in spec.items() if name not in _BOUNDS}
    if sample_time is not None:
        free["sample_time"] = float(sample_time)
    controller = build_controller(free, where)
    if not controller.inputs:
        raise InputError(f"{where}: type {controller.kind} has no feedback, so that the loop was open; leave it out")
    from idloop.control import step

    kernel = controller.kernel
    states, measured = kernel.state.size - step.STATE_TAIL, len(controller.inputs)

    def advance(point: np.ndarray[Any, np.dtype[np.float64]]) -> np.ndarray[Any, np.dtype[np.float64]]:
        state = kernel.state.copy()
        state[step.STARTED] = 1.0
        state[step.STATE_TAIL :] = point[:states]
        law = step.controller_step(kernel.kind, kernel.parameters, state, 0.0, 0.0, point[states:].copy(), 0.0)
        return np.append(state[step.STATE_TAIL :], law)

    size = states + measured
    rest = advance(np.zeros(size))
    slopes = np.column_stack([advance(unit) - rest for unit in np.eye(size)])
    a, b = slopes[:states, :states], slopes[:states, states:]
    c, d = -slopes[states:, :states], -slopes[states:, states:]
    period = controller.sample_time
    return {
        name: control.ss(a, b[:, [i]], c, d[:, [i]], period, remove_useless_states=False)
        for i, name in enumerate(controller.inputs)
    }
