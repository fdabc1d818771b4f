"""What to write in the model file once one body has turned out to be two."""

from __future__ import annotations

from collections.abc import Collection

from idloop.physics.layout import lay_out
from idloop.physics.model import Model


def split_bodies(model: Model, added: Collection[str]) -> list[str]:
    """Say of effects that split a body how the model file would say it, and what that is good for.

    Parameters
    ----------
    model : Model
        Fitted.
    added : collection of str
        Effects that its file does not have yet, as ``effect@site``.

    Returns
    -------
    list of str
        One line for each body that is split.
    """
    layout, units = lay_out(model), model.units
    found = []
    for coupling, active in model.inner_couplings.items():
        joint = layout.joint_of.get(coupling)
        if active.name not in added or joint is None:
            continue
        near, far = layout.axis.inertia[joint : joint + 2]
        found.append(
            f"{active.name} splits {active.at} into two bodies (inertia {near:.3g} and {far:.3g} {units.inertia}, "
            f"stiffness {layout.axis.stiffness[joint]:.3g} {units.fill('{force}/{position}')}); sensors and effects of "
            f"{active.at} are those of the first: write both as bodies with a coupling in the model file where the "
            "second has a sensor or friction of its own"
        )
    return found
