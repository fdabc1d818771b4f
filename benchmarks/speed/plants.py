"""Chains of joints as every contestant of the simulation gets them: plain numbers."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from idloop.physics import Model

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Plant:
    """A preset or model file, with dry friction added.

    Attributes
    ----------
    name : str
    source : str
        Preset, or model file beside this one.
    dry : tuple of float
        Coulomb friction of each body; zero is none.
    """

    name: str
    source: str
    dry: tuple[float, ...]

    def model(self) -> Model:
        """Model of idloop."""
        from idloop.physics import load_model

        beside = Path(__file__).with_name(self.source)
        model = load_model(beside if beside.exists() else self.source)
        for body, level in zip(model.bodies, self.dry, strict=True):
            if level:
                model = model.with_effect("coulomb_friction", body, level=level)
        return model

    def numbers(self) -> dict[str, Array]:
        """Inertia, friction, springs and gain: arrays over the bodies; springs have one entry too many."""
        values = self.model().values
        names = list(self.model().bodies)
        pairs = [f"{one}-{other}" for one, other in pairwise(names)]
        found = {
            "inertia": [values[f"{name}.inertia"] for name in names],
            "viscous": [values[f"{name}.viscous_friction"] for name in names],
            "dry": list(self.dry),
            "stiffness": [*(values[f"{pair}.stiffness"] for pair in pairs), 0.0],
            "damping": [*(values[f"{pair}.damping"] for pair in pairs), 0.0],
            "gain": [values["drive.gain"]],
        }
        return {key: np.array(value, dtype=float) for key, value in found.items()}


PLANTS = (
    Plant("one joint, viscous friction", "dc_motor", (0.0,)),
    Plant("one joint, Coulomb friction", "dc_motor", (1.0,)),
    Plant("two joints, viscous friction", "two_joints.yaml", (0.0, 0.0)),
    Plant("two joints, Coulomb friction", "two_joints.yaml", (0.1, 0.05)),
)


def steps_of_command(samples: int, seed: int = 1, size: float = 1.0) -> Array:
    """Command that is held for 0.2 s at 1 kHz."""
    random = np.random.default_rng(seed)
    return np.asarray(np.repeat(random.uniform(-size, size, samples // 200 + 1), 200)[:samples])
