"""The compiled simulator of an axis: one integrator for every model and every effect.

Everything that runs per sample is in this file, because numba's cache notices changes only in the file
of the cached function. `advance` is compiled once and called by its address: numba would optimise it
again in each function that it is linked into, for most of the time that the simulator takes to compile.

The motion between two events is integrated by the classical Runge-Kutta method of fourth order. The
instants of events are located: a new command, the end of a delay, a stop or breakaway under dry
friction, contact and separation of the two sides of a gap. Dry friction is set valued: a body at rest
stays at rest while the other forces are within the breakaway level.

A chain of bodies and springs may vibrate far faster than it is sampled. Over the even steps of a record
its motion is computed by matrix exponentials, and only the other forces are integrated, to fourth order
(Cox and Matthews, J. Comput. Phys. 176, 2002). Steps with an event use short Runge-Kutta steps.
"""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import cfunc, njit, types
from numba.core import cgutils, config
from numba.core.imputils import impl_ret_borrowed
from numba.core.typing.templates import AttributeTemplate
from numba.extending import infer_getattr, intrinsic, lower_getattr_generic, models, register_model

# State vector: [time, command index, history head, history count, disturbance force,
# positions, velocities, accelerations, effect states]
TIME, COMMAND, HEAD, COUNT, DISTURBANCE, FIRST = 0, 1, 2, 3, 4, 5
# Columns of a hook table.
SITE, VALUE, SETTLE, PARAMETER, STATE, FINAL, EDGE = 0, 1, 2, 3, 4, 5, 6
# Columns of the output table.
BODY, KIND = 0, 1
# Columns of the table of conditions.
DEVIATION, REFERENCE = 0, 1
POSITION, VELOCITY = 0, 1

# Tolerance of stamps, below their resolution of a nanosecond [s].
SAME_TIME = 2e-10
# Speed beyond which a predictor has diverged [m/s or rad/s].
RUN_AWAY = 1e9
EVENTS_PER_STEP = 64
# Steps with a smaller relative difference share their matrices.
SAME_STEP = 1e-6
# Exact steps span the even step of a record, or a half, a quarter, an eighth of it; over an uneven step, the parts that
# it has in the binary system.
LEVELS, PARTS = 4, 12
# Fewest samples of a record for the matrices.
LEAST_SAMPLES = 64
# Largest second difference of the forces over an exact step, relative to them: beyond it is a discontinuity.
CORNER = 0.005
# Runge-Kutta steps in an exact step over which the speed of a body is approximately a parabola.
PARABOLA_STEPS = 10.0
# Least distance of the speed from zero in such a step, relative to its change.
SPEED_MARGIN = 0.1
# Tolerance of the instant of contact, relative to the width of the gap.
CONTACT_TOLERANCE = 1e-11
# A twist that is limited to a gap stays within this part of it.
INSIDE = 1.0 - 1e-9
# A speed that no machine has, in any unit.
DIVERGED = 1e60


class Axis(NamedTuple):
    """Arrays of a model for the compiled simulator (SI units).

    Hook tables have a row per active equation: site, address of the value, address of the
    state's update (0: none), first parameter, first state, flag, address of the edge (0: none).
    """

    inertia: Any  # (n,)
    viscous: Any  # (n,)
    stiffness: Any  # (n-1,)
    damping: Any  # (n-1,)
    chain: Any  # (2n, 2n) d(positions, velocities)/dt of the bare chain
    constants: (
        Any  # gain, input delay [s], steps per second that the model needs, at most, and without its chain; below
    )
    spatial_rate: Any  # (n, 3) fastest change along the position [1/position unit]; the same of memories that relax
    # over a distance, and up to which rate these need steps [1/s]
    parameters: Any  # (k,) of all active equations
    input_hooks: Any  # (i, 7)
    body_hooks: Any
    friction_hooks: Any
    coupling_hooks: Any
    output_hooks: Any
    outputs: Any  # (p, 2) body, kind
    output_scale: Any  # (p,)
    output_delay: Any  # (p,) [s]
    has_friction: Any  # (n,) int64
    condition_hooks: Any  # (c, 2) of what depends on a measured condition: state of its deviation, its reference
    condition_time: Any  # (m,) [s]; empty where no conditions were recorded
    condition: Any  # (m, c) at these times, linear between them and constant beyond


GAIN, DELAY, RATE, MOST, BEYOND = 0, 1, 2, 3, 4
# Longest time over which conditions are constant, at the value in its middle [s].
HOLD = 5
# Address of `advance`, which a float represents exactly.
ADVANCE = 6


class Flow(NamedTuple):
    """Exact motion of the bare chain over the even steps of a record.

    For each duration and level the rows of ``matrices`` are, transposed: the flow over the step and
    over half of it, and the input matrices of forces (half step; three weights; constant force).
    """

    duration: Any  # (2,) [s], 0 where there is none
    matrices: Any  # (2, PARTS, 9 n, 2 n)
    stage: Any  # (5, 2 n) buffer for the stages of a step
    force: Any  # (4, n)


class Machine(NamedTuple):
    """A model, its motion, and buffers."""

    axis: Axis
    state: Any
    history: Any
    work: Any  # (9, n) buffer for trial steps
    flow: Flow


def _arrays(number: Any, *dimensions: int) -> list[Any]:
    return [types.Array(number, one, "C") for one in dimensions]


_AXIS = types.NamedTuple(
    [
        *_arrays(types.float64, 1, 1, 1, 1, 2, 1, 2, 1), *_arrays(types.int64, 2, 2, 2, 2, 2, 2),
        *_arrays(types.float64, 1, 1), *_arrays(types.int64, 1, 2), *_arrays(types.float64, 1, 2),
    ],
    Axis,
)  # fmt: skip
_FLOW = types.NamedTuple(_arrays(types.float64, 1, 4, 2, 2), Flow)
_MACHINE = types.NamedTuple([_AXIS, *_arrays(types.float64, 1, 2, 2), _FLOW], Machine)


class View(types.Type):  # type: ignore[misc]
    """Numba's type of a pointer to a named tuple, whose fields are loaded where they are used.

    A tuple by value is some two hundred numbers, which each call would pass one by one.
    """

    def __init__(self, whole: Any) -> None:
        self.whole = whole
        super().__init__(name=f"View({whole})")

    def of(self, field: str) -> Any:
        """Type of a field."""
        kind = self.whole[self.whole.fields.index(field)]
        return View(kind) if isinstance(kind, types.NamedTuple) else kind


@register_model(View)
class _ViewModel(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, view: View) -> None:
        super().__init__(manager, view, ir.IntType(8).as_pointer())


@infer_getattr
class _ViewFields(AttributeTemplate):  # type: ignore[misc]
    key = View

    def generic_resolve(self, view: View, field: str) -> Any:
        return view.of(field)


@lower_getattr_generic(View)
def _load_field(context: Any, builder: Any, view: View, pointer: Any, field: str) -> Any:
    pointer = builder.bitcast(pointer, context.get_value_type(view.whole).as_pointer())
    place = cgutils.gep_inbounds(builder, pointer, 0, view.whole.fields.index(field))
    if isinstance(view.of(field), View):
        return builder.bitcast(place, context.get_value_type(view.of(field)))
    return impl_ret_borrowed(context, builder, view.of(field), builder.load(place))


@intrinsic
def view_of(typingctx: Any, axis: Any) -> Any:
    """View of a model. It is valid in the function that calls, and does not keep the arrays alive."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.bitcast(cgutils.alloca_once_value(builder, *arguments), context.get_value_type(View(_AXIS)))

    return View(_AXIS)(_AXIS), codegen


@intrinsic
def view_of_machine(typingctx: Any, axis: Any, state: Any, history: Any, work: Any, flow: Any) -> Any:
    """View of a machine, as of `view_of`."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        machine = context.make_tuple(builder, _MACHINE, arguments)
        return builder.bitcast(cgutils.alloca_once_value(builder, machine), context.get_value_type(View(_MACHINE)))

    return View(_MACHINE)(*_MACHINE), codegen


# Only entries are called from Python: the others have no wrappers for that.
# Inner functions do not allocate, so that they need no reference counts: twenty times as fast.
inner = njit(_nrt=False, error_model="numpy", forceinline=True, no_cpython_wrapper=True, no_cfunc_wrapper=True)
# Called rarely and from several places: not inlined, to save compilation time.
seldom = njit(_nrt=False, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
# Called once in a run, and allocates.
once = njit(error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
entry = njit(cache=True, error_model="numpy", nogil=True, no_cfunc_wrapper=True)


@intrinsic
def call_advance(typingctx: Any, address: float, machine: Any, command: float, duration: float) -> Any:
    """Call `advance` by its address."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        address, *given = arguments
        kind = ir.FunctionType(ir.VoidType(), [one.type for one in given])
        builder.call(builder.inttoptr(builder.fptosi(address, ir.IntType(64)), kind.as_pointer()), given)
        return context.get_dummy_value()

    return types.none(types.float64, View(_MACHINE), types.float64, types.float64), codegen


@intrinsic
def call(
    typingctx: Any,
    address: int,
    a: float,
    b: float,
    c: float,
    elapsed: float,
    state: Any,
    state_at: int,
    parameters: Any,
    parameter_at: int,
) -> Any:
    """Call an equation by its address, with pointers into the state and parameter arrays."""
    signature = types.float64(
        types.int64,
        types.float64,
        types.float64,
        types.float64,
        types.float64,
        state,
        types.int64,
        parameters,
        types.int64,
    )

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        where, a, b, c, elapsed, state, state_at, parameters, parameter_at = arguments
        double = ir.DoubleType()
        pointer = double.as_pointer()
        function_type = ir.FunctionType(double, [double] * 4 + [pointer] * 2)
        function = builder.inttoptr(where, function_type.as_pointer())
        state_array = context.make_array(signature.args[5])(context, builder, state)
        parameter_array = context.make_array(signature.args[7])(context, builder, parameters)
        state_pointer = builder.gep(state_array.data, [state_at])
        parameter_pointer = builder.gep(parameter_array.data, [parameter_at])
        return builder.call(function, [a, b, c, elapsed, state_pointer, parameter_pointer])

    return signature, codegen


@inner
def hold_conditions(axis: Axis, time: float, state: Any) -> None:
    """Set the deviation of each measured condition from its reference at an instant; 0 without a record."""
    when = axis.condition_time
    last = when.shape[0] - 1
    if last < 0:
        return
    before, after = 0, last
    while after - before > 1:
        middle = (before + after) // 2
        if when[middle] <= time:
            before = middle
        else:
            after = middle
    part = 0.0
    if after > before:
        part = min(max((time - when[before]) / (when[after] - when[before]), 0.0), 1.0)
    hooks = axis.condition_hooks
    for row in range(hooks.shape[0]):
        value = (1.0 - part) * axis.condition[before, row] + part * axis.condition[after, row]
        state[hooks[row, DEVIATION]] = value - axis.parameters[hooks[row, REFERENCE]]


@inner
def drive_force(axis: Axis, command: float, position: float, velocity: float, elapsed: float, state: Any) -> float:
    """Force of the drive on body 0 for a held command."""
    value = command
    hooks = axis.input_hooks
    for row in range(hooks.shape[0]):
        value = call(
            hooks[row, VALUE], value, velocity, position, elapsed,
            state, hooks[row, STATE], axis.parameters, hooks[row, PARAMETER],
        )  # fmt: skip
    return axis.constants[GAIN] * value


@inner
def coupling_torque(axis: Axis, joint: int, position: Any, velocity: Any, elapsed: float, state: Any) -> float:
    """Torque of a coupling from body ``joint`` to the next one."""
    return torque_after(axis, joint, axis.coupling_hooks.shape[0], position, velocity, elapsed, state)


@inner
def edge_of(axis: Axis, row: int, state: Any) -> float:
    """Twist at which the two sides of a coupling touch; not positive without a gap."""
    hooks, joint = axis.coupling_hooks, axis.coupling_hooks[row, SITE]
    return call(
        hooks[row, EDGE], 0.0, 0.0, axis.stiffness[joint], 0.0,
        state, hooks[row, STATE], axis.parameters, hooks[row, PARAMETER],
    )  # fmt: skip


@inner
def held_twist(axis: Axis, row: int, twist: float, state: Any) -> float:
    """The twist, limited to the side of the gap on which the step began, so that forces are continuous in a step."""
    edge, side = edge_of(axis, row, state), state[axis.coupling_hooks[row, STATE]]
    if edge <= 0.0:
        return twist
    if side > 0.0:
        return max(twist, edge)
    if side < 0.0:
        return min(twist, -edge)
    return min(max(twist, -INSIDE * edge), INSIDE * edge)


@inner
def note_sides(axis: Axis, state: Any) -> bool:
    """Set the side of each gap at the start of the step; return whether there is any gap."""
    hooks = axis.coupling_hooks
    gaps = False
    for row in range(hooks.shape[0]):
        if hooks[row, EDGE] == 0:
            continue
        joint, edge = hooks[row, SITE], edge_of(axis, row, state)
        twist = state[FIRST + joint] - state[FIRST + joint + 1]
        state[hooks[row, STATE]] = np.sign(twist) if abs(twist) > edge else 0.0
        gaps = gaps or edge > 0.0
    return gaps


@inner
def change_side(axis: Axis, row: int, state: Any) -> None:
    """Switch between contact and free motion for the next step."""
    joint, place = axis.coupling_hooks[row, SITE], axis.coupling_hooks[row, STATE]
    state[place] = 0.0 if state[place] != 0.0 else np.sign(state[FIRST + joint] - state[FIRST + joint + 1])


@inner
def side_margin(axis: Axis, row: int, position: Any, state: Any) -> float:
    """Distance of a gap's twist from a change of the side of the step; negative after it."""
    joint, edge = axis.coupling_hooks[row, SITE], edge_of(axis, row, state)
    if edge <= 0.0:
        return 1.0
    twist, side = position[joint] - position[joint + 1], state[axis.coupling_hooks[row, STATE]]
    return side * twist - edge if side != 0.0 else edge - abs(twist)


@inner
def torque_after(axis: Axis, joint: int, rows: int, position: Any, velocity: Any, elapsed: float, state: Any) -> float:
    """Torque of a coupling's spring and damper after the effects of the first rows."""
    twist = position[joint] - position[joint + 1]
    rate = velocity[joint] - velocity[joint + 1]
    torque = axis.stiffness[joint] * twist + axis.damping[joint] * rate
    hooks = axis.coupling_hooks
    for row in range(rows):
        if hooks[row, SITE] == joint:
            held = twist
            if hooks[row, EDGE] != 0:
                held = held_twist(axis, row, twist, state)
            torque = call(
                hooks[row, VALUE], torque, held, axis.stiffness[joint], elapsed,
                state, hooks[row, STATE], axis.parameters, hooks[row, PARAMETER],
            )  # fmt: skip
    return torque


@inner
def smooth_forces(
    axis: Axis, command: float, position: Any, velocity: Any, elapsed: float, state: Any, net: Any, transmitted: Any,
    chain: float = 1.0,
) -> None:  # fmt: skip
    """All forces without dry friction, and the torque transmitted to each body.

    With ``chain`` 0 the viscous friction and the linear springs of the bare chain are left out of ``net``.
    """
    bodies = axis.inertia.shape[0]
    for body in range(bodies):
        net[body] = -chain * axis.viscous[body] * velocity[body]
    drive = drive_force(axis, command, position[0], velocity[0], elapsed, state)
    net[0] += drive + state[DISTURBANCE]
    transmitted[0] = abs(drive)
    hooks = axis.body_hooks
    for row in range(hooks.shape[0]):
        body = hooks[row, SITE]
        net[body] += call(
            hooks[row, VALUE], position[body], velocity[body], axis.inertia[body], elapsed,
            state, hooks[row, STATE], axis.parameters, hooks[row, PARAMETER],
        )  # fmt: skip
    for joint in range(bodies - 1):
        torque = coupling_torque(axis, joint, position, velocity, elapsed, state)
        transmitted[joint + 1] = abs(torque)
        if chain == 0.0:
            twist, rate = position[joint] - position[joint + 1], velocity[joint] - velocity[joint + 1]
            torque -= axis.stiffness[joint] * twist + axis.damping[joint] * rate
        net[joint] -= torque
        net[joint + 1] += torque


@inner
def friction_level(axis: Axis, body: int, direction: float, speed: float, transmitted: float, state: Any) -> float:
    """Dry friction of a body that moves, or is about to move, in ``direction``; speed 0 is breakaway."""
    level = 0.0
    hooks = axis.friction_hooks
    for row in range(hooks.shape[0]):
        if hooks[row, SITE] == body:
            level += call(
                hooks[row, VALUE], direction, speed, transmitted, 0.0,
                state, hooks[row, STATE], axis.parameters, hooks[row, PARAMETER],
            )  # fmt: skip
    return max(level, 0.0)


@inner
def accelerations(
    axis: Axis, command: float, position: Any, velocity: Any, elapsed: float, state: Any,
    mode: Any, net: Any, transmitted: Any, acceleration: Any,
) -> None:  # fmt: skip
    """Accelerations with the direction of each body's dry friction held at ``mode`` (0: at rest)."""
    smooth_forces(axis, command, position, velocity, elapsed, state, net, transmitted)
    for body in range(axis.inertia.shape[0]):
        force = net[body]
        if axis.has_friction[body]:
            if mode[body] == 0.0:
                acceleration[body] = 0.0
                continue
            speed = max(velocity[body] * mode[body], 0.0)
            force -= mode[body] * friction_level(axis, body, mode[body], speed, transmitted[body], state)
        acceleration[body] = force / axis.inertia[body]


@inner
def single_acceleration(
    axis: Axis, command: float, position: float, velocity: float, elapsed: float, state: Any, mode: float,
    inverse: float,
) -> float:  # fmt: skip
    """As `accelerations` for a body without others, its inertia inverted: plain numbers stay in registers."""
    drive = drive_force(axis, command, position, velocity, elapsed, state)
    force = drive - axis.viscous[0] * velocity + state[DISTURBANCE]
    hooks = axis.body_hooks
    for row in range(hooks.shape[0]):
        force += call(
            hooks[row, VALUE], position, velocity, axis.inertia[0], elapsed,
            state, hooks[row, STATE], axis.parameters, hooks[row, PARAMETER],
        )  # fmt: skip
    if axis.has_friction[0]:
        if mode == 0.0:
            return 0.0
        force -= mode * friction_level(axis, 0, mode, max(velocity * mode, 0.0), abs(drive), state)
    return force * inverse


@inner
def single_step(axis: Axis, command: float, step: float, state: Any, mode: float, a1: float) -> Any:
    """As `runge_kutta` for a body without others: position and velocity at the end, acceleration just before."""
    x, v1 = state[FIRST], state[FIRST + 1]
    half, inverse = 0.5 * step, 1.0 / axis.inertia[0]
    v2 = v1 + half * a1
    a2 = single_acceleration(axis, command, x + half * v1, v2, half, state, mode, inverse)
    v3 = v1 + half * a2
    a3 = single_acceleration(axis, command, x + half * v2, v3, half, state, mode, inverse)
    v4 = v1 + step * a3
    a4 = single_acceleration(axis, command, x + step * v3, v4, step, state, mode, inverse)
    sixth = step / 6.0
    return x + sixth * (v1 + 2.0 * v2 + 2.0 * v3 + v4), v1 + sixth * (a1 + 2.0 * a2 + 2.0 * a3 + a4), a4


@inner
def runge_kutta(axis: Axis, command: float, step: float, state: Any, work: Any) -> None:
    """One step from the state; the end goes to rows 0 (position) and 1 (velocity) of ``work``.

    Row 2 holds the friction directions, row 3 the accelerations at the start, which are
    computed by the caller once for all trial steps. Of the last stage, close to the end, row 8
    keeps the accelerations, and rows 4 and 5 of several bodies what `smooth_forces` finds.
    """
    n = axis.inertia.shape[0]
    if n == 1:
        if axis.has_friction[0] and work[2, 0] == 0.0:
            work[0, 0], work[1, 0], work[8, 0] = state[FIRST], 0.0, 0.0
        else:
            work[0, 0], work[1, 0], work[8, 0] = single_step(axis, command, step, state, work[2, 0], work[3, 0])
        return
    position, velocity, mode, first = work[0], work[1], work[2], work[3]
    net, transmitted = work[4], work[5]
    stage_position, stage_velocity, stage = work[6], work[7], work[8]
    at, speed_at = FIRST, FIRST + n
    half = 0.5 * step
    for i in range(n):
        v = state[speed_at + i]
        position[i] = v
        velocity[i] = first[i]
        stage_position[i] = state[at + i] + half * v
        stage_velocity[i] = v + half * first[i]
    accelerations(axis, command, stage_position, stage_velocity, half, state, mode, net, transmitted, stage)
    for i in range(n):
        position[i] += 2.0 * stage_velocity[i]
        velocity[i] += 2.0 * stage[i]
        stage_position[i] = state[at + i] + half * stage_velocity[i]
        stage_velocity[i] = state[speed_at + i] + half * stage[i]
    accelerations(axis, command, stage_position, stage_velocity, half, state, mode, net, transmitted, stage)
    for i in range(n):
        position[i] += 2.0 * stage_velocity[i]
        velocity[i] += 2.0 * stage[i]
        stage_position[i] = state[at + i] + step * stage_velocity[i]
        stage_velocity[i] = state[speed_at + i] + step * stage[i]
    accelerations(axis, command, stage_position, stage_velocity, step, state, mode, net, transmitted, stage)
    for i in range(n):
        position[i] = state[at + i] + step / 6.0 * (position[i] + stage_velocity[i])
        velocity[i] = state[speed_at + i] + step / 6.0 * (velocity[i] + stage[i])


@inner
def choose_directions(axis: Axis, command: float, state: Any, work: Any) -> None:
    """Direction of each body's dry friction now; a body at rest breaks away only above its level."""
    n = axis.inertia.shape[0]
    position, velocity = state[FIRST : FIRST + n], state[FIRST + n : FIRST + 2 * n]
    mode, net, transmitted = work[2], work[4], work[5]
    resting = False
    for i in range(n):
        mode[i] = 0.0
        if axis.has_friction[i]:
            mode[i] = np.sign(velocity[i])
            resting = resting or mode[i] == 0.0
    if not resting:
        return
    smooth_forces(axis, command, position, velocity, 0.0, state, net, transmitted)
    for i in range(n):
        if not axis.has_friction[i] or mode[i] != 0.0:
            continue
        if net[i] > 0.0 and net[i] > friction_level(axis, i, 1.0, 0.0, transmitted[i], state):
            mode[i] = 1.0
        elif net[i] < 0.0 and -net[i] > friction_level(axis, i, -1.0, 0.0, transmitted[i], state):
            mode[i] = -1.0


@inner
def zero_crossing_within(start: float, falls: float, end: float, rises: float, step: float) -> float:
    """Time of a minimum of the speed below zero within a step, by cubic interpolation; 0 without one."""
    if not falls < 0.0 < rises:
        return 0.0
    x = falls / (falls - rises)
    back = 1.0 - x
    lowest = back * back * ((1.0 + 2.0 * x) * start + x * step * falls)
    lowest += x * x * ((1.0 + 2.0 * back) * end - back * step * rises)
    return x * step if lowest < 0.0 else 0.0


@inner
def static_margin(axis: Axis, body: int, state: Any, work: Any) -> float:
    """Margin of the breakaway level over the forces in ``work`` on a body at rest."""
    net = work[4, body]
    return friction_level(axis, body, 1.0 if net > 0.0 else -1.0, 0.0, work[5, body], state) - abs(net)


@inner
def event_bound(axis: Axis, command: float, body: int, step: float, state: Any, work: Any) -> float:
    """Time in a trial step before which a body stops or breaks away; 0 without such an event."""
    mode = work[2, body]
    if mode == 0.0:
        if axis.inertia.shape[0] == 1:
            smooth_forces(axis, command, work[0], work[1], step, state, work[4], work[5])
        return step if static_margin(axis, body, state, work) < 0.0 else 0.0
    end = work[1, body] * mode
    if end < 0.0:
        return step
    start = state[FIRST + axis.inertia.shape[0] + body] * mode
    return zero_crossing_within(start, work[3, body] * mode, end, work[8, body] * mode, step)


@seldom
def repeat_step(machine: Machine, command: float, step: float) -> None:
    """Another trial step."""
    runge_kutta(machine.axis, command, step, machine.state, machine.work)


@seldom
def event_function(machine: Machine, command: float, body: int, step: float) -> float:
    """Speed of a moving body, or static margin of one at rest, after a trial step; negative after the event."""
    repeat_step(machine, command, step)
    axis, state, work = machine.axis, machine.state, machine.work
    if work[2, body] != 0.0:
        return work[1, body] * work[2, body]
    smooth_forces(axis, command, work[0], work[1], step, state, work[4], work[5])
    return static_margin(axis, body, state, work)


@inner
def secant(low: float, low_value: float, high: float, high_value: float) -> float:
    """Where the chord of a bracket crosses zero; the middle where rounding takes that outside."""
    crossing = (low * high_value - high * low_value) / (high_value - low_value)
    return crossing if low < crossing < high else 0.5 * (low + high)


@inner
def narrowed(
    low: float, low_value: float, high: float, high_value: float, middle: float, value: float, side: int
) -> Any:
    """Bracket after one more value, by the Illinois method: an end that stays twice counts half."""
    if value > 0.0:
        return middle, value, high, high_value * 0.5 if side == 1 else high_value, 1
    return low, low_value * 0.5 if side == -1 else low_value, middle, value, -1


@seldom
def event_time(machine: Machine, command: float, body: int, step: float) -> float:
    """Time at which a body stops or breaks away within a step (Illinois method); 0 without such an event."""
    low, low_value = 0.0, event_function(machine, command, body, 0.0)
    high, high_value = step, event_function(machine, command, body, step)
    if high_value > 0.0:
        return 0.0
    if low_value <= 0.0:  # breakaway and stop within the step
        low = 1e-6 * step
        low_value = event_function(machine, command, body, low)
        if low_value <= 0.0:
            return low
    side = 0
    for _ in range(40):
        middle = secant(low, low_value, high, high_value)
        value = event_function(machine, command, body, middle)
        low, low_value, high, high_value, side = narrowed(low, low_value, high, high_value, middle, value, side)
        if value == 0.0 or high - low <= 1e-10 * step or abs(value) < 1e-14:
            break
    return high


@seldom
def contact_time(machine: Machine, command: float, row: int, step: float) -> float:
    """Time at which the two sides of a gap touch or separate within a step; its motion goes to ``work``."""
    axis, state, work = machine.axis, machine.state, machine.work
    n = axis.inertia.shape[0]
    near = CONTACT_TOLERANCE * edge_of(axis, row, state)
    low, low_value = 0.0, side_margin(axis, row, state[FIRST : FIRST + n], state)
    high, high_value = step, side_margin(axis, row, work[0], state)
    middle, side = step, 0
    if low_value <= 0.0:  # an event at the start: the shortest step
        middle = 1e-6 * step
        repeat_step(machine, command, middle)
        low, low_value = middle, side_margin(axis, row, work[0], state)
        if low_value <= 0.0:
            return middle
    for _ in range(40):
        middle = secant(low, low_value, high, high_value)
        repeat_step(machine, command, middle)
        value = side_margin(axis, row, work[0], state)
        if abs(value) <= near or high - low <= 1e-10 * step:
            break
        low, low_value, high, high_value, side = narrowed(low, low_value, high, high_value, middle, value, side)
    return middle


@inner
def settle_effects(axis: Axis, command: float, step: float, state: Any) -> None:
    """Update the states of effects to the end of a step, after the motion."""
    n = axis.inertia.shape[0]
    position, velocity = state[FIRST : FIRST + n], state[FIRST + n : FIRST + 2 * n]
    value = command
    hooks = axis.input_hooks
    for row in range(hooks.shape[0]):
        arrived = value
        value = call(
            hooks[row, VALUE], arrived, velocity[0], position[0], step,
            state, hooks[row, STATE], axis.parameters, hooks[row, PARAMETER],
        )  # fmt: skip
        if hooks[row, SETTLE] != 0:
            call(
                hooks[row, SETTLE], arrived, velocity[0], position[0], step,
                state, hooks[row, STATE], axis.parameters, hooks[row, PARAMETER],
            )  # fmt: skip
    hooks = axis.body_hooks
    for row in range(hooks.shape[0]):
        if hooks[row, SETTLE] != 0:
            body = hooks[row, SITE]
            call(
                hooks[row, SETTLE], position[body], velocity[body], axis.inertia[body], step,
                state, hooks[row, STATE], axis.parameters, hooks[row, PARAMETER],
            )  # fmt: skip
    hooks = axis.coupling_hooks
    for row in range(hooks.shape[0]):
        if hooks[row, SETTLE] != 0:
            joint = hooks[row, SITE]
            twist = position[joint] - position[joint + 1]
            call(
                hooks[row, SETTLE], torque_after(axis, joint, row, position, velocity, step, state), twist,
                axis.stiffness[joint], step, state, hooks[row, STATE], axis.parameters, hooks[row, PARAMETER],
            )  # fmt: skip


@inner
def settle_outputs(axis: Axis, position: float, velocity: float, body: int, step: float, state: Any) -> None:
    """Update the states of sensors (play, filter) of one body to a new motion."""
    hooks = axis.output_hooks
    for row in range(hooks.shape[0]):
        output = hooks[row, SITE]
        if hooks[row, SETTLE] != 0 and axis.outputs[output, BODY] == body:
            value = position if axis.outputs[output, KIND] == POSITION else velocity
            call(
                hooks[row, SETTLE], axis.output_scale[output] * value, position, velocity, step,
                state, hooks[row, STATE], axis.parameters, hooks[row, PARAMETER],
            )  # fmt: skip


@inner
def accept(axis: Axis, command: float, step: float, stopped: int, state: Any, work: Any) -> None:
    """Take the trial step in ``work`` as the new state."""
    n = axis.inertia.shape[0]
    watched = axis.output_hooks.shape[0] > 0
    for i in range(n):
        old_position, old_velocity = state[FIRST + i], state[FIRST + n + i]
        new_position, new_velocity = work[0, i], work[1, i]
        if i == stopped:
            new_velocity = 0.0
        state[FIRST + i] = new_position
        state[FIRST + n + i] = new_velocity
        if watched:
            settled = 0.0
            if old_velocity * new_velocity < 0.0:  # the turning point counts for a play
                settled = step * old_velocity / (old_velocity - new_velocity)
                turn = old_position + 0.5 * old_velocity * settled
                settle_outputs(axis, turn, 0.0, i, settled, state)
            settle_outputs(axis, new_position, new_velocity, i, step - settled, state)
    state[TIME] += step
    settle_effects(axis, command, step, state)


@inner
def remember(axis: Axis, state: Any, history: Any) -> None:
    """Store the present motion for delayed outputs."""
    size = history.shape[0]
    if size == 0:
        return
    n = axis.inertia.shape[0]
    head = (int(state[HEAD]) + 1) % size
    state[HEAD] = head
    state[COUNT] = min(state[COUNT] + 1.0, float(size))
    history[head, 0] = state[TIME]
    for i in range(3 * n):
        history[head, 1 + i] = state[FIRST + i]
    for output in range(axis.outputs.shape[0]):
        history[head, 1 + 3 * n + output] = stateful_reading(axis, output, state)


@seldom
def forces_beyond(machine: Machine, command: float, stage: int, elapsed: float, row: int) -> None:
    """Forces on the bodies beyond those of the bare chain, with the directions of dry friction in ``work``.

    From a stage of the flow (-1: the state) to a row of its forces.
    """
    axis, state, work, flow = machine.axis, machine.state, machine.work, machine.flow
    n = axis.inertia.shape[0]
    mode, transmitted, force = work[2], work[5], flow.force[row]
    motion = state[FIRST : FIRST + 2 * n] if stage < 0 else flow.stage[stage]
    smooth_forces(axis, command, motion[:n], motion[n:], elapsed, state, force, transmitted, 0.0)
    for body in range(n):
        if axis.has_friction[body]:
            speed = max(motion[n + body] * mode[body], 0.0)
            force[body] -= mode[body] * friction_level(axis, body, mode[body], speed, transmitted[body], state)


@inner
def add_rows(matrix: Any, first: int, weights: Any, to: Any) -> None:
    """Add rows of a matrix, each times its weight."""
    for column in range(0, to.shape[0], 2):  # positions and velocities: always even
        one, two = to[column], to[column + 1]
        for row in range(weights.shape[0]):
            one += matrix[first + row, column] * weights[row]
            two += matrix[first + row, column + 1] * weights[row]
        to[column], to[column + 1] = one, two


@inner
def has_no_effects(axis: Axis) -> bool:
    """Whether no effect acts on the motion."""
    hooks = axis.input_hooks.shape[0] + axis.body_hooks.shape[0] + axis.coupling_hooks.shape[0]
    return hooks + axis.friction_hooks.shape[0] == 0


@inner
def exact_step(machine: Machine, command: float, step: float, matrix: Any) -> bool:
    """One step of the chain's exact flow; the end goes to ``work`` as in `runge_kutta`. False at a discontinuity."""
    axis, state, work, flow = machine.axis, machine.state, machine.work, machine.flow
    n = axis.inertia.shape[0]
    start = state[FIRST : FIRST + 2 * n]
    whole, half, first, second, end = flow.stage[0], flow.stage[1], flow.stage[2], flow.stage[3], flow.stage[4]
    f0, f1, f2, f3 = flow.force[0], flow.force[1], flow.force[2], flow.force[3]
    forces_beyond(machine, command, -1, 0.0, 0)
    for i in range(2 * n):
        whole[i] = 0.0
        half[i] = 0.0
    add_rows(matrix, 0, start, whole)
    for i in range(2 * n):
        end[i] = whole[i]
    add_rows(matrix, 8 * n, f0, end)
    if not has_no_effects(axis):
        add_rows(matrix, 2 * n, start, half)
        for i in range(2 * n):
            first[i] = half[i]
        add_rows(matrix, 4 * n, f0, first)
        forces_beyond(machine, command, 2, 0.5 * step, 1)
        forces_beyond(machine, command, 4, step, 3)
        held = True
        for i in range(n):
            held = held and f1[i] == f0[i] and f3[i] == f0[i]
        if not held:
            for i in range(2 * n):
                second[i] = half[i]
                half[i] = 0.0
                end[i] = whole[i]
            add_rows(matrix, 4 * n, f1, second)
            forces_beyond(machine, command, 3, 0.5 * step, 2)
            add_rows(matrix, 2 * n, first, half)
            for i in range(n):
                f3[i] = 2.0 * f2[i] - f0[i]
            add_rows(matrix, 4 * n, f3, half)
            forces_beyond(machine, command, 1, step, 3)
            size = 0.0
            for i in range(n):
                size += abs(f0[i]) + abs(f3[i])
            for i in range(n):
                if not abs(f0[i] - f1[i] - f2[i] + f3[i]) <= CORNER * size:
                    return False
                f1[i] += f2[i]
            add_rows(matrix, 5 * n, f0, end)
            add_rows(matrix, 6 * n, f1, end)
            add_rows(matrix, 7 * n, f3, end)
    for i in range(n):
        work[0, i], work[1, i] = end[i], end[n + i]
    return True


@inner
def vibration(axis: Axis, state: Any, force: Any) -> float:
    """Vibration energy of a chain about its static deflection under forces."""
    n = axis.inertia.shape[0]
    mass = momentum = pull = 0.0
    for i in range(n):
        mass += axis.inertia[i]
        momentum += axis.inertia[i] * state[FIRST + n + i]
        pull += force[i]
    mean, bent, energy = momentum / mass, 0.0, 0.0
    for i in range(n):
        speed = state[FIRST + n + i] - mean
        energy += 0.5 * axis.inertia[i] * speed * speed
        bent += force[i] - axis.inertia[i] / mass * pull
        if i + 1 < n and axis.stiffness[i] > 0.0:
            torque = axis.stiffness[i] * (state[FIRST + i] - state[FIRST + i + 1]) - bent
            energy += 0.5 * torque * torque / axis.stiffness[i]
    return energy


@inner
def keeps_direction(axis: Axis, step: float, state: Any, work: Any, flow: Flow) -> bool:
    """Whether each body with dry friction keeps its direction in the exact trial step."""
    n = axis.inertia.shape[0]
    slow = axis.constants[RATE] * step <= PARABOLA_STEPS
    energy = mass = change = start = end = 0.0
    if not slow:
        energy = vibration(axis, state, flow.force[0])
        for i in range(n):
            mass += axis.inertia[i]
            change += abs(flow.force[3, i] - flow.force[0, i])
            start += axis.inertia[i] * state[FIRST + n + i]
            end += axis.inertia[i] * work[1, i]
    for i in range(n):
        if not axis.has_friction[i]:
            continue
        mode, inertia = work[2, i], axis.inertia[i]
        if slow:  # minimum of a parabola through three points
            a, b, c = mode * state[FIRST + n + i], mode * flow.stage[2, n + i], mode * work[1, i]
            least, bend = min(a, b, c), a - 2.0 * b + c
            if abs(a - c) < 2.0 * bend:
                least = b - 0.125 * (a - c) ** 2 / bend
            if least < SPEED_MARGIN * (abs(a - b) + abs(b - c)):
                return False
        else:  # the mean speed minus the largest speed of the vibration
            swing = np.sqrt(2.0 * energy * (1.0 / inertia - 1.0 / mass)) + 0.5 * step * change / inertia
            if min(mode * start, mode * end) / mass < swing:
                return False
    return True


@inner
def advance_exactly(machine: Machine, command: float, duration: float, gaps: bool) -> float:
    """Take exact steps while there is no event; return the time that they cover."""
    axis, state, work, flow = machine.axis, machine.state, machine.work, machine.flow
    slot, levels, longest = -1, LEVELS, duration
    for i in range(2):
        if abs(duration - flow.duration[i]) < SAME_STEP * flow.duration[i]:
            slot = i
    if slot < 0 and flow.duration[0] > 0.0:
        slot = 0 if flow.duration[0] >= flow.duration[1] else 1
        levels, longest = PARTS, flow.duration[slot]
    if slot < 0 or gaps:  # contact is possible at any instant
        return 0.0
    n = axis.inertia.shape[0]
    rate = axis.constants[BEYOND]
    for i in range(n):
        rate = max(rate, rate_along(axis.spatial_rate[i], abs(state[FIRST + n + i])))
    level, step = 0, longest
    while level < levels and rate * step > 1.0:
        level += 1
        step *= 0.5
    dry = axis.friction_hooks.shape[0] > 0
    covered = 0.0
    # A step without two Runge-Kutta steps in it gains nothing.
    while level < levels and axis.constants[RATE] * step >= 2.0:
        if step > (1.0 + SAME_STEP) * (duration - covered):
            if duration - covered <= SAME_STEP * duration:
                return duration
            level += 1
            step *= 0.5
            continue
        if dry:
            choose_directions(axis, command, state, work)
            for i in range(n):
                if axis.has_friction[i] and work[2, i] == 0.0:
                    return covered
        if not exact_step(machine, command, step, flow.matrices[slot, level]):
            return covered
        if dry and not keeps_direction(axis, step, state, work, flow):
            level += 1
            step *= 0.5
            continue
        accept(axis, command, step, -1, state, work)
        covered += step
    return covered


@inner
def rate_along(rates: Any, speed: float) -> float:
    """Steps per second for what changes along the position; infinite where the motion has diverged."""
    return max(rates[0] * speed, min(rates[1] * speed, rates[2])) if speed < DIVERGED else np.inf


@inner
def advance_single_body(axis: Axis, command: float, duration: float, state: Any) -> bool:
    """One step of a single body without an event; False, without a change, where there may be one."""
    velocity = state[FIRST + 1]
    if not max(axis.constants[RATE], rate_along(axis.spatial_rate[0], abs(velocity))) * duration <= 1.0:
        return False
    mode = 0.0
    if axis.has_friction[0]:
        if velocity == 0.0:
            return False
        mode = 1.0 if velocity > 0.0 else -1.0
    start = single_acceleration(
        axis, command, state[FIRST], velocity, 0.0, state, mode, 1.0 / axis.inertia[0]
    )  # fmt: skip
    position, end, last = single_step(axis, command, duration, state, mode, start)
    if end * mode < 0.0 or zero_crossing_within(velocity * mode, start * mode, end * mode, last * mode, duration) > 0.0:
        return False
    velocity = end
    state[FIRST], state[FIRST + 1], state[FIRST + 2] = position, velocity, start
    state[TIME] += duration
    settle_effects(axis, command, duration, state)
    return True


def advance(machine: Machine, command: float, duration: float) -> None:
    """Integrate over a stretch of constant command; of the machine, `call_advance` gives a view."""
    axis, state, history, work = machine.axis, machine.state, machine.history, machine.work
    n = axis.inertia.shape[0]
    end = state[TIME] + duration
    gaps = note_sides(axis, state)
    remaining = duration - advance_exactly(machine, command, duration, gaps)
    events = touches = 0
    dry = False
    for i in range(n):
        dry = dry or axis.has_friction[i] != 0
    while remaining > 0.0:
        rate = axis.constants[RATE]
        for i in range(n):
            rate = max(rate, rate_along(axis.spatial_rate[i], abs(state[FIRST + n + i])))
        if not rate < np.inf:  # the motion has diverged: the outputs are NaN
            for i in range(n):
                state[FIRST + i] = np.nan
            break
        pieces = max(np.ceil(remaining * min(rate, axis.constants[MOST])), 1.0)
        step = remaining / pieces
        if dry:
            choose_directions(axis, command, state, work)
        if n == 1:
            work[3, 0] = single_acceleration(
                axis, command, state[FIRST], state[FIRST + 1], 0.0, state, work[2, 0], 1.0 / axis.inertia[0]
            )
        else:
            accelerations(
                axis, command, state[FIRST : FIRST + n], state[FIRST + n : FIRST + 2 * n], 0.0, state,
                work[2], work[4], work[5], work[3],
            )  # fmt: skip
        for i in range(n):
            state[FIRST + 2 * n + i] = work[3, i]
        if history.shape[0] > 0:
            remember(axis, state, history)
        runge_kutta(axis, command, step, state, work)
        stopped = -1
        if dry:
            for i in range(n):  # the first event of any body ends the step
                if axis.has_friction[i] and events < EVENTS_PER_STEP + pieces:
                    late = event_bound(axis, command, i, step, state, work)
                    if late > 0.0:
                        events += 1
                        late = event_time(machine, command, i, late)
                        if late > 0.0:
                            stopped, step = i, late
                        repeat_step(machine, command, step)
        touched = -1
        if gaps:
            for row in range(axis.coupling_hooks.shape[0]):
                if axis.coupling_hooks[row, EDGE] != 0 and side_margin(axis, row, work[0], state) < 0.0:
                    touches += 1
                    if touches < EVENTS_PER_STEP + pieces:
                        step = contact_time(machine, command, row, step)
                        stopped = -1
                    touched = row
        accept(axis, command, step, stopped, state, work)
        remaining -= step
        if touched >= 0:
            change_side(axis, touched, state)
        elif pieces == 1.0 and stopped < 0:
            break
        if remaining < 1e-12 * duration:
            break
    state[TIME] = end


@inner
def stateful_reading(axis: Axis, output: int, state: Any) -> float:
    """Reading of a sensor before delay and static errors: motion through play and filter."""
    n = axis.inertia.shape[0]
    body = axis.outputs[output, BODY]
    position, velocity = state[FIRST + body], state[FIRST + n + body]
    if axis.outputs[output, KIND] == POSITION:
        value = axis.output_scale[output] * position
    else:
        value = axis.output_scale[output] * velocity
    hooks = axis.output_hooks
    for row in range(hooks.shape[0]):
        if hooks[row, SITE] == output and hooks[row, SETTLE] != 0:
            value = call(
                hooks[row, VALUE], value, position, velocity, 0.0,
                state, hooks[row, STATE], axis.parameters, hooks[row, PARAMETER],
            )  # fmt: skip
    return value


@inner
def measure(axis: Axis, state: Any, history: Any, noise: Any, reading: Any) -> None:
    """Read every sensor now: play and filter, delay, static errors, noise, quantisation."""
    n = axis.inertia.shape[0]
    if axis.output_hooks.shape[0] > 0:  # without elapsed time: for a start or an observer's correction
        for i in range(n):
            settle_outputs(axis, state[FIRST + i], state[FIRST + n + i], i, 0.0, state)
    if history.shape[0] > 0:
        remember(axis, state, history)
    for output in range(axis.outputs.shape[0]):
        body = axis.outputs[output, BODY]
        position, velocity = state[FIRST + body], state[FIRST + n + body]
        delay = axis.output_delay[output]
        if delay > 0.0:
            position, velocity, value = recall(axis, output, state[TIME] - delay, state, history)
        else:
            value = stateful_reading(axis, output, state)
        hooks = axis.output_hooks
        for final in range(2):
            if final == 1:
                value += noise[output]
            for row in range(hooks.shape[0]):
                if hooks[row, SITE] == output and hooks[row, SETTLE] == 0 and hooks[row, FINAL] == final:
                    value = call(
                        hooks[row, VALUE], value, position, velocity, 0.0,
                        state, hooks[row, STATE], axis.parameters, hooks[row, PARAMETER],
                    )  # fmt: skip
        reading[output] = value


@inner
def recall(axis: Axis, output: int, time: float, state: Any, history: Any) -> Any:
    """Motion and reading at an earlier time, by cubic Hermite interpolation of the stored motion."""
    n = axis.inertia.shape[0]
    size = history.shape[0]
    body = axis.outputs[output, BODY]
    head = int(state[HEAD])
    # Entries back from the last one: later than the time, and not later (unless all are).
    young, old = 0, max(int(state[COUNT]) - 1, 0)
    while old - young > 1:
        middle = (young + old) // 2
        if history[(head - middle + size) % size, 0] <= time:
            old = middle
        else:
            young = middle
    early, late = (head - old + size) % size, (head - young + size) % size
    t0, t1 = history[early, 0], history[late, 0]
    column = 1 + 3 * n + output
    if t1 <= t0 or time <= t0:  # before the record: the oldest stored motion
        return history[early, 1 + body], history[early, 1 + n + body], history[early, column]
    h = t1 - t0
    x = (time - t0) / h
    h00, h10 = (1.0 + 2.0 * x) * (1.0 - x) ** 2, x * (1.0 - x) ** 2
    h01, h11 = x * x * (3.0 - 2.0 * x), x * x * (x - 1.0)
    p0, p1 = history[early, 1 + body], history[late, 1 + body]
    v0, v1 = history[early, 1 + n + body], history[late, 1 + n + body]
    # The derivative of the cubic, so that the acceleration may be discontinuous with the command.
    position = h00 * p0 + h10 * h * v0 + h01 * p1 + h11 * h * v1
    velocity = (6.0 * x * x - 6.0 * x) / h * (p0 - p1) + (1.0 - x) * (1.0 - 3.0 * x) * v0 + x * (3.0 * x - 2.0) * v1
    stateful = False
    hooks = axis.output_hooks
    for row in range(hooks.shape[0]):
        stateful = stateful or (hooks[row, SITE] == output and hooks[row, SETTLE] != 0)
    if stateful:
        value = (1.0 - x) * history[early, column] + x * history[late, column]
    elif axis.outputs[output, KIND] == POSITION:
        value = axis.output_scale[output] * position
    else:
        value = axis.output_scale[output] * velocity
    return position, velocity, value


@inner
def run_to(
    axis: Axis, command_time: Any, command: Any, target: float, state: Any, history: Any, work: Any, flow: Flow,
    machine: Machine,
) -> None:  # fmt: skip
    """Integrate to ``target``, switching commands when they take effect; before the first it is 0.

    ``machine`` is the view of the arguments before it, for `advance`.
    """
    alone = axis.inertia.shape[0] == 1 and history.shape[0] == 0 and axis.output_hooks.shape[0] == 0
    delay = axis.constants[DELAY]
    index = int(state[COMMAND])
    last = command_time.shape[0] - 1
    while True:
        now = state[TIME]
        while index < last and command_time[index + 1] + delay <= now + SAME_TIME:
            index += 1
        if target - now <= SAME_TIME:
            state[TIME] = max(now, target)
            break
        until = target
        if index < last and command_time[index + 1] + delay < target - SAME_TIME:
            until = command_time[index + 1] + delay
        held = command[index] if index >= 0 else 0.0
        if axis.condition_hooks.shape[0] > 0:
            until = min(until, now + axis.constants[HOLD])
            hold_conditions(axis, 0.5 * (now + until), state)
        if not (alone and advance_single_body(axis, held, until - now, state)):
            call_advance(axis.constants[ADVANCE], machine, held, until - now)
        if until < target:
            state[TIME] = until
    state[COMMAND] = index


@once
def no_flow(bodies: int) -> Flow:
    """Flow without exact steps: all steps are Runge-Kutta steps."""
    n = bodies
    return Flow(np.zeros(2), np.zeros((0, 0, 0, 0)), np.zeros((5, 2 * n)), np.zeros((4, n)))


@once
def chain_flow(axis: Axis, command_time: Any, time: Any) -> Flow:
    """Flow over the steps of a record and their parts, where the chain is faster than they are."""
    n = axis.inertia.shape[0]
    none = no_flow(n)
    if time.shape[0] < LEAST_SAMPLES:
        return none
    for output in range(axis.output_delay.shape[0]):
        if axis.output_delay[output] > 0.0:
            return none
    for row in range(axis.output_hooks.shape[0]):
        if axis.output_hooks[row, SETTLE] != 0:  # a play or filter follows the motion between samples
            return none
    even = (time[-1] - time[0]) / (time.shape[0] - 1)
    if not 2.0 <= even * axis.constants[RATE] < np.inf:
        return none
    duration = np.zeros(2)
    duration[0] = even
    if command_time.shape[0] > 0:
        late = (command_time[0] + axis.constants[DELAY] - time[0]) % even
        if SAME_STEP * even < late < (1.0 - SAME_STEP) * even:
            duration[0], duration[1] = late, even - late
    matrices = np.zeros((2, PARTS, 9 * n, 2 * n))
    for slot in range(2):
        if duration[slot] > 0.0:
            exponentials(axis, duration[slot], matrices[slot])
    return Flow(duration, matrices, none.stage, none.force)


@once
def exponentials(axis: Axis, duration: float, matrices: Any) -> None:
    """Matrices of all levels: phi functions of the chain, by Taylor series of a small step and doubling.

    Loops, because for an expression of arrays numba compiles the words of its errors about shapes.
    """
    n, size = axis.inertia.shape[0], axis.chain.shape[0]
    halvings, largest = PARTS, 0.0
    for i in range(size):
        row = 0.0
        for j in range(size):
            row += abs(axis.chain[i, j])
        largest = max(largest, row)
    while largest * duration > 0.5 * 2.0**halvings and halvings < 40:
        halvings += 1
    small, phi = np.zeros((size, size)), np.zeros((4, size, size))
    term, before, third = np.zeros((size, size)), np.zeros((size, size)), np.zeros((size, size))
    for i in range(size):
        for j in range(size):
            small[i, j] = axis.chain[i, j] * (duration / 2.0**halvings)
    for k in range(4):
        for i in range(size):
            for j in range(size):
                term[i, j] = 1.0 if i == j else 0.0
                for divisor in range(1, k + 1):
                    term[i, j] /= divisor
        for power in range(1, 14):
            for i in range(size):
                for j in range(size):
                    phi[k, i, j] += term[i, j]
                    before[i, j] = term[i, j]
            np.dot(before, small, term)
            for i in range(size):
                for j in range(size):
                    term[i, j] /= k + power
    for halving in range(halvings, -1, -1):
        # phi is that of duration / 2^halving
        step = duration / 2.0**halving
        p0, p1, p2, p3 = phi[0], phi[1], phi[2], phi[3]
        for j in range(size):
            for i in range(n):
                one, two, three = p1[j, n + i], p2[j, n + i], p3[j, n + i]
                if halving < PARTS:
                    to = matrices[halving]
                    to[5 * n + i, j] = step * (one - 3.0 * two + 4.0 * three) / axis.inertia[i]
                    to[6 * n + i, j] = step * (2.0 * two - 4.0 * three) / axis.inertia[i]
                    to[7 * n + i, j] = step * (4.0 * three - two) / axis.inertia[i]
                    to[8 * n + i, j] = step * one / axis.inertia[i]
                if 1 <= halving <= PARTS:
                    matrices[halving - 1, 4 * n + i, j] = step * one / axis.inertia[i]
            for i in range(size):
                if halving < PARTS:
                    matrices[halving, i, j] = p0[j, i]
                if 1 <= halving <= PARTS:
                    matrices[halving - 1, 2 * n + i, j] = p0[j, i]
        for k in range(3, 0, -1):
            np.dot(p0, phi[k], third if k == 3 else before)
            for i in range(size):
                for j in range(size):
                    if k == 3:
                        third[i, j] = (third[i, j] + 0.5 * p1[i, j] + p2[i, j] + p3[i, j]) / 8.0
                    elif k == 2:
                        p2[i, j] = (before[i, j] + p1[i, j] + p2[i, j]) / 4.0
                    else:
                        p1[i, j] = (before[i, j] + p1[i, j]) / 2.0
        for i in range(size):
            for j in range(size):
                p3[i, j] = third[i, j]
        np.dot(p0, p0, before)
        for i in range(size):
            for j in range(size):
                p0[i, j] = before[i, j]


@entry
def simulate(
    axis: Axis, command_time: Any, command: Any, time: Any, state: Any, history: Any, noise: Any, output: Any
) -> None:
    """Free run: read the sensors at each time; a measurement comes before the command of its stamp."""
    work = np.zeros((9, axis.inertia.shape[0]))
    flow = chain_flow(axis, command_time, time)
    machine, model = view_of_machine(axis, state, history, work, flow), view_of(axis)
    for k in range(time.shape[0]):
        run_to(model, command_time, command, time[k], state, history, work, flow, machine)
        measure(model, state, history, noise[k], output[k])


@inner
def correct(axis: Axis, measured: Any, gain: Any, first: int, reading: Any, state: Any, innovation: Any) -> bool:
    """Correct the motion by the rows of ``gain`` from the first on; False if it has diverged."""
    n = axis.inertia.shape[0]
    for j in range(axis.outputs.shape[0]):
        error = measured[j] - reading[j]
        innovation[j] = error
        if np.isnan(error):
            continue
        for i in range(2 * n):
            state[FIRST + i] += gain[first + i, j] * error
        state[DISTURBANCE] += gain[first + 2 * n, j] * error
    return abs(state[FIRST + n]) < RUN_AWAY


@entry
def predict(
    axis: Axis, command_time: Any, command: Any, time: Any, measured: Any, gain: Any, place: Any, decay: float,
    state: Any, history: Any, innovation: Any,
) -> None:  # fmt: skip
    """One-step predictor: the free run, corrected by ``gain @ innovation`` after each measurement.

    ``gain`` is (2n+1, p) on positions, velocities and the disturbance force, or several of these
    stacked; ``place`` is the index of the gain for each of the first measurements, its last entry
    for all that follow. An output that is NaN is ignored. ``decay`` is the share of the disturbance
    force that remains at the next measurement.
    """
    n = axis.inertia.shape[0]
    outputs = axis.outputs.shape[0]
    rows = 2 * n + 1
    last = place.shape[0] - 1
    noise = np.zeros(outputs)
    reading = np.zeros(outputs)
    work = np.zeros((9, n))
    flow = chain_flow(axis, command_time, time)
    machine, model = view_of_machine(axis, state, history, work, flow), view_of(axis)
    for k in range(time.shape[0]):
        run_to(model, command_time, command, time[k], state, history, work, flow, machine)
        state[DISTURBANCE] *= decay
        measure(model, state, history, noise, reading)
        # A diverged predictor does not recover, and each of its steps takes long.
        if not correct(model, measured[k], gain, rows * place[min(k, last)], reading, state, innovation[k]):
            innovation[k:] = np.inf
            return


@entry
def predict_ahead(
    axis: Axis, command_time: Any, command: Any, time: Any, measured: Any, gain: Any, place: Any, steps: int,
    state: Any, history: Any, prediction: Any,
) -> None:  # fmt: skip
    """Prediction (m, p) of each sample from the measurements up to ``steps`` samples before it.

    The first ``steps`` rows of ``prediction`` are left as they are.
    """
    n, outputs = axis.inertia.shape[0], axis.outputs.shape[0]
    noise, reading, innovation = np.zeros(outputs), np.zeros(outputs), np.zeros(outputs)
    last = place.shape[0] - 1
    ahead, past = np.empty_like(state), np.empty_like(history)
    work, flow, far_flow = np.zeros((9, n)), no_flow(n), chain_flow(axis, command_time, time)
    machine, model = view_of_machine(axis, state, history, work, flow), view_of(axis)
    far = view_of_machine(axis, ahead, past, work, far_flow)
    for k in range(time.shape[0] - steps):
        run_to(model, command_time, command, time[k], state, history, work, flow, machine)
        measure(model, state, history, noise, reading)
        correct(model, measured[k], gain, (2 * n + 1) * place[min(k, last)], reading, state, innovation)
        for i in range(state.shape[0]):
            ahead[i] = state[i]
        for i in range(history.shape[0]):
            for j in range(history.shape[1]):
                past[i, j] = history[i, j]
        run_to(model, command_time, command, time[k + steps], ahead, past, work, far_flow, far)
        measure(model, ahead, past, noise, prediction[k + steps])


@inner
def approach(position: Any, velocity: Any, share: float, state: Any) -> None:
    """Move all bodies a share of the way to a measured motion."""
    n = position.shape[0]
    for i in range(n):
        state[FIRST + i] += share * (position[i] - state[FIRST + i])
        state[FIRST + n + i] += share * (velocity[i] - state[FIRST + n + i])


@entry
def balance(
    axis: Axis, time: Any, position: Any, velocity: Any, acceleration: Any, command_time: Any, command: Any,
    rest: float, state: Any, residual: Any, required: Any,
) -> None:  # fmt: skip
    """Equation error of a measured motion.

    ``residual`` (m, n) is J a minus all modelled forces. Below the speed ``rest`` a body counts
    as standing: its dry friction balances the other forces up to the breakaway level.
    ``required`` (m,) is the force of the drive on body 0 for the measured motion.
    """
    model = view_of(axis)
    n = axis.inertia.shape[0]
    net = np.zeros(n)
    transmitted = np.zeros(n)
    delay = axis.constants[DELAY]
    last = command_time.shape[0] - 1
    index = -1
    state[TIME] = time[0]
    for k in range(time.shape[0]):
        while index < last and command_time[index + 1] + delay <= time[k] + SAME_TIME:
            held = command[index] if index >= 0 else 0.0
            left, step = time[k] - state[TIME], max(command_time[index + 1] + delay - state[TIME], 0.0)
            # What has a memory is settled with the motion at the end of a step.
            approach(position[k], velocity[k], min(step / left, 1.0) if left > 0.0 else 1.0, state)
            settle_effects(model, held, step, state)
            state[TIME] += step
            index += 1
        held = command[index] if index >= 0 else 0.0
        step = max(time[k] - state[TIME], 0.0)
        approach(position[k], velocity[k], 1.0, state)
        note_sides(model, state)
        settle_effects(model, held, step, state)
        state[TIME] = time[k]
        if axis.condition_hooks.shape[0] > 0:
            hold_conditions(model, time[k], state)
        smooth_forces(model, held, position[k], velocity[k], 0.0, state, net, transmitted)
        for i in range(n):
            left = axis.inertia[i] * acceleration[k, i] - net[i]
            if axis.has_friction[i]:
                direction = 1.0 if velocity[k, i] > 0.0 else -1.0
                speed = abs(velocity[k, i])
                if speed > rest:
                    left += direction * friction_level(model, i, direction, speed, transmitted[i], state)
                else:
                    push = -1.0 if left > 0.0 else 1.0
                    level = friction_level(model, i, push, 0.0, transmitted[i], state)
                    left = -push * max(abs(left) - level, 0.0)
            residual[k, i] = left
        required[k] = drive_force(model, held, position[k, 0], velocity[k, 0], 0.0, state) + residual[k, 0]


@entry
def body_forces_along(axis: Axis, time: Any, position: Any, velocity: Any, body: int, state: Any, force: Any) -> None:
    """Force (m,) of the effects at a body along a motion (m, n), without memory and without dry friction."""
    model = view_of(axis)
    hooks = axis.body_hooks
    for k in range(time.shape[0]):
        if axis.condition_hooks.shape[0] > 0:
            hold_conditions(model, time[k], state)
        approach(position[k], velocity[k], 1.0, state)
        force[k] = 0.0
        for row in range(hooks.shape[0]):
            if hooks[row, SITE] == body:
                force[k] += call(
                    hooks[row, VALUE], position[k, body], velocity[k, body], axis.inertia[body], 0.0,
                    state, hooks[row, STATE], axis.parameters, hooks[row, PARAMETER],
                )  # fmt: skip


@entry
def dry_friction_along(
    axis: Axis, time: Any, position: Any, direction: Any, speed: Any, body: int, state: Any, level: Any
) -> None:
    """Level (m,) of a body's dry friction in a direction (m,), without transmitted torque; speed 0 is breakaway."""
    model = view_of(axis)
    for k in range(time.shape[0]):
        if axis.condition_hooks.shape[0] > 0:
            hold_conditions(model, time[k], state)
        for i in range(axis.inertia.shape[0]):
            state[FIRST + i] = position[k, i]
        level[k] = friction_level(model, body, direction[k], speed[k], 0.0, state)


@entry
def drive_along(axis: Axis, time: Any, held: Any, position: Any, velocity: Any, state: Any, force: Any) -> None:
    """Force (m,) of a drive without memory for given commands and motions of body 0 at some instants."""
    model = view_of(axis)
    for k in range(held.shape[0]):
        if axis.condition_hooks.shape[0] > 0:
            hold_conditions(model, time[k], state)
        force[k] = drive_force(model, held[k], position[k], velocity[k], 0.0, state)


@entry
def accelerations_along(
    axis: Axis, time: Any, held: Any, position: Any, velocity: Any, mode: Any, state: Any, acceleration: Any
) -> None:  # fmt: skip
    """Accelerations (m,) of a body without others at given motions, with given directions of its dry friction."""
    model = view_of(axis)
    inverse = 1.0 / axis.inertia[0]
    for k in range(held.shape[0]):
        if axis.condition_hooks.shape[0] > 0:
            hold_conditions(model, time[k], state)
        acceleration[k] = single_acceleration(
            model, held[k], position[k], velocity[k], 0.0, state, mode[k], inverse
        )  # fmt: skip


@entry
def run(axis: Axis, command_time: Any, command: Any, until: float, state: Any, history: Any, work: Any) -> None:
    """Integrate to a time, for a machine that is stepped."""
    flow = no_flow(axis.inertia.shape[0])
    machine = view_of_machine(axis, state, history, work, flow)
    run_to(view_of(axis), command_time, command, until, state, history, work, flow, machine)


@entry
def read(axis: Axis, state: Any, history: Any, noise: Any, reading: Any) -> None:
    """Read every sensor now, for a machine that is stepped."""
    measure(view_of(axis), state, history, noise, reading)


@cache
def address_of_advance() -> int:
    """Address of `advance`, compiled at the first use and cached beside this file; 0 where numba is disabled."""
    if config.DISABLE_JIT:
        return 0
    signature = types.void(View(_MACHINE), types.float64, types.float64)
    return int(cfunc(signature, cache=True, error_model="numpy", _nrt=False)(advance).address)
