"""The part of a model that rigid-body formats have words for: inertias, springs, dampers, dry friction, drive."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from idloop.errors import InputError
from idloop.exporters.left_out import acts, values_of
from idloop.physics.effect import Effect, parameter_as
from idloop.physics.engine import Engine
from idloop.physics.layout import Layout
from idloop.physics.model import Model

DRY = "coulomb_friction"


@dataclass
class Body:
    """A body of the chain, in SI units of its joint.

    Attributes
    ----------
    name : str
    inertia, viscous, dry : float
        Inertia, viscous coefficient and level of dry friction against the ground.
    stiffness, rest : float
        Spring to the ground and where it is relaxed.
    load : float
        Constant force.
    """

    name: str
    inertia: float
    viscous: float
    dry: float = 0.0
    stiffness: float = 0.0
    rest: float = 0.0
    load: float = 0.0


@dataclass
class Mechanics:
    """What rigid-body formats can say of a model.

    Attributes
    ----------
    bodies : list of Body
        Along the chain, after compliance has split some.
    body_of : dict
        Place in the chain of each body of the model.
    coupling_of : dict
        Place among the couplings of each coupling of the model, those inside split bodies included.
    stiffness, damping : list of float
        Of the couplings.
    gain : float
        Force on the first body per unit of command.
    whole : set of str
        Effects that these numbers say completely.
    partly : dict
        Effects that they say in part, to what is lost.
    """

    bodies: list[Body]
    body_of: dict[str, int]
    coupling_of: dict[str, int]
    stiffness: list[float]
    damping: list[float]
    gain: float
    whole: set[str]
    partly: dict[str, str]


def body_names(model: Model, layout: Layout) -> list[str]:
    """Names of the bodies after compliance has split some; the second half of a body is its far one."""
    ends = (*layout.body_of[1:], layout.bodies)
    return [
        name if index == first else model.far_half(name)
        for name, first, end in zip(model.bodies, layout.body_of, ends, strict=True)
        for index in range(first, end)
    ]


def mechanics(model: Model, form: str) -> Mechanics:
    """Read the mechanics off a model.

    Parameters
    ----------
    model : Model
    form : str
        Name of the format, for the error line.

    Raises
    ------
    InputError
        Positions that are no motion of a joint (an electrical analogue).
    """
    if model.units.position not in ("rad", "m"):
        raise InputError(
            f"model {model.name}: its positions are in {model.units.position}, and {form} knows joints in rad or m "
            "only: choose --format control or json"
        )
    layout = Engine(model).layout()
    axis = layout.axis
    names = body_names(model, layout)
    body_of = dict(zip(model.bodies, layout.body_of, strict=True))
    found = Mechanics(
        bodies=[Body(name, float(j), float(b)) for name, j, b in zip(names, axis.inertia, axis.viscous, strict=True)],
        body_of=body_of,
        coupling_of=dict(layout.joint_of),
        stiffness=np.asarray(axis.stiffness, dtype=float).tolist(),
        damping=np.asarray(axis.damping, dtype=float).tolist(),
        gain=model.values["drive.gain"],
        whole={active.name for active in model.effects if active.effect.splits},
        partly={},
    )
    for active in model.effects:
        if active.at not in body_of or not acts(model, active):
            continue
        level = parameter_as(active.effect, lambda effect: effect.dry_level, *model.effect_folders)
        _add(found, found.bodies[body_of[active.at]], active.effect, active.name, values_of(model, active), level)
    return found


def _add(found: Mechanics, body: Body, effect: Effect, name: str, values: dict[str, float], level: str) -> None:
    """Add what an effect at a body, with a level of dry friction or without, means in these numbers."""
    if level:
        body.dry += values[level]
        if effect.name == DRY:
            found.whole.add(name)
        else:
            found.partly[name] = f"only its {level} is carried, as Coulomb friction"
    elif effect.name == "load_torque":
        body.load += values["torque"]
        found.whole.add(name)
    elif effect.linear and effect.force is not None:
        # The effect itself says what it is: a linear force is a spring, a damper and a constant.
        numbers = list(values.values())
        at_rest = effect.force(0.0, 0.0, body.inertia, 0.0, [], numbers)
        spring = at_rest - effect.force(1.0, 0.0, body.inertia, 0.0, [], numbers)
        body.viscous += at_rest - effect.force(0.0, 1.0, body.inertia, 0.0, [], numbers)
        if spring:
            together = body.stiffness + spring
            body.rest = (body.stiffness * body.rest + at_rest) / together
            body.stiffness = together
        found.whole.add(name)


def scale_notes(model: Model) -> list[str]:
    """Say so where forces are only known relative to an inertia that nobody measured."""
    if not model.parameter("drive.gain").free or any(model.parameter(f"{body}.inertia").free for body in model.bodies):
        return []
    return ["Forces are on the scale of the inertia that the model takes as known: check that it is the real one."]


def digits(value: float) -> str:
    """Text of a number with the precision of what was identified, not of its binary form."""
    return f"{value:.12g}"
