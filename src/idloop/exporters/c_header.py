"""A header of C99: the command that a wanted motion needs, for firmware or a ros2_control plugin."""

from __future__ import annotations

import re

from idloop.errors import InputError
from idloop.exporters.c_equation import c_function
from idloop.exporters.exported import Exported, acts, comment_lines, effects_left_out, file_name, rest_left_out
from idloop.exporters.mechanics import scale_notes
from idloop.physics.effect import BODY, INPUT
from idloop.physics.hooks import Hook
from idloop.physics.model import ActiveEffect, Model, values_of

# A friction that grows with the transmitted force depends on itself: so many rounds of its fixed point.
_ROUNDS = 8
_HEAD = """\
#ifndef {guard}
#define {guard}

#include <math.h>

"""
_BODY = """\
/* Force of the drive [{force}] that a motion needs: position [{position}], velocity [{position}/s] and acceleration
 * [{position}/s^2] of {body}. Dry friction changes its sign over about rest_speed [{position}/s], a few times the noise
 * of the velocity; a motion that is wanted may have 0. */
static inline double {name}_force(double position, double velocity, double acceleration, double rest_speed)
{{
    double side = rest_speed > 0.0 ? tanh(velocity / rest_speed) : (double)((velocity > 0.0) - (velocity < 0.0));
    double smooth = {inertia} * acceleration + {viscous} * velocity;
{forces}    double total = smooth;
{friction}    (void)position;
    (void)side;
    return total;
}}

/* Command [{input}] for it: the inverse of what acts between command and force. A dead zone is left in a step of the
 * command, which is smooth over about rest_command [{input}]. */
static inline double {name}_command(
    double position, double velocity, double acceleration, double rest_speed, double rest_command)
{{
    double command = {name}_force(position, velocity, acceleration, rest_speed) / {gain};
{inverses}    (void)rest_command;
    return command;
}}

#endif
"""


def export(model: Model) -> Exported:
    """Write the force and the command of a wanted motion.

    Raises InputError: several bodies, a drive with a loop of its own, or a drive gain of 0.
    """
    if len(model.bodies) > 1:
        raise InputError(f"model {model.name}: a C header is of one body, and this model has {len(model.bodies)}")
    if model.loop is not None:
        raise InputError(f"model {model.name}: its drive has a loop of its own: it takes no force or command of one")
    if model.values["drive.gain"] == 0.0:
        raise InputError(f"model {model.name}: its drive gain is 0, so that no command moves it")
    name = re.sub(r"\W+", "_", file_name(model.name, "")) or "model"
    name = f"model_{name}" if name[0].isdigit() else name
    functions, carried, why = [], set[str](), {}
    lines: dict[str, list[str]] = {"force": [], "friction": [], "undo": []}
    for active in model.acting:
        if not acts(model, active) or active.effect.states or active.effect.settle:
            continue
        for kind, equation in _equations(active).items():
            own = f"{name}_{re.sub(r'[^0-9a-zA-Z]+', '_', active.name)}_{kind}"
            try:
                functions.append(c_function(own, equation))
            except InputError as error:
                why[active.name] = str(error)
                continue
            numbers = ", ".join(_number(value) for value in values_of(active, model.values).values())
            lines[kind].append(_line(kind, own, numbers or "0.0", model))
            carried.add(active.name)
    body = model.bodies[0]
    text = _HEAD.format(guard=f"IDLOOP_{name.upper()}_H") + "\n".join([*functions, ""]) + _BODY.format(
        name=name, body=body, force=model.units.force, position=model.units.position, input=model.input.unit,
        inertia=_number(model.values[f"{body}.inertia"]), viscous=_number(model.values[f"{body}.viscous_friction"]),
        gain=_number(model.values["drive.gain"]), forces="".join(lines["force"]),
        friction=_friction(lines["friction"]), inverses="".join(reversed(lines["undo"])),
    )  # fmt: skip
    left_out = (*effects_left_out(model, carried, why), *rest_left_out(model))
    head = comment_lines(model, "C99 header", scale_notes(model), left_out)
    comments = "".join(f" * {line.replace('*/', '* /')}\n" for line in head)
    return Exported("c", file_name(model.name, ".h"), f"/*\n{comments} */\n{text}", left_out)


def _equations(active: ActiveEffect) -> dict[str, Hook]:
    """What a wanted motion needs of an effect: its force, its dry friction, the inverse for a command."""
    effect = active.effect
    places = {"force": effect.force, "friction": effect.friction} if effect.site == BODY else {}
    places |= {"undo": effect.undo} if effect.site == INPUT else {}
    return {kind: hook for kind, hook in places.items() if hook is not None}


def _line(kind: str, function: str, numbers: str, model: Model) -> str:
    """Call of a function, where it belongs."""
    given = f"(const double[]){{{numbers}}}"
    none = "(const double[]){0.0}"
    if kind == "force":
        inertia = _number(model.values[f"{model.bodies[0]}.inertia"])
        return f"    smooth -= {function}(position, velocity, {inertia}, 0.0, {none}, {given});\n"
    if kind == "friction":
        way = "side >= 0.0 ? 1.0 : -1.0"
        return f"        level += {function}({way}, fabs(velocity), fabs(total), 0.0, {none}, {given});\n"
    side = "rest_command > 0.0 ? tanh(command / rest_command) : (double)((command > 0.0) - (command < 0.0))"
    return f"    command = {function}(command, velocity, {side}, 0.0, {none}, {given});\n"


def _friction(levels: list[str]) -> str:
    if not levels:
        return ""
    rounds = f"    for (int round = 0; round < {_ROUNDS}; ++round) {{\n        double level = 0.0;\n"
    return f"{rounds}{''.join(levels)}        total = smooth + side * fmax(level, 0.0);\n    }}\n"


def _number(value: float) -> str:
    """A double with all of its digits."""
    if value in (float("inf"), -float("inf")):
        return "HUGE_VAL" if value > 0.0 else "-HUGE_VAL"
    return repr(float(value))
