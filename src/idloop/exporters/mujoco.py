"""MJCF: the axis as a small model that MuJoCo loads and simulates."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from importlib.metadata import PackageNotFoundError, version
from xml.etree import ElementTree as ET

import numpy as np

from idloop.exporters.exported import (
    Exported,
    acts,
    comment_lines,
    effects_left_out,
    file_name,
    rest_left_out,
    xml_text,
)
from idloop.exporters.mechanics import Mechanics, digits, mechanics, scale_notes
from idloop.physics.effect import INPUT
from idloop.physics.engine import Engine
from idloop.physics.model import Model, values_of

JOINTS = {"rad": "hinge", "m": "slide"}
LONGEST_STEP = 1e-3  # s
NEW = 4  # version from which on delays, cogging and polynomial damping are known
# Force -amplitude sin(count q + phase) of an effect: amplitude, count, phase.
WAVES: dict[str, Callable[[Mapping[str, float]], tuple[float, float, float]]] = {
    "cogging": lambda own: (own["amplitude"], own["harmonic"], own["phase"]),
    "imbalance": lambda own: (own["amplitude"], 1.0, own["phase"]),
    "gravity": lambda own: (own["moment"], 1.0, -own["lowest"]),
}
STEP_ANGLE = 0.1  # the fastest mode turns by at most this in one step [rad]
# Stiff dry friction: with MuJoCo's soft default a standing body creeps. Times below two steps are raised to two steps.
STICKING = {"solreffriction": "1e-05 1", "solimpfriction": "0.9999 0.9999 0.001"}


def export(model: Model) -> Exported:
    """Write the axis as an MJCF model.

    Bodies are nested: the first joint is the driven one, each further joint is a coupling and its
    position the twist. A force between a later body and the ground (friction, a cable) acts on a
    fixed tendon that is the sum of the joints up to that body.

    Raises InputError: the positions are not those of a joint.
    """
    found = mechanics(model, "mujoco")
    root = ET.Element("mujoco", model=model.name)
    ET.SubElement(root, "compiler", angle="radian", autolimits="true")
    option = ET.SubElement(
        root, "option", timestep=digits(_step(model)), gravity="0 0 0", integrator="implicitfast", tolerance="1e-12"
    )
    ET.SubElement(option, "flag", contact="disable")
    gaps = _gaps(model, found)
    carried = {*found.whole}
    _bodies(ET.SubElement(root, "worldbody"), model, found, gaps)
    _tendons(root, found, gaps)
    actuators = ET.SubElement(root, "actuator")
    _actuator(actuators, model, found, carried)
    sensors = _sensors(ET.SubElement(root, "sensor"), model, found)
    if _is_new():
        _of_version_4(root, actuators, sensors, model, found, carried)
    for active in model.effects:
        if active.effect.name == "load_torque" and found.body_of[active.at] > 0:
            carried.discard(active.name)
    scales = [
        f"scale of {output.name} ({output.scale:.6g} {output.unit} per unit of motion): the sensor shows the motion"
        for output in model.outputs
        if output.scale != 1.0
    ]
    left_out = (*effects_left_out(model, carried, found.partly), *scales, *rest_left_out(model))
    units = model.units
    notes = [
        f"Units: {units.position}, {units.inertia}, {units.force}; ctrl in {units.input}.",
        f'For the joint of a robot whose links have their own inertia: armature="{digits(found.bodies[0].inertia)}".',
    ]
    notes += scale_notes(model)
    if units.position == "rad":
        notes.append("Masses are placeholders: a rotary axis has an inertia only, and gravity is off.")
    text = xml_text(root, comment_lines(model, "MuJoCo model", notes, left_out))
    return Exported("mujoco", file_name(model.name, ".mjcf.xml"), text, left_out)


def _step(model: Model) -> float:
    """Time step [s] for the fastest mode, rounded down to 1, 2 or 5 of its decade."""
    fastest = float(np.max(np.abs(np.linalg.eigvals(Engine(model).linearise().A))))
    step = min(LONGEST_STEP, STEP_ANGLE / fastest) if fastest > 0.0 else LONGEST_STEP
    decade = 10.0 ** math.floor(math.log10(step) + 1e-9)
    return max(factor * decade for factor in (1.0, 2.0, 5.0) if factor * decade <= step * (1.0 + 1e-9))


def _gaps(model: Model, found: Mechanics) -> dict[int, float]:
    """Width of the gap of each coupling with backlash."""
    gaps = {}
    for active in model.effects:
        if active.effect.name == "backlash" and active.at in found.coupling_of and acts(model, active):
            gaps[found.coupling_of[active.at]] = values_of(active, model.values)["gap"]
            if found.damping[found.coupling_of[active.at]] == 0.0:
                found.whole.add(active.name)
            else:
                what = "exported as the dead band of a spring, but the damping also acts inside the gap"
                found.partly[active.name] = what
    return gaps


def _bodies(parent: ET.Element, model: Model, found: Mechanics, gaps: dict[int, float]) -> None:
    linear = model.units.position == "m"
    for index, body in enumerate(found.bodies):
        element = ET.SubElement(parent, "body", name=body.name)
        shape = {"name": _joint(found, index), "type": JOINTS[model.units.position], "axis": "0 0 1"}
        if index == 0:
            numbers = {"damping": body.viscous, "frictionloss": body.dry}
            if body.stiffness:
                numbers |= {"stiffness": body.stiffness, "springref": body.rest}
        else:
            numbers = {"damping": found.damping[index - 1]}
            if index - 1 not in gaps:
                numbers["stiffness"] = found.stiffness[index - 1]
        sticking = STICKING if numbers.get("frictionloss") else {}
        ET.SubElement(element, "joint", shape | {k: digits(v) for k, v in numbers.items()} | sticking)
        # Not as armature: MuJoCo scales the stiffness of dry friction by the inertia of bodies.
        inertia = digits(body.inertia)
        mass = inertia if linear else "1"
        ET.SubElement(element, "inertial", pos="0 0 0", mass=mass, diaginertia=f"{inertia} {inertia} {inertia}")
        parent = element


def _joint(found: Mechanics, index: int) -> str:
    name = found.bodies[index].name
    return name if index == 0 else f"{found.bodies[index - 1].name}-{name}"


def _tendons(root: ET.Element, found: Mechanics, gaps: dict[int, float]) -> None:
    if len(found.bodies) == 1:
        return
    tendons = ET.SubElement(root, "tendon")
    for index, body in enumerate(found.bodies[1:], start=1):
        numbers = {"damping": body.viscous, "frictionloss": body.dry}
        spring = {}
        if body.stiffness:
            # -1 at both ends means the initial length to MuJoCo.
            rest = digits(body.rest)
            ends = f"{rest} {rest}" if rest != "-1" else "-1 -0.999999999"
            spring = {"stiffness": digits(body.stiffness), "springlength": ends}
        sticking = STICKING if body.dry else {}
        fixed = ET.SubElement(
            tendons, "fixed", {"name": body.name} | {k: digits(v) for k, v in numbers.items()} | spring | sticking
        )
        for before in range(index + 1):
            ET.SubElement(fixed, "joint", joint=_joint(found, before), coef="1")
    for coupling, gap in gaps.items():
        half = digits(0.5 * gap)
        joint, stiffness = _joint(found, coupling + 1), digits(found.stiffness[coupling])
        band = {"name": f"backlash-{joint}", "stiffness": stiffness, "springlength": f"-{half} {half}"}
        ET.SubElement(ET.SubElement(tendons, "fixed", band), "joint", joint=joint, coef="1")


def _actuator(parent: ET.Element, model: Model, found: Mechanics, carried: set[str]) -> None:
    bias, loop = found.bodies[0].load, model.loop_gains(model.values)
    gain = found.gain * loop.set_point
    drive = {"name": model.input.joint, "joint": _joint(found, 0), "gaintype": "fixed", "gainprm": digits(gain)}
    limit = values_of(model.loop, model.values)["limit"] if model.loop is not None else np.inf
    for active in model.effects:
        if active.effect.site != INPUT or not acts(model, active):
            continue
        values = values_of(active, model.values)
        if active.effect.name == "saturation":
            limit = min(limit, values["limit"])
        elif active.effect.name == "input_offset":
            bias += found.gain * values["offset"]
        elif active.effect.name == "actuator_lag":
            drive |= {"dyntype": "filterexact", "dynprm": digits(values["time_constant"])}
        else:
            continue
        carried.add(active.name)
    if model.loop is not None:
        terms = (bias, found.gain * loop.position, found.gain * loop.velocity)
        drive |= {"biastype": "affine", "biasprm": " ".join(digits(term) for term in terms)}
    elif bias:
        drive |= {"biastype": "affine", "biasprm": f"{digits(bias)} 0 0"}
    if np.isfinite(limit):
        # What limits the output of a loop limits a force, and what limits a command limits it.
        name, most = ("forcerange", abs(found.gain) * limit) if model.loop is not None else ("ctrlrange", limit)
        drive[name] = f"{digits(-most)} {digits(most)}"
    ET.SubElement(parent, "general", drive)


def _is_new() -> bool:
    """Whether the installed MuJoCo has delays, cogging and polynomial damping."""
    try:
        return int(version("mujoco").partition(".")[0]) >= NEW
    except PackageNotFoundError:
        return False


def _of_version_4(
    root: ET.Element, actuators: ET.Element, sensors: dict[str, ET.Element], model: Model, found: Mechanics,
    carried: set[str],
) -> None:  # fmt: skip
    """Delays, waves over the angle and quadratic drag of the driven body, which older versions refuse."""
    step, first = _step(model), model.bodies[0]
    joint = root.find(".//joint")
    for active in model.effects:
        values, effect = values_of(active, model.values), active.effect
        if not acts(model, active):
            continue
        if effect.delay and (active.at in sensors or effect.site == INPUT):
            place = sensors[active.at] if active.at in sensors else actuators[0]
            delay = values[effect.delay] + float(place.get("delay", "0"))
            place.set("delay", digits(delay))
            place.set("nsample", f"{math.ceil(delay / step) + 1}")
        elif active.at == first and effect.name in WAVES and WAVES[effect.name](values)[1].is_integer():
            amplitude, count, phase = WAVES[effect.name](values)
            # MuJoCo's cogging is +amplitude sin(count q + phase).
            wave = f"{digits(amplitude)} {digits(count)} {digits(phase + math.pi)}"
            # A motor without current that adds next to no damping: it is there for its cogging.
            still = {"motorconst": "1e-6", "resistance": "1", "input": "none"}
            ET.SubElement(actuators, "dcmotor", {"joint": _joint(found, 0), **still, "cogging": wave})
        elif active.at == first and effect.name == "quadratic_drag" and joint is not None:
            joint.set("damping", f"{joint.get('damping')} {digits(values['coefficient'])}")
        else:
            continue
        carried.add(active.name)


def _sensors(parent: ET.Element, model: Model, found: Mechanics) -> dict[str, ET.Element]:
    """Write the sensors; return them by the site of their effects."""
    written = {}
    for output in model.outputs:
        index = found.body_of[output.body]
        kind = "joint" if index == 0 else "tendon"
        tag = f"{kind}{'pos' if output.field == 'position' else 'vel'}"
        target = _joint(found, 0) if index == 0 else found.bodies[index].name
        noise = {} if output.noise is None else {"noise": digits(output.noise / abs(output.scale))}
        written[output.site] = ET.SubElement(parent, tag, {"name": output.name, kind: target} | noise)
    return written
