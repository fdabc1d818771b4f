"""What a machine of the suite is, and how it is usually run."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class MachineKind:
    """A preset and how it is run.

    Attributes
    ----------
    preset : str
        Its name. Its linear part is the start model; it is the truth but for the hidden effects.
    outputs : tuple of str
        Sites of the sensors that are kept; all when empty.
    free : tuple of str
        Parameters to be estimated; those of the preset when empty.
    document : mapping
        The model itself, as a model file writes it, where it is no preset.
    rates : tuple of float
        Sample rates to choose from [Hz].
    command : float
        Usual peak of the command in open loop.
    tempo : float
        Time in which the machine follows a command [s]; lengths of steps go with it.
    band : tuple of float
        Band of broad excitation [Hz].
    reference, speed, acceleration : float
        Usual reference in closed loop: peak, and limits of smooth moves.
    controller : mapping
        Controller of the closed loop; its sample time is that of the case.
    delay : float
        Samples by which the command may come late before the closed loop swings up.
    """

    preset: str
    rates: tuple[float, ...]
    command: float
    tempo: float
    band: tuple[float, float]
    reference: float
    speed: float
    acceleration: float
    controller: Mapping[str, Any]
    delay: float = math.inf
    outputs: tuple[str, ...] = ()
    free: tuple[str, ...] = ()
    document: Mapping[str, Any] | None = None
