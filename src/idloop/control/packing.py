"""Flat arrays of the compiled step for a checked controller section."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from idloop.arrays import Array
from idloop.control import step
from idloop.errors import InputError
from idloop.physics.controller_section import controller_inputs, joint_and_field

_WINDUP = {
    "none": step.WINDUP_FREE,
    "back_calculation": step.BACK_CALCULATION,
    "conditional": step.CONDITIONAL,
}
_FOLLOWS = {
    "position": step.FOLLOWS_POSITION,
    "velocity": step.FOLLOWS_VELOCITY,
    "effort": step.FOLLOWS_NOTHING,
}


@dataclass(frozen=True)
class Kernel:
    """A controller as a compiled closed loop needs it.

    `kind`: first argument of ``idloop.control.step.controller_step``. `parameters`: second argument; not changed by the
    step. `state`: third argument, as after a reset; the step changes it in place, so give it a copy. `inputs`: outputs
    in the argument y, in order.
    """

    kind: int
    parameters: Array
    state: Array
    inputs: tuple[str, ...]


def pack(values: Mapping[str, Any], where: str = "controller") -> Kernel:
    """Fill the arrays of `controller_step`.

    `values`: result of ``check_controller``; `where`: place named at the start of an error line.
    """
    kind, tail, states = _TAILS[values["type"]](values, where)
    limit = values["limit"]
    head = [0.0] * step.PARAMETER_TAIL
    head[step.SAMPLE_TIME] = values["sample_time"]
    head[step.LIMIT] = math.inf if limit is None else limit
    head[step.FEEDBACK_GAIN] = values.get("feedback_gain", 1.0)
    head[step.LINEARISATION_GAIN] = values["linearisation.gain"]
    head[step.LINEARISATION_OFFSET] = values["linearisation.offset"]
    parameters = np.array(head + tail, dtype=np.float64)
    return Kernel(kind, parameters, np.zeros(step.STATE_TAIL + states), controller_inputs(values))


_Tail = tuple[int, list[float], int]


def _pid(values: Mapping[str, Any], where: str) -> _Tail:
    kp, ki, kd = values["kp"], values.get("ki", 0.0), values.get("kd", 0.0)
    # Åström and Hägglund: between the integral and the derivative time.
    suggestion = math.sqrt(abs(kd / ki)) if ki and kd else abs(kp / ki) if ki else 0.0
    gains = [kp, ki, kd, values.get("derivative_filter", 0.0), values["velocity_feedforward"]]
    return step.PID, [*gains, _follows_velocity(values, where), *_anti_windup(values, suggestion)], 3


def _lead(values: Mapping[str, Any], where: str) -> _Tail:
    gain, zero, pole = values["gain"], values["zero"], values["pole"]
    twice = 2.0 / values["sample_time"]
    tail = [
        gain * (twice + zero) / (twice + pole),
        gain * (zero - twice) / (twice + pole),
        (pole - twice) / (twice + pole),
        _follows_velocity(values, where),
    ]
    return step.LEAD, tail, 2


def _cascade(values: Mapping[str, Any], where: str) -> _Tail:
    del where
    limit = values["velocity_limit"]
    source = step.MEAN if values["velocity_estimate"] == "mean" else step.BACKWARD
    if values["velocity_output"] is not None:
        source = step.MEASURED
    suggestion = abs(values["kv"] / values["ki"]) if values["ki"] else 0.0
    gains = [values[key] for key in ("kp", "kv", "ki", "velocity_feedforward")]
    most = math.inf if limit is None else limit
    return step.CASCADE, [*gains, most, source, values["velocity_filter"], *_anti_windup(values, suggestion)], 4


def _state_feedback(values: Mapping[str, Any], where: str) -> _Tail:
    states, inputs = values["states"], controller_inputs(values)
    gains = values["gains"]
    if gains is None:
        sample_time = values["sample_time"] if values["design"] == "discrete" else None
        gains = linear_quadratic_gains(
            values["model.a"], values["model.b"], values["q"], values["r"], sample_time, where
        )
    tail = [values["derivative_filter"], float(len(states))]
    for name, gain in zip(states, gains, strict=True):
        joint, field = joint_and_field(name, "states", where)
        differentiated = name in values["differentiate"]
        source = inputs.index(f"{joint}.position" if differentiated else name)
        tail += [float(gain), _FOLLOWS[field], float(source), float(differentiated)]
    return step.STATE_FEEDBACK, tail, 2 * len(states)


def _follows_velocity(values: Mapping[str, Any], where: str) -> float:
    return float(joint_and_field(values["output"], "output", where)[1] == "velocity")


def _anti_windup(values: Mapping[str, Any], suggestion: float) -> list[float]:
    given = values.get("tracking_time")
    # Below one period back calculation would overshoot.
    time = max(suggestion if given is None else given, values["sample_time"])
    return [_WINDUP[values.get("anti_windup", "none")], time]


_TAILS: dict[str, Callable[[Mapping[str, Any], str], _Tail]] = {
    "none": lambda values, where: (step.NONE, [], 0),
    "p": _pid,
    "pd": _pid,
    "pid": _pid,
    "lead": _lead,
    "cascade": _cascade,
    "state_feedback": _state_feedback,
}


def linear_quadratic_gains(
    a: ArrayLike,
    b: Sequence[float],
    q: Sequence[float],
    r: float,
    sample_time: float | None,
    where: str = "controller",
) -> Array:
    """Gains K of law = -K x that minimise the sum of x' diag(q) x + r law².

    `a` (n, n): state matrix of the continuous model. `b`: input matrix of the continuous model. `q`: state weights.
    `r`: command weight. `sample_time`: seconds: design for the model sampled with the command held; None: continuous
    design. `where`: place named at the start of the error line. Returns shape (n,). Raises InputError: no stabilising
    solution exists.
    """
    from scipy.signal import cont2discrete

    import control

    A = np.asarray(a, dtype=np.float64)
    B = np.asarray(b, dtype=np.float64).reshape(-1, 1)
    Q, R = np.diag(q), np.array([[r]])
    try:
        if sample_time is None:
            gains, _, poles = control.lqr(A, B, Q, R)
            stable = bool(np.all(np.real(poles) < 0.0))
        else:
            F, G, *_ = cont2discrete((A, B, np.eye(A.shape[0]), np.zeros_like(B)), sample_time)
            gains, _, poles = control.dlqr(F, G, Q, R)
            stable = bool(np.all(np.abs(poles) < 1.0))
        if stable and np.all(np.isfinite(gains)):
            return np.asarray(gains, dtype=np.float64).ravel()
        cause = None
    # python-control raises whatever its back end does: ControlException, LinAlgError or ValueError.
    except Exception as error:  # noqa: BLE001
        cause = error
    raise InputError(
        f"{where}: the linear-quadratic design has no stabilising solution; check that model.b reaches every unstable"
        " state of model.a and that q weighs it"
    ) from cause
