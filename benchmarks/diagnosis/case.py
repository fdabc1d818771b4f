"""What one case of the suite is: a machine, what it hides, how it is driven and what disturbs it."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field

from nuisances import Nuisances

CATEGORIES = ("clean", "single", "double", "triple", "untestable", "realistic")


@dataclass(frozen=True)
class Hidden:
    """An effect that the machine has and the diagnosis is not told.

    Attributes
    ----------
    effect, at : str
        Name and site, as in a model file.
    values : mapping
        Its parameters in the model's units.
    """

    effect: str
    at: str
    values: Mapping[str, float]

    @property
    def name(self) -> str:
        """``effect@site``."""
        return f"{self.effect}@{self.at}"

    @property
    def text(self) -> str:
        """As on the command line, ``effect@site(parameter=value, ...)``."""
        return f"{self.name}({','.join(f'{name}={value!r}' for name, value in self.values.items())})"


@dataclass(frozen=True)
class Drive:
    """One recording: which excitation, and how large beside the machine's usual one.

    Attributes
    ----------
    kind : str
        A key of `excitations.EXCITATIONS`.
    level : float
        Share of the machine's usual command (open loop) or reference (closed loop).
    """

    kind: str
    level: float = 1.0


@dataclass(frozen=True)
class Disturbance:
    """A torque on the first body that nobody measures.

    Attributes
    ----------
    kind : str
        ``none``, ``white`` (a new value each sample), ``walk`` (random walk) or ``ar``
        (first-order autoregression with pole 0.9 per sample).
    share : float
        Its root mean square over the record, as a share of that of the machine's usual drive.
    """

    kind: str = "none"
    share: float = 0.0


@dataclass(frozen=True)
class Noise:
    """Measurement noise.

    Attributes
    ----------
    kind : str
        ``white`` or ``ar`` (first-order autoregression with pole 0.9 per sample).
    factor : float
        Standard deviation as a multiple of the preset's.
    told : bool
        The start model states the standard deviation; otherwise it is to be found from the data.
    """

    kind: str = "white"
    factor: float = 1.0
    told: bool = True


@dataclass(frozen=True)
class Case:
    """One case.

    Attributes
    ----------
    id : str
        Unique and lasting: the seed of everything random in the case comes from it.
    category : str
        One of `CATEGORIES`.
    machine : str
        A key of `machines.MACHINES`.
    simulator : str
        ``idloop``, ``mujoco`` or ``equations``; ``drive`` for a ``realistic`` case.
    hidden : tuple of Hidden
        What the diagnosis is to find.
    training : tuple of Drive
        One recording each.
    validation : Drive
        The recording that no fit sees.
    loop : str
        ``open`` or ``closed``.
    rate, duration : float
        Samples per second, and seconds of each recording.
    strength : str
        ``barely``, ``weak``, ``clear`` or ``dominant``; empty when nothing is hidden.
    quantisation : mapping
        Resolution by output site; part of the machine, neither hidden nor told.
    trap : str
        Why an ``untestable`` case cannot show its effect.
    nuisances : Nuisances or None
        What a ``realistic`` machine has beside what it hides.
    """

    id: str
    category: str
    machine: str
    simulator: str
    hidden: tuple[Hidden, ...]
    training: tuple[Drive, ...]
    validation: Drive
    loop: str
    rate: float
    duration: float
    disturbance: Disturbance = Disturbance()
    noise: Noise = Noise()
    strength: str = ""
    quantisation: Mapping[str, float] = field(default_factory=dict)
    trap: str = ""
    nuisances: Nuisances | None = None

    @property
    def truth(self) -> tuple[str, ...]:
        """Names of the hidden effects."""
        return tuple(hidden.name for hidden in self.hidden)

    @property
    def effect(self) -> str:
        """Hidden effects without their sites, for tables; ``none`` when there is none."""
        return " + ".join(hidden.effect for hidden in self.hidden) or "none"

    def seed(self, suite: int, what: str) -> int:
        """Seed of one random thing of this case; equal for equal arguments on every machine."""
        return zlib.crc32(f"{suite}/{self.id}/{what}".encode())
