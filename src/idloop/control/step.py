"""The compiled step of every controller.

Everything that `controller_step` calls is in this file: numba's cache only notices changes in the file of
the compiled function, so that machine code of a helper elsewhere could be stale.

Parameters and state are flat arrays. Each starts with a head common to all controllers; the tail depends on
the kind. `idloop.control.packing` fills them.

A command is formed as ``u = clip((law + feedforward - offset) / gain, -limit, limit)``: the
linearisation block (Linköping thesis, eq. 4.1) is followed by the limit. A compensator
(`idloop.control.compensation`) acts between the two: it adds the force that the known effects require along the
reference, and applies the inverses of the effects on the command.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from idloop.physics.kernel import call

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
COMPENSATION = 5  # index of the compensator's parameters; 0: no compensator
PARAMETER_TAIL = 6

# Head of the state.
FAULT = 0
SATURATED = 1
STARTED = 2
TRACKING = 3
TRACKED_COMMAND = 4
ADDED = 5  # what the compensator added to the last command
STATE_TAIL = 6

# Parameters of a compensator from the index `COMPENSATION` on; then a row for each inverse and each force, then the
# parameters of their equations.
MEMORY = 0  # index of its state
MOST = 1  # largest command that it adds
COMMAND_WIDTH = 2
VELOCITY_WIDTH = 3
PER_REFERENCE = 4  # motion of the bodies for one unit of the reference
GIVES_VELOCITY = 5  # the reference is a velocity
DRIVE_GAIN = 6
GAP = 7
GAP_SHIFTS = 8  # the reference crosses the gap with the drive, not the drive alone
GAP_INERTIA = 9
GAP_VISCOUS = 10
CROSSING_TIME = 11
INVERSES = 12
FORCES = 13
COMPENSATOR_HEAD = 14
# Columns of a row. Addresses of machine code are integers that a float represents exactly.
UNDO = 0  # address of the inverse, the force or the friction
FORWARD = 1  # address of the forward equation, or of the update of a force's state; 0: none
ROW_PARAMETER = 2
ROW_STATE = 3
ROW_INERTIA = 4
BEFORE_GAP = 5
IS_FRICTION = 6
ROW = 7

# State of a compensator, then that of its equations.
REFERENCE = 0
DIFFERENCE = 1
POSITION = 2  # of the bodies behind the gap, and their velocity
VELOCITY = 3
EXTREME = 4
SIDE = 5
CROSSING_FROM = 6
CROSSING_TO = 7
CROSSING_CLOCK = 8
AHEAD = 9  # lead of the bodies before the gap, its velocity, and the required force
AHEAD_RATE = 10
AHEAD_FORCE = 11
COMPENSATOR_STATE = 12

# Iterations of a friction that depends on the load and adds to it: 1 % accuracy for ratios up to a half.
LOADINGS = 8
# A reversal of the reference is a return by this share of a gap.
TURNED = 0.01

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
def smooth_sign(value: float, width: float) -> float:
    """Smooth sign: 3/2 x - 1/2 x³ with x = value / width, and exactly -1 or +1 outside of the width."""
    if value >= width:
        return 1.0 if value > 0.0 else 0.0
    if value <= -width:
        return -1.0
    x = value / width
    return x * (1.5 - 0.5 * x * x)


@njit(cache=True)
def _force_along_reference(parameters: FloatArray, state: FloatArray, arriving: float) -> float:
    """Drive force that known effects require along the reference; ``arriving`` is the force without them."""
    c = int(parameters[COMPENSATION])
    s = int(parameters[c + MEMORY])
    force: float = state[s + AHEAD_FORCE]
    row = c + COMPENSATOR_HEAD + ROW * int(parameters[c + INVERSES])
    for _ in range(int(parameters[c + FORCES])):
        before = parameters[row + BEFORE_GAP]
        velocity = state[s + VELOCITY] + before * state[s + AHEAD_RATE]
        address, at = int(parameters[row + UNDO]), int(parameters[row + ROW_STATE])
        numbers = int(parameters[row + ROW_PARAMETER])
        if parameters[row + IS_FRICTION] != 0.0:
            side = smooth_sign(velocity, parameters[c + VELOCITY_WIDTH])
            if side != 0.0:
                direction = 1.0 if side > 0.0 else -1.0
                level, last = 0.0, -1.0
                # Friction of a loaded contact adds to the load: fixed-point iteration.
                for _ in range(LOADINGS):
                    if level == last:
                        break
                    last = level
                    torque = abs(arriving + force + side * last)
                    found = call(address, direction, abs(velocity), torque, 0.0, state, at, parameters, numbers)
                    level = max(found, 0.0)
                force += side * level
        else:
            position = state[s + POSITION] + before * state[s + AHEAD]
            force -= call(
                address, position, velocity, parameters[row + ROW_INERTIA], 0.0, state, at, parameters, numbers
            )
        row += ROW
    return force


@njit(cache=True)
def _compensated(parameters: FloatArray, state: FloatArray, wanted: float) -> float:
    """Command that has the result of ``wanted`` without the effects, within the limit of the compensator."""
    c = int(parameters[COMPENSATION])
    s = int(parameters[c + MEMORY])
    gain = parameters[c + DRIVE_GAIN]
    value = wanted + _force_along_reference(parameters, state, gain * wanted) / gain
    row = c + COMPENSATOR_HEAD
    for _ in range(int(parameters[c + INVERSES])):
        side = smooth_sign(value, parameters[c + COMMAND_WIDTH])
        value = call(
            int(parameters[row + UNDO]), value, state[s + VELOCITY], side, 0.0,
            state, int(parameters[row + ROW_STATE]), parameters, int(parameters[row + ROW_PARAMETER]),
        )  # fmt: skip
        row += ROW
    added: float = min(max(value - wanted, -parameters[c + MOST]), parameters[c + MOST])
    # A value that is not finite is passed on, so that the fault is detected.
    state[ADDED] = added if math.isfinite(value) else value
    return wanted + state[ADDED]


@njit(cache=True)
def _uncompensated(parameters: FloatArray, state: FloatArray, command: float) -> float:
    """Inverse of `_compensated`, without the smoothing and the limit."""
    c = int(parameters[COMPENSATION])
    s = int(parameters[c + MEMORY])
    gain = parameters[c + DRIVE_GAIN]
    value = command
    row = c + COMPENSATOR_HEAD + ROW * int(parameters[c + INVERSES])
    for _ in range(int(parameters[c + INVERSES])):
        row -= ROW
        value = call(
            int(parameters[row + FORWARD]), value, state[s + VELOCITY], command, 0.0,
            state, int(parameters[row + ROW_STATE]), parameters, int(parameters[row + ROW_PARAMETER]),
        )  # fmt: skip
    return value - _force_along_reference(parameters, state, gain * value) / gain


@njit(cache=True)
def _follow_reference(parameters: FloatArray, state: FloatArray, position: float, velocity: float) -> None:
    """Motion of the bodies along the reference, and their place in the gap."""
    c = int(parameters[COMPENSATION])
    s = int(parameters[c + MEMORY])
    sample_time, scale = parameters[SAMPLE_TIME], parameters[c + PER_REFERENCE]
    started = state[STARTED] != 0.0
    if parameters[c + GIVES_VELOCITY] != 0.0:
        state[s + VELOCITY] = scale * velocity
    else:
        # The velocity of the reference may be missing: the smaller of two differences, which ignores steps.
        here = scale * position
        difference = (here - state[s + REFERENCE]) / sample_time if started else 0.0
        before = state[s + DIFFERENCE]
        smaller = difference if abs(difference) < abs(before) else before
        state[s + VELOCITY] = smaller if difference * before > 0.0 else 0.0
        state[s + REFERENCE], state[s + DIFFERENCE], state[s + POSITION] = here, difference, here
        if parameters[c + GAP] > 0.0:
            _cross_gap(parameters, state, here, started)
    row = c + COMPENSATOR_HEAD + ROW * int(parameters[c + INVERSES])
    for _ in range(int(parameters[c + FORCES])):
        if parameters[row + FORWARD] != 0.0:
            ahead = parameters[row + BEFORE_GAP]
            call(
                int(parameters[row + FORWARD]), state[s + POSITION] + ahead * state[s + AHEAD],
                state[s + VELOCITY] + ahead * state[s + AHEAD_RATE], parameters[row + ROW_INERTIA],
                sample_time if started else 0.0,
                state, int(parameters[row + ROW_STATE]), parameters, int(parameters[row + ROW_PARAMETER]),
            )  # fmt: skip
        row += ROW


@njit(cache=True)
def _cross_gap(parameters: FloatArray, state: FloatArray, here: float, started: bool) -> None:
    """Lead of the bodies before a gap, which moves to its other side on a quintic after a reversal."""
    c = int(parameters[COMPENSATION])
    s = int(parameters[c + MEMORY])
    gap, time = parameters[c + GAP], parameters[c + CROSSING_TIME]
    if not started:
        state[s + EXTREME] = here
        state[s + CROSSING_CLOCK] = time
    side = state[s + SIDE]
    back = here - state[s + EXTREME]
    if abs(back) > TURNED * gap and back * side <= 0.0:
        side = 1.0 if back > 0.0 else -1.0
        state[s + SIDE] = side
    if back * side > 0.0:
        state[s + EXTREME] = here
    if state[s + CROSSING_CLOCK] < time:
        state[s + CROSSING_CLOCK] += parameters[SAMPLE_TIME]
    elif state[s + CROSSING_TO] != 0.5 * side:
        state[s + CROSSING_FROM], state[s + CROSSING_TO] = state[s + CROSSING_TO], 0.5 * side
        state[s + CROSSING_CLOCK] = parameters[SAMPLE_TIME]
    start, end = gap * state[s + CROSSING_FROM], gap * state[s + CROSSING_TO]
    x = min(state[s + CROSSING_CLOCK] / time, 1.0)
    way = end - start
    state[s + AHEAD] = start + way * x * x * x * (10.0 + x * (6.0 * x - 15.0))
    state[s + AHEAD_RATE] = way * 30.0 * x * x * (1.0 - x) * (1.0 - x) / time
    curve = way * 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) / (time * time)
    # A controller that measures behind the gap does not move the drive across it: a force has to.
    alone = 1.0 - parameters[c + GAP_SHIFTS]
    force = parameters[c + GAP_INERTIA] * curve + parameters[c + GAP_VISCOUS] * state[s + AHEAD_RATE]
    state[s + AHEAD_FORCE] = alone * force


@njit(cache=True)
def _finish(parameters: FloatArray, state: FloatArray, law: float) -> float:
    """Linearise and limit; set the saturation and fault flags."""
    raw = (law - parameters[LINEARISATION_OFFSET]) / parameters[LINEARISATION_GAIN]
    if parameters[COMPENSATION] != 0.0:
        raw = _compensated(parameters, state, raw)
    if not math.isfinite(raw):
        state[FAULT] = BAD_COMMAND
        return 0.0
    limit = parameters[LIMIT]
    command: float = min(max(raw, -limit), limit)
    state[SATURATED] = 1.0 if command != raw else 0.0
    return command


@njit(cache=True)
def _before_linearisation(parameters: FloatArray, state: FloatArray, command: float) -> float:
    """Law that results in this command, with what the compensator added."""
    law: float = (command - state[ADDED]) * parameters[LINEARISATION_GAIN] + parameters[LINEARISATION_OFFSET]
    return law


@njit(cache=True)
def _tracked_law(parameters: FloatArray, state: FloatArray) -> float:
    """Law that results in the command to take over from."""
    command = state[TRACKED_COMMAND]
    state[ADDED] = 0.0
    if parameters[COMPENSATION] != 0.0:
        state[ADDED] = command - _uncompensated(parameters, state, command)
    return _before_linearisation(parameters, state, command)


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
    """Next value of an integrator with anti-windup."""
    if state[SATURATED] == 0.0 or anti_windup == WINDUP_FREE:
        return integral + increment
    excess = _before_linearisation(parameters, state, command) - law
    if anti_windup == BACK_CALCULATION:
        correction: float = parameters[SAMPLE_TIME] / tracking_time * excess
        return integral + increment + correction
    # Conditional integration: stop while the integral would increase the excess over the limit.
    return integral if increment * excess < 0.0 else integral + increment


@njit(cache=True)
def _filtered_difference(
    y: float, previous: float, derivative: float, sample_time: float, time_constant: float
) -> float:
    """Backward-Euler derivative behind a first-order low-pass; 0 s gives the plain difference."""
    return (time_constant * derivative + y - previous) / (time_constant + sample_time)


# r, r_dot and y are the reference, its velocity and the measurements; every law has the same arguments.
@njit(cache=True)
def pid_step(
    parameters: FloatArray, state: FloatArray, r: float, r_dot: float, y: FloatArray, feedforward: float
) -> float:
    """PID with the derivative on the output only (Linköping thesis, eq. 4.2).

    P and PD are the same with zero gains. The integral is a forward, the
    derivative a backward difference.
    """
    kp, ki, kd, derivative_filter, velocity_gain, follows_velocity, anti_windup, tracking_time = parameters[
        PARAMETER_TAIL : PARAMETER_TAIL + 8
    ]
    measured = parameters[FEEDBACK_GAIN] * y[0]
    reference = r_dot if follows_velocity != 0.0 else r
    error = reference - measured
    derivative = 0.0
    if state[STARTED] != 0.0:
        derivative = _filtered_difference(
            measured, state[STATE_TAIL + 1], state[STATE_TAIL + 2], parameters[SAMPLE_TIME], derivative_filter
        )
    without_integral = kp * error - kd * derivative + velocity_gain * r_dot + feedforward
    integral = state[STATE_TAIL]
    if state[TRACKING] != 0.0 and ki != 0.0:
        integral = _tracked_law(parameters, state) - without_integral
    law = without_integral + integral
    command = _finish(parameters, state, law)
    state[STATE_TAIL] = _integrate(
        parameters, state, integral, ki * parameters[SAMPLE_TIME] * error, law, command, anti_windup, tracking_time
    )
    state[STATE_TAIL + 1] = measured
    state[STATE_TAIL + 2] = derivative
    return command


@njit(cache=True)
def lead_step(
    parameters: FloatArray, state: FloatArray, r: float, r_dot: float, y: FloatArray, feedforward: float
) -> float:
    """First-order compensator gain (s + zero) / (s + pole) on the error, discretised by Tustin."""
    b0, b1, a1, follows_velocity = parameters[PARAMETER_TAIL : PARAMETER_TAIL + 4]
    reference = r_dot if follows_velocity != 0.0 else r
    error = reference - parameters[FEEDBACK_GAIN] * y[0]
    output = b0 * error + b1 * state[STATE_TAIL] - a1 * state[STATE_TAIL + 1]
    state[STATE_TAIL] = error
    state[STATE_TAIL + 1] = output
    return _finish(parameters, state, output + feedforward)


@njit(cache=True)
def cascade_step(
    parameters: FloatArray, state: FloatArray, r: float, r_dot: float, y: FloatArray, feedforward: float
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
    wanted = kp * (r - position) + velocity_gain * r_dot
    error = min(max(wanted, -velocity_limit), velocity_limit) - velocity
    integral = state[STATE_TAIL]
    if state[TRACKING] != 0.0 and ki != 0.0:
        integral = _tracked_law(parameters, state) - kv * error - feedforward
    law = kv * error + integral + feedforward
    command = _finish(parameters, state, law)
    state[STATE_TAIL] = _integrate(
        parameters, state, integral, ki * sample_time * error, law, command, anti_windup, tracking_time
    )
    state[STATE_TAIL + 2] = state[STATE_TAIL + 1]
    state[STATE_TAIL + 1] = position
    state[STATE_TAIL + 3] = velocity
    return command


@njit(cache=True)
def state_feedback_step(
    parameters: FloatArray, state: FloatArray, r: float, r_dot: float, y: FloatArray, feedforward: float
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
                    measured, state[previous], state[derivative], parameters[SAMPLE_TIME], time_constant
                )
            state[previous] = measured
            state[derivative] = x
        reference = 0.0
        if follows == FOLLOWS_POSITION:
            reference = r
        elif follows == FOLLOWS_VELOCITY:
            reference = r_dot
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

    `kind`: ``NONE``, ``PID``, ``LEAD``, ``CASCADE`` or ``STATE_FEEDBACK``. `parameters`, `state`: from
    ``controller.kernel``; the state is changed in place. `reference_position`, `reference_velocity`: what to follow.
    `y` (inputs,): measurements of the controller's inputs, in its order. `feedforward`: added to the law, before
    linearisation and limit. Returns: the command. After a value that is not finite it is 0, with the reason in
    ``state[FAULT]``, until the state is reset.
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
    if parameters[COMPENSATION] != 0.0:
        c = int(parameters[COMPENSATION])
        s = int(parameters[c + MEMORY])
        _follow_reference(parameters, state, reference_position, reference_velocity)
        if parameters[c + GAP_SHIFTS] != 0.0:
            reference_position += state[s + AHEAD] / parameters[c + PER_REFERENCE]
            reference_velocity += state[s + AHEAD_RATE] / parameters[c + PER_REFERENCE]
    if kind == PID:
        command = pid_step(parameters, state, reference_position, reference_velocity, y, feedforward)
    elif kind == LEAD:
        command = lead_step(parameters, state, reference_position, reference_velocity, y, feedforward)
    elif kind == CASCADE:
        command = cascade_step(parameters, state, reference_position, reference_velocity, y, feedforward)
    elif kind == STATE_FEEDBACK:
        command = state_feedback_step(parameters, state, reference_position, reference_velocity, y, feedforward)
    else:
        command = _finish(parameters, state, feedforward)
    state[STARTED] = 1.0
    state[TRACKING] = 0.0
    return command
