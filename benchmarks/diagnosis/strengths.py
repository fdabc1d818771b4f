"""From a strength in words to the parameters of an effect on a machine under one excitation."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from case import Drive, Hidden
from machines import MACHINES, MachineKind, base_model
from sizes import Sizes, sizes

STRENGTHS = ("barely", "weak", "clear", "dominant")
# Share of the usual command, force, speed, ... that the effect takes.
SHARE = dict(zip(STRENGTHS, (0.01, 0.04, 0.12, 0.4), strict=True))


@dataclass(frozen=True)
class Place:
    """Where an effect is to sit and how the machine runs there."""

    kind: MachineKind
    model: Any
    at: str
    size: Sizes
    rate: float
    random: np.random.Generator

    @property
    def coupling(self) -> int:
        """Index of the coupling."""
        from idloop.physics.layout import lay_out

        return int(lay_out(self.model).joint_of[self.at])

    @property
    def sign(self) -> float:
        """One of the two directions."""
        return float(self.random.choice([-1.0, 1.0]))

    @property
    def phase(self) -> float:
        """Any angle."""
        return float(self.random.uniform(-math.pi, math.pi))

    @property
    def noise(self) -> float:
        """Noise of the output."""
        return float(next(o.noise for o in self.model.outputs if o.site == self.at))

    @property
    def position_noise(self) -> float:
        """Noise of the first position sensor [position unit]."""
        return float(next(o.noise / o.scale for o in self.model.outputs if o.field == "position"))


Values = dict[str, float]
# From place and index of the strength (0 to 3) to values.
Rule = Callable[[Place, int], Values]


def _share(index: int) -> float:
    return SHARE[STRENGTHS[index]]


def _late(p: Place, index: int, samples: tuple[float, ...], most: float) -> float:
    """A time of so many samples, at most a share of the machine's own, on a grid of twentieths of a sample."""
    stands = p.kind.delay if p.at == "input" and p.model.controller is not None else math.inf
    count = min(samples[index], most * p.kind.tempo * p.rate, stands)
    return max(round(20.0 * count), 1) / (20.0 * p.rate)


def _stribeck(p: Place, i: int) -> Values:
    level = _share(i) * p.size.force
    return {"coulomb": level, "static": 2.0 * level, "velocity": 0.1 * p.size.speed}


def _presliding(p: Place, i: int) -> Values:
    level = (0.03, 0.08, 0.2, 0.4)[i] * p.size.force
    reach = max(0.05 * p.size.stroke, 10.0 * p.position_noise)
    return {"level": level, "stiffness": level / reach, "velocity": 0.1 * p.size.speed, "damping": 0.0}


def _compliance(p: Place, i: int) -> Values:
    inertia = p.model.values[f"{p.at}.inertia"]
    frequency = max((0.15, 0.1, 0.06, 0.03)[i] * p.rate, 1.0 / p.kind.tempo)
    split = float(p.random.uniform(0.3, 0.7))
    stiffness = (2.0 * math.pi * frequency) ** 2 * inertia * split * (1.0 - split)
    damping = 2.0 * 0.05 * stiffness / (2.0 * math.pi * frequency)
    return {"stiffness": stiffness, "damping": damping, "split": split}


def _speed_limit(p: Place, i: int) -> Values:
    peak = p.size.command_peak
    return {
        "supply": (1.3, 1.15, 0.95, 0.7)[i] * peak,
        "back_emf": 0.5 * peak / p.size.speed_peak,
        "resistance": 1.0,
    }


def _cogging(p: Place, i: int) -> Values:
    # the ripple has to pass the sensor at the usual speed
    most = int(min(0.1 * p.rate * 2.0 * math.pi / p.size.speed, 16.0))
    harmonic = float(p.random.integers(2, max(most, 2) + 1))
    return {"amplitude": _share(i) * p.size.force, "harmonic": harmonic, "phase": p.phase}


def _ripple(p: Place, i: int) -> Values:
    amplitude = (0.005, 0.02, 0.06, 0.15)[i]
    return {"amplitude": amplitude, "harmonic": float(p.random.integers(1, 5)), "phase": p.phase}


def _cable(p: Place, i: int) -> Values:
    rest = float(p.random.uniform(-1.0, 1.0)) * p.size.stroke
    return {"stiffness": _share(i) * p.size.force / p.size.stroke, "rest": rest}


def _sensor_offset(p: Place, i: int) -> Values:
    if p.at.startswith("velocity"):
        scale = next(o.scale for o in p.model.outputs if o.site == p.at)
        return {"offset": p.sign * _share(i) * p.size.speed * scale}
    return {"offset": p.sign * (1.0, 3.0, 10.0, 40.0)[i] * p.noise}


RULES: dict[str, Rule] = {
    "input_offset": lambda p, i: {"offset": p.sign * _share(i) * p.size.command},
    "gain_asymmetry": lambda p, i: {"ratio": p.sign * (0.01, 0.04, 0.12, 0.3)[i]},
    "dead_zone": lambda p, i: {"width": _share(i) * p.size.command},
    "saturation": lambda p, i: {"limit": (0.95, 0.85, 0.7, 0.5)[i] * p.size.command_peak},
    "speed_limit_voltage": _speed_limit,
    "input_delay": lambda p, i: {"delay": _late(p, i, (0.5, 1.0, 2.5, 6.0), 0.1)},
    "actuator_lag": lambda p, i: {"time_constant": _late(p, i, (1.0, 2.0, 5.0, 12.0), 0.2)},
    "viscous_friction": lambda p, i: {
        "coefficient": (0.05, 0.15, 0.4, 1.0)[i] * p.model.values[f"{p.at}.viscous_friction"]
    },
    "coulomb_friction": lambda p, i: {"level": _share(i) * p.size.force},
    "stribeck_friction": _stribeck,
    "asymmetric_friction": lambda p, i: {"level": 1.5 * _share(i) * p.size.force, "ratio": 0.4 * p.sign},
    "presliding_friction": _presliding,
    "quadratic_drag": lambda p, i: {"coefficient": _share(i) * p.size.force / p.size.speed**2},
    "asymmetric_viscous_friction": lambda p, i: {"coefficient": p.sign * _share(i) * p.size.force / p.size.speed},
    "gravity": lambda p, i: {"moment": p.sign * _share(i) * p.size.force, "lowest": 0.0},
    "imbalance": lambda p, i: {"amplitude": _share(i) * p.size.force, "phase": p.phase},
    "cogging": _cogging,
    "cable_spring": _cable,
    "load_torque": lambda p, i: {"torque": p.sign * _share(i) * p.size.force},
    "load_dependent_friction": lambda p, i: {"ratio": (0.01, 0.04, 0.12, 0.3)[i]},
    "compliance": _compliance,
    "backlash": lambda p, i: (
        {"gap": (0.1, 0.4, 1.2, 3.0)[i] * p.size.twist[p.coupling]}
        if "-" in p.at
        else {"gap": min((1.0, 4.0, 12.0, 40.0)[i] * p.noise, 0.3 * p.size.stroke)}
    ),
    "hardening_stiffness": lambda p, i: {
        "cubic": (0.03, 0.1, 0.3, 1.0)[i] * p.model.values[f"{p.at}.stiffness"] / p.size.twist[p.coupling] ** 2
    },
    "slip": lambda p, i: {"limit": (0.95, 0.85, 0.7, 0.5)[i] * p.size.torque_peak[p.coupling]},
    "sensor_quantisation": lambda p, i: {"resolution": (1.5, 4.0, 12.0, 40.0)[i] * p.noise},
    "sensor_delay": lambda p, i: {"delay": _late(p, i, (0.5, 1.0, 2.5, 6.0), 0.1)},
    "sensor_offset": _sensor_offset,
    "sensor_ripple": _ripple,
    "velocity_filter": lambda p, i: {"time_constant": _late(p, i, (1.0, 2.0, 5.0, 12.0), 0.2)},
}


def hidden(
    effect: str,
    at: str,
    machine: str,
    loop: str,
    drive: Drive,
    rate: float,
    strength: str,
    seed: int,
    beside: Sequence[Hidden] = (),
) -> Hidden:
    """An effect of a given strength.

    Parameters
    ----------
    effect, at : str
        Name and site.
    machine, loop, drive, rate
        How the machine runs: strengths are shares of what it does then.
    strength : str
        One of `STRENGTHS`.
    seed : int
        Draws signs, phases and harmonics.
    beside : sequence of Hidden
        Effects that the machine has already: one that splits the body inside which this one is to sit counts.

    Returns
    -------
    Hidden
        Values rounded to three digits.
    """
    splitting = tuple(one.text for one in beside if at == f"{one.at}-{one.at}_far")
    place = Place(
        MACHINES[machine],
        base_model(machine, rate, loop).with_effects(splitting),
        at,
        sizes(machine, loop, drive, splitting),
        rate,
        np.random.default_rng(seed),
    )
    values = RULES[effect](place, STRENGTHS.index(strength))
    exact = ("delay", "harmonic")
    return Hidden(effect, at, {k: v if k in exact else float(f"{v:.3g}") for k, v in values.items()})
