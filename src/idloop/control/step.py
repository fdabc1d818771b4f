"""The compiled step of every controller.

Everything that `controller_step` calls stands in this file: numba's cache only notices changes in
the file of the function that is compiled, so a helper elsewhere could go stale unseen.

Parameters and state are flat arrays. Each starts with a head that all controllers share; the tail
belongs to the kind. `idloop.control.packing` fills them.

A command is formed as ``u = clip((law + feedforward - offset) / gain, -limit, limit)``: the
linearisation block (Linköping thesis, eq. 4.1) stands in front of the plant, the limit behind it.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# Kinds.
NONE = 0
PID = 1
LEAD = 2
CASCADE = 3
STATE_FEEDBACK = 4

# Head of the parameters.
SAMPLE_TIME = 0
LIMIT = 1
FEEDBACK_GAIN = 2
LINEARISATION_GAIN = 3
LINEARISATION_OFFSET = 4
PARAMETER_TAIL = 5

# Head of the state.
FAULT = 0
SATURATED = 1
STARTED = 2
TRACKING = 3
TRACKED_COMMAND = 4
STATE_TAIL = 5

# Values of the fault flag.
NO_FAULT = 0.0
BAD_MEASUREMENT = 1.0
BAD_REFERENCE = 2.0
BAD_FEEDFORWARD = 3.0
BAD_COMMAND = 4.0

# Anti-windup.
WINDUP_FREE = 0.0
BACK_CALCULATION = 1.0
CONDITIONAL = 2.0

# Sources of the cascade's velocity.
MEASURED = 0.0
BACKWARD = 1.0
MEAN = 2.0

# What a state of the state feedback follows.
FOLLOWS_NOTHING = 0.0
FOLLOWS_POSITION = 1.0
FOLLOWS_VELOCITY = 2.0


@njit(cache=True)
def _finish(parameters: FloatArray, state: FloatArray, law: float) -> float:
    """Linearise and limit; sets the saturation and fault flags."""
    raw = (law - parameters[LINEARISATION_OFFSET]) / parameters[LINEARISATION_GAIN]
    if not math.isfinite(raw):
        state[FAULT] = BAD_COMMAND
        return 0.0
    limit = parameters[LIMIT]
    command: float = min(max(raw, -limit), limit)
    state[SATURATED] = 1.0 if command != raw else 0.0
    return command


@njit(cache=True)
def _before_linearisation(parameters: FloatArray, command: float) -> float:
    """The law that gives this command."""
    law: float = command * parameters[LINEARISATION_GAIN] + parameters[LINEARISATION_OFFSET]
    return law


@njit(cache=True)
def _integrate(
    parameters: FloatArray,
    state: FloatArray,
    integral: float,
    increment: float,
    law: float,
    command: float,
    anti_windup: float,
    tracking_time: float,
) -> float:
    """Next value of an integrator that is kept from winding up while the command is limited."""
    if state[SATURATED] == 0.0 or anti_windup == WINDUP_FREE:
        return integral + increment
    excess = _before_linearisation(parameters, command) - law
    if anti_windup == BACK_CALCULATION:
        correction: float = parameters[SAMPLE_TIME] / tracking_time * excess
        return integral + increment + correction
    # Conditional integration: stop only while the integral would drive further into the limit.
    return integral if increment * excess < 0.0 else integral + increment


@njit(cache=True)
def _filtered_difference(
    y: float, previous: float, derivative: float, sample_time: float, time_constant: float
) -> float:
    """Backward-Euler derivative behind a first-order low-pass; 0 s gives the plain difference."""
    return (time_constant * derivative + y - previous) / (time_constant + sample_time)


# Every kind has the same arguments, whether it needs them or not.
@njit(cache=True)
def none_step(
    parameters: FloatArray,
    state: FloatArray,
    reference_position: float,
    reference_velocity: float,
    y: FloatArray,
    feedforward: float,
) -> float:
    """Feedforward only."""
    return _finish(parameters, state, feedforward)


@njit(cache=True)
def pid_step(
    parameters: FloatArray,
    state: FloatArray,
    reference_position: float,
    reference_velocity: float,
    y: FloatArray,
    feedforward: float,
) -> float:
    """PID with the derivative on the output only (Linköping thesis, eq. 4.2).

    P and PD are the same with zero gains. The integral is a forward, the
    derivative a backward difference.
    """
    kp, ki, kd, derivative_filter, velocity_gain, follows_velocity, anti_windup, tracking_time = parameters[
        PARAMETER_TAIL : PARAMETER_TAIL + 8
    ]
    measured = parameters[FEEDBACK_GAIN] * y[0]
    reference = reference_velocity if follows_velocity != 0.0 else reference_position
    error = reference - measured
    derivative = 0.0
    if state[STARTED] != 0.0:
        derivative = _filtered_difference(
            measured,
            state[STATE_TAIL + 1],
            state[STATE_TAIL + 2],
            parameters[SAMPLE_TIME],
            derivative_filter,
        )
    without_integral = kp * error - kd * derivative + velocity_gain * reference_velocity + feedforward
    integral = state[STATE_TAIL]
    if state[TRACKING] != 0.0 and ki != 0.0:
        integral = _before_linearisation(parameters, state[TRACKED_COMMAND]) - without_integral
    law = without_integral + integral
    command = _finish(parameters, state, law)
    state[STATE_TAIL] = _integrate(
        parameters,
        state,
        integral,
        ki * parameters[SAMPLE_TIME] * error,
        law,
        command,
        anti_windup,
        tracking_time,
    )
    state[STATE_TAIL + 1] = measured
    state[STATE_TAIL + 2] = derivative
    return command


@njit(cache=True)
def lead_step(
    parameters: FloatArray,
    state: FloatArray,
    reference_position: float,
    reference_velocity: float,
    y: FloatArray,
    feedforward: float,
) -> float:
    """First-order compensator gain (s + zero) / (s + pole) on the error, discretised by Tustin."""
    b0, b1, a1, follows_velocity = parameters[PARAMETER_TAIL : PARAMETER_TAIL + 4]
    reference = reference_velocity if follows_velocity != 0.0 else reference_position
    error = reference - parameters[FEEDBACK_GAIN] * y[0]
    output = b0 * error + b1 * state[STATE_TAIL] - a1 * state[STATE_TAIL + 1]
    state[STATE_TAIL] = error
    state[STATE_TAIL + 1] = output
    return _finish(parameters, state, output + feedforward)


@njit(cache=True)
def cascade_step(
    parameters: FloatArray,
    state: FloatArray,
    reference_position: float,
    reference_velocity: float,
    y: FloatArray,
    feedforward: float,
) -> float:
    """Position P around velocity PI.

    v_ref = kp (r - y) + kf r' and law = kv (v_ref - v) + ki ∫(v_ref - v).

    With ``ki = 0``, ``kf = 0`` and the mean estimate it is the EMPS drive's law.
    """
    kp, kv, ki, velocity_gain, velocity_limit, source, time_constant, anti_windup, tracking_time = parameters[
        PARAMETER_TAIL : PARAMETER_TAIL + 9
    ]
    sample_time = parameters[SAMPLE_TIME]
    position = parameters[FEEDBACK_GAIN] * y[0]
    if state[STARTED] == 0.0:
        state[STATE_TAIL + 1] = position
        state[STATE_TAIL + 2] = position
    if source == MEASURED:
        velocity = parameters[FEEDBACK_GAIN] * y[1]
    elif source == BACKWARD:
        velocity = (position - state[STATE_TAIL + 1]) / sample_time
    else:
        # Backward difference of the mean of two neighbouring samples.
        velocity = (position - state[STATE_TAIL + 2]) / (2.0 * sample_time)
    if state[STARTED] != 0.0:
        velocity = (time_constant * state[STATE_TAIL + 3] + sample_time * velocity) / (time_constant + sample_time)
    wanted = kp * (reference_position - position) + velocity_gain * reference_velocity
    error = min(max(wanted, -velocity_limit), velocity_limit) - velocity
    integral = state[STATE_TAIL]
    if state[TRACKING] != 0.0 and ki != 0.0:
        tracked = _before_linearisation(parameters, state[TRACKED_COMMAND])
        integral = tracked - kv * error - feedforward
    law = kv * error + integral + feedforward
    command = _finish(parameters, state, law)
    state[STATE_TAIL] = _integrate(
        parameters,
        state,
        integral,
        ki * sample_time * error,
        law,
        command,
        anti_windup,
        tracking_time,
    )
    state[STATE_TAIL + 2] = state[STATE_TAIL + 1]
    state[STATE_TAIL + 1] = position
    state[STATE_TAIL + 3] = velocity
    return command


@njit(cache=True)
def state_feedback_step(
    parameters: FloatArray,
    state: FloatArray,
    reference_position: float,
    reference_velocity: float,
    y: FloatArray,
    feedforward: float,
) -> float:
    """Law = Σ gain_i (reference_i - x_i), x_i measured or a filtered difference of one."""
    time_constant = parameters[PARAMETER_TAIL]
    count = int(parameters[PARAMETER_TAIL + 1])
    law = feedforward
    for i in range(count):
        gain, follows, source, differentiated = parameters[PARAMETER_TAIL + 2 + 4 * i : PARAMETER_TAIL + 6 + 4 * i]
        x = parameters[FEEDBACK_GAIN] * y[int(source)]
        if differentiated != 0.0:
            previous, derivative = STATE_TAIL + 2 * i, STATE_TAIL + 2 * i + 1
            measured = x
            x = 0.0
            if state[STARTED] != 0.0:
                x = _filtered_difference(
                    measured,
                    state[previous],
                    state[derivative],
                    parameters[SAMPLE_TIME],
                    time_constant,
                )
            state[previous] = measured
            state[derivative] = x
        reference = 0.0
        if follows == FOLLOWS_POSITION:
            reference = reference_position
        elif follows == FOLLOWS_VELOCITY:
            reference = reference_velocity
        law += gain * (reference - x)
    return _finish(parameters, state, law)


@njit(cache=True)
def controller_step(
    kind: int,
    parameters: FloatArray,
    state: FloatArray,
    reference_position: float,
    reference_velocity: float,
    y: FloatArray,
    feedforward: float = 0.0,
) -> float:
    """One step of any controller.

    Parameters
    ----------
    kind : int
        ``NONE``, ``PID``, ``LEAD``, ``CASCADE`` or ``STATE_FEEDBACK``.
    parameters, state : ndarray of float64
        From ``controller.kernel``; the state is changed in place.
    reference_position, reference_velocity : float
        What to follow.
    y : ndarray of float64, shape (inputs,)
        The controller's inputs and no others, in its order.
    feedforward : float
        Added to the law, before linearisation and limit.

    Returns
    -------
    float
        The command. It is 0, and ``state[FAULT]`` says why, from the first value that is not
        finite until the state is reset: a drive must not act on nonsense.
    """
    if state[FAULT] != NO_FAULT:
        return 0.0
    for i in range(y.size):
        if not math.isfinite(y[i]):
            state[FAULT] = BAD_MEASUREMENT
            return 0.0
    if not (math.isfinite(reference_position) and math.isfinite(reference_velocity)):
        state[FAULT] = BAD_REFERENCE
        return 0.0
    if not math.isfinite(feedforward):
        state[FAULT] = BAD_FEEDFORWARD
        return 0.0
    if kind == PID:
        command = pid_step(parameters, state, reference_position, reference_velocity, y, feedforward)
    elif kind == LEAD:
        command = lead_step(parameters, state, reference_position, reference_velocity, y, feedforward)
    elif kind == CASCADE:
        command = cascade_step(parameters, state, reference_position, reference_velocity, y, feedforward)
    elif kind == STATE_FEEDBACK:
        command = state_feedback_step(parameters, state, reference_position, reference_velocity, y, feedforward)
    else:
        command = none_step(parameters, state, reference_position, reference_velocity, y, feedforward)
    state[STARTED] = 1.0
    state[TRACKING] = 0.0
    return command
