"""Machines made as real ones are.

A drive of `drives.DRIVES` with none, one or two dominant effects, in sizes as drives have them, and all the small
things of `nuisances`, each below the dominant effects.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from case import Case, Disturbance, Drive, Hidden, Noise
from drives import BUILDS, DRIVES
from excitations import CLOSED, OPEN
from machine_kind import MachineKind
from machines import base_model
from nuisances import Nuisances
from plan import SINGLES
from sizes import Sizes, sizes

SINGLE_CASES, DOUBLE_CASES, CLEAN_CASES = 8, 4, 28
# A small thing is at most this share of the smallest dominant effect; with none, of a tenth of the drive's force.
SMALL, USUAL = 0.5, 0.1
# Samples of all training recordings together by number of bodies; seconds of each.
MOST_SAMPLES, SHORTEST, LONGEST = {1: 12000, 2: 8000}, 5.0, 30.0
LEVELS = (1.0, 0.5, 0.75, 0.3)

_BLIND = ("two_level", "one_way", "crawl", "small")
_KINDS = {
    "open": tuple(kind for kind in OPEN if kind not in _BLIND),
    "closed": tuple(kind for kind in CLOSED if kind not in _BLIND),
}
_SHOWN_BY = {row.effect: {"open": row.open, "closed": row.closed} for row in SINGLES}


@dataclass(frozen=True)
class Site:
    """Where an effect is to sit, how the machine runs there, and which share of the force it is to take."""

    kind: MachineKind
    model: Any
    loop: str
    size: Sizes
    rate: float
    share: float
    random: np.random.Generator

    @property
    def first(self) -> str:
        """The driven body."""
        return str(self.model.bodies[0])

    @property
    def any_body(self) -> str:
        """One of the bodies, mostly the driven one."""
        return self.first if self.random.random() < 0.7 else str(self.model.bodies[-1])

    @property
    def sign(self) -> float:
        """One of the two directions."""
        return float(self.random.choice([-1.0, 1.0]))

    @property
    def force(self) -> float:
        """Size of the effect's force."""
        return self.share * self.size.force

    @property
    def bandwidth(self) -> float:
        """Of the velocity loop [rad/s]; in open loop what the machine itself follows."""
        if self.loop == "open":
            return 1.0 / self.kind.tempo
        return BUILDS[self.kind.preset].bandwidth

    @property
    def resonance(self) -> float:
        """Of the coupling in a loop [rad/s]; 0 where there is none."""
        build = BUILDS[self.kind.preset]
        if self.loop == "open" or len(build.bodies) == 1:
            return 0.0
        return math.sqrt(build.stiffness * sum(1.0 / body[1] for body in build.bodies))


# To site and values.
Rule = Callable[[Site], tuple[str, dict[str, float]]]


def _stribeck(s: Site) -> tuple[str, dict[str, float]]:
    velocity = float(s.random.uniform(0.03, 0.15)) * s.size.speed
    return s.first, {"coulomb": s.force, "static": float(s.random.uniform(1.4, 2.2)) * s.force, "velocity": velocity}


def _cogging(s: Site) -> tuple[str, dict[str, float]]:
    amplitude, phase = 1.4 * s.force, float(s.random.uniform(-math.pi, math.pi))
    # the wave has to pass at a tenth of the sample rate at most, and several times within the stroke
    fastest = 2.0 * math.pi * 0.1 * s.rate / s.size.speed
    if s.model.units.position == "m":
        pitch = float(s.random.choice([0.024, 0.03, 0.06]))
        return s.first, {"amplitude": amplitude, "period": max(pitch, 2.0 * math.pi / fastest), "phase": phase}
    harmonic = float(s.random.integers(3, max(min(int(fastest), 24), 3) + 1))
    return s.first, {"amplitude": amplitude, "harmonic": harmonic, "phase": phase}


def _backlash(s: Site) -> tuple[str, dict[str, float]]:
    body = BUILDS[s.kind.preset].bodies[-1]
    return s.model.couplings[0], {"gap": max(float(s.random.uniform(1.5, 6.0)) * s.size.twist[0], 8.0 * body[3])}


def _delay(s: Site) -> tuple[str, dict[str, float]]:
    # as much of a sample time as buses take, but the loop has to stay stable, at the coupling's resonance too
    late = min(float(s.random.uniform(1.0, 4.0)) / s.rate, 0.3 / max(s.bandwidth, s.resonance))
    return "input", {"delay": late}


def _saturation(s: Site) -> tuple[str, dict[str, float]]:
    # a peak comes once in a record, if at all: the limit has to be met by what is usual, too
    usual = min(0.8 * s.size.command_peak, 2.2 * s.size.command)
    return "input", {"limit": float(s.random.uniform(0.5, 0.9)) * usual}


def _compliance(s: Site) -> tuple[str, dict[str, float]]:
    inertia, split = s.model.values[f"{s.first}.inertia"], float(s.random.uniform(0.3, 0.7))
    # what the loop gives at the resonance must not swing it up
    slowest = max(1.0 / s.kind.tempo, 2.0 * s.bandwidth / (2.0 * math.pi * (1.0 - split)))
    frequency = float(np.exp(s.random.uniform(np.log(slowest), np.log(max(0.1 * s.rate, 1.2 * slowest)))))
    stiffness = (2.0 * math.pi * frequency) ** 2 * inertia * split * (1.0 - split)
    damping = 2.0 * float(s.random.uniform(0.02, 0.08)) * stiffness / (2.0 * math.pi * frequency)
    return s.first, {"stiffness": stiffness, "damping": damping, "split": split}


def _spring(s: Site) -> tuple[str, dict[str, float]]:
    rest = float(s.random.uniform(-0.5, 0.5)) * s.size.stroke
    return s.first, {"stiffness": s.force / s.size.stroke, "rest": rest}


RULES: Mapping[str, Rule] = {
    "coulomb_friction": lambda s: (s.any_body, {"level": s.force}),
    "stribeck_friction": _stribeck,
    "asymmetric_friction": lambda s: (
        s.first,
        {"level": s.force, "ratio": s.sign * float(s.random.uniform(0.25, 0.5))},
    ),
    "input_offset": lambda s: ("input", {"offset": s.sign * s.share * s.size.command}),
    "load_torque": lambda s: (s.any_body, {"torque": s.sign * s.force}),
    "imbalance": lambda s: (
        s.any_body,
        {"amplitude": 1.4 * s.force, "phase": float(s.random.uniform(-math.pi, math.pi))},
    ),
    "cogging": _cogging,
    "cable_spring": _spring,
    "backlash": _backlash,
    "dead_zone": lambda s: ("input", {"width": min(s.share, 0.25) * s.size.command}),
    "saturation": _saturation,
    "input_delay": _delay,
    "compliance": _compliance,
}
# The force that these take is not chosen by its share.
_BY_THEIR_OWN = ("backlash", "saturation", "input_delay", "compliance")

PAIRS = (
    ("coulomb_friction", "input_offset"),
    ("coulomb_friction", "cogging"),
    ("coulomb_friction", "imbalance"),
    ("coulomb_friction", "backlash"),
    ("coulomb_friction", "compliance"),
    ("coulomb_friction", "saturation"),
    ("coulomb_friction", "input_delay"),
    ("stribeck_friction", "load_torque"),
    ("stribeck_friction", "cogging"),
    ("asymmetric_friction", "cogging"),
    ("dead_zone", "coulomb_friction"),
    ("backlash", "load_torque"),
    ("cable_spring", "coulomb_friction"),
)


def _suits(effect: str, machine: str) -> bool:
    build = BUILDS[DRIVES[machine].preset]
    bodies = len(build.bodies)
    if effect == "backlash":
        return bodies == 2
    if effect == "compliance":
        return bodies == 1
    if effect == "imbalance":
        return build.unit == "rad"
    return True


def realistic(wanted: Callable[[str], bool] = lambda _: True) -> Iterator[Case]:
    """All realistic cases whose id is wanted."""
    hidden = [((effect,), SINGLE_CASES) for effect in RULES]
    for effects, count in (*hidden, *((pair, DOUBLE_CASES) for pair in PAIRS), ((), CLEAN_CASES)):
        name = "+".join(effects) or "none"
        for index in range(count):
            # one number decides all, so that a case stays what it is when the list grows
            random = np.random.default_rng(zlib.crc32(f"realistic/{name}/{index}".encode()))
            machine = str(random.choice([m for m in sorted(DRIVES) if all(_suits(effect, m) for effect in effects)]))
            case_id = f"realistic/{name}/{machine}/{index}"
            if wanted(case_id):
                yield _case(case_id, effects, machine, random)


def _case(case_id: str, effects: tuple[str, ...], machine: str, random: np.random.Generator) -> Case:
    kind, build = DRIVES[machine], BUILDS[DRIVES[machine].preset]
    # a slide has an end; a loop that is slow beside a resonance seldom shows it
    loop = "closed" if build.unit == "m" or random.random() < (0.2 if "compliance" in effects else 0.6) else "open"
    rate = float(random.choice(kind.rates))
    seconds = MOST_SAMPLES[len(build.bodies)] / rate
    bags = min(int(random.integers(1, 5)), int(seconds / SHORTEST))
    duration = float(int(random.uniform(SHORTEST, min(seconds / bags, LONGEST))))
    training = _drives(effects, loop, bags, random)
    unseen = [drive for drive in _KINDS[loop] if drive not in {own.kind for own in training}]
    size = sizes(machine, loop, training[0])
    hidden, shares = [], [USUAL]
    for effect in effects:
        share = float(np.exp(random.uniform(np.log(0.05), np.log(0.4 if len(effects) == 1 else 0.25))))
        site = Site(kind, base_model(machine, rate, loop), loop, size, rate, share, random)
        at, values = RULES[effect](site)
        exact = ("harmonic",)
        # along a length a wave has a pitch, not a number within the turn
        name = "periodic_force" if "period" in values else effect
        hidden.append(Hidden(name, at, {k: v if k in exact else float(f"{v:.3g}") for k, v in values.items()}))
        if effect not in _BY_THEIR_OWN:
            shares.append(share)
    return Case(
        id=case_id,
        category="realistic",
        machine=machine,
        simulator="drive",
        hidden=tuple(hidden),
        training=training,
        validation=Drive(str(random.choice(unseen)), 0.85),
        loop=loop,
        rate=rate,
        duration=duration,
        disturbance=Disturbance("ar", 0.005) if random.random() < 0.5 else Disturbance(),
        noise=Noise(told=False),
        nuisances=_nuisances(machine, loop, rate, size, SMALL * min(shares), random),
    )


def _drives(effects: tuple[str, ...], loop: str, bags: int, random: np.random.Generator) -> tuple[Drive, ...]:
    """For each effect a recording that shows it, then any."""
    first = [str(random.choice(_SHOWN_BY[effect][loop])) for effect in effects]
    more = [str(random.choice(_KINDS[loop])) for _ in range(bags)]
    kinds = (first + more)[:bags]
    return tuple(Drive(kind, level) for kind, level in zip(kinds, LEVELS, strict=False))


def _nuisances(
    machine: str, loop: str, rate: float, size: Sizes, most: float, random: np.random.Generator
) -> Nuisances:
    """The small things of a drive, none of them above a share of the drive's force."""
    build = BUILDS[DRIVES[machine].preset]

    def small(low: float, high: float) -> float:
        return min(float(random.uniform(low, high)), most)

    fastest = 2.0 * math.pi * 0.2 * rate / size.speed
    if build.unit == "rad":
        harmonics = [float(random.integers(2, 25)) for _ in range(3)]
    else:
        harmonics = [2.0 * math.pi / float(random.uniform(0.01, 0.08)) for _ in range(3)]
    ripple = small(0.005, 0.02) * size.force
    encoders = {output.body for output in base_model(machine, rate, loop).outputs}
    command = size.command_peak if loop == "open" else 3.0 * build.command
    return Nuisances(
        friction=small(0.01, 0.03) * size.force,
        break_away=float(random.uniform(1.02, 1.1)),
        stribeck_speed=float(random.uniform(0.02, 0.1)) * size.speed,
        reach=float(random.uniform(0.3, 5.0)) * build.bodies[0][3],
        counts=tuple(count if name in encoders else 0.0 for name, _, _, count in build.bodies),
        velocity_filter=float(random.choice([0.0, 1.0, 2.0])) / rate,
        current_loop=float(np.exp(random.uniform(np.log(200.0), np.log(1000.0)))),
        delay=float(random.uniform(1e-4, 5e-4)),
        limit=float(random.uniform(0.8 if loop == "closed" else 1.05, 1.5)) * command,
        supply_ripple=small(0.01, 0.05),
        tick_jitter=float(random.uniform(0.002, 0.03)),
        late_ticks=float(random.choice([0.0, 0.0, 0.002])),
        stamp_jitter=float(random.uniform(0.005, 0.05)),
        torque_ripple=tuple(
            (part * ripple, min(harmonic, fastest), float(random.uniform(-math.pi, math.pi)))
            for part, harmonic in zip((1.0, 0.6, 0.4), harmonics, strict=True)
        ),
        ripple_with_current=small(0.002, 0.02),
        unexplained=small(0.01, 0.04) * size.force,
        wave=float(random.uniform(0.5, 2.0)) / size.stroke,
        phase=float(random.uniform(-math.pi, math.pi)),
        warming=float(random.uniform(0.3, 1.0)),
        warm_up=float(random.uniform(5.0, 30.0)),
        unexplained_speed=0.2 * size.speed,
    )
