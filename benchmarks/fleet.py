"""A fleet of simulated robots: what `idloop fleet` finds of what was planted, and how fast.

Every joint is of one of two kinds and has parameters of its own; its viscous friction wanders from day to day, as with
the temperature. Planted are five odd units (dry friction 60 % above their kind's), wear (dry friction of some joints
grows by 40 % over the days), and one change of firmware (a drive gain of all joints of one kind that is 3 % less from
the middle of the days on). Some bags are missing, some are broken.

    python benchmarks/fleet.py                                       # 200 robots, 6 joints, 30 days: about an hour
    python benchmarks/fleet.py --robots 20 --days 10                 # minutes
    python benchmarks/fleet.py --robots 8 --days 4 --scaling         # one worker beside two
"""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from datetime import datetime, timedelta, timezone
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

START = datetime(2026, 3, 1, 6, tzinfo=timezone.utc)
SAMPLE_TIME, SECONDS = 0.004, 10.0
FORCES = {"base": 6.0, "wrist": 1.5}  # amplitude of the command by kind [N·m]
ODD, WEAR, FIRMWARE = 0.6, 0.4, 0.03  # planted changes, as shares
KIND = """
schema: idloop/model/1
name: {kind}
input: {{topic: joint_command, joint: axis, field: effort, unit: N·m}}
outputs:
  - {{topic: joint_states, joint: axis, field: position, unit: rad, noise: 0.0002}}
  - {{topic: joint_states, joint: axis, field: velocity, unit: rad/s, noise: 0.004}}
bodies:
  - {{name: axis, inertia: {{value: {inertia}, min: 0.0}}, viscous_friction: {{value: {viscous}, min: 0.0}}}}
drive: {{gain: 1.0}}
effects:
  - {{effect: coulomb_friction, at: axis, level: {{value: {dry}, min: 0.0}}}}
"""
KINDS = {
    "base": KIND.format(kind="base", inertia=0.08, viscous=0.4, dry=0.6),
    "wrist": KIND.format(kind="wrist", inertia=0.01, viscous=0.05, dry=0.15),
}
NAMES = {"viscous": "axis.viscous_friction", "dry": "coulomb_friction@axis.level", "inertia": "axis.inertia"}


@dataclass(frozen=True)
class Fleet:
    """What is simulated, and what is planted.

    Attributes
    ----------
    odd, worn : tuple of (int, int)
        Robot and joint of the odd units and of those that wear.
    changed : int or None
        First day of the new firmware.
    """

    robots: int = 200
    joints: int = 6
    days: int = 30
    seed: int = 0
    odd: tuple[tuple[int, int], ...] = ()
    worn: tuple[tuple[int, int], ...] = ()
    changed: int | None = None
    missing: float = 0.01
    broken: float = 0.01
    kinds: dict[int, str] = field(default_factory=dict)

    def kind(self, joint: int) -> str:
        """Kind of a joint: the first half of a robot's joints are of its base."""
        return "base" if joint < (self.joints + 1) // 2 else "wrist"

    def units(self) -> list[tuple[int, int]]:
        """Robot and joint of every unit."""
        return [(robot, joint) for robot in range(self.robots) for joint in range(self.joints)]


def planted(robots: int, joints: int, days: int, seed: int = 0, *, odd: int = 5, worn: int | None = None) -> Fleet:
    """Choose which units are odd and which wear (one in forty where not stated), and when the firmware changes."""
    fleet = Fleet(robots, joints, days, seed)
    units = fleet.units()
    count = max(len(units) // 40, 1) if worn is None else worn
    chosen = [units[k] for k in np.random.default_rng(seed).permutation(len(units))[: odd + count]]
    return Fleet(robots, joints, days, seed, tuple(chosen[:odd]), tuple(chosen[odd:]), days // 2)


def robot_name(robot: int) -> str:
    """Name of a robot."""
    return f"robot{robot:03d}"


def write_robot(folder: Path, fleet: Fleet, robot: int, days: range | None = None) -> None:
    """Simulate a robot and write its bags as FOLDER/ROBOT/DATE; some are missing, some cut off."""
    import idloop
    from idloop.physics.model_file import from_text
    from idloop.records import make_stream, write_bag

    count = round(SECONDS / SAMPLE_TIME)
    models = {kind: from_text(text, None) for kind, text in KINDS.items()}
    # What a unit is, whatever days are asked for.
    unit = np.random.default_rng([fleet.seed, robot, 1]).normal(size=(fleet.joints, 3)) * [0.03, 0.1, 0.1]
    for day in days or range(fleet.days):
        rng = np.random.default_rng([fleet.seed, robot, day, 2])
        bag = folder / robot_name(robot) / f"{START + timedelta(days=day):%Y-%m-%d}"
        lost = rng.uniform()
        if lost < fleet.missing or bag.exists():
            continue
        warmth = 0.05 * rng.normal()
        command: dict[str, Any] = {}
        measured: dict[str, Any] = {}
        for joint in range(fleet.joints):
            kind = fleet.kind(joint)
            model, force = models[kind], FORCES[kind]
            share = {"inertia": unit[joint, 0], "viscous": unit[joint, 1] + warmth + 0.03 * rng.normal()}
            share["dry"] = unit[joint, 2] + 0.02 * rng.normal()
            values = {NAMES[key]: model.values[NAMES[key]] * (1.0 + one) for key, one in share.items()}
            dry = NAMES["dry"]
            values[dry] += model.values[dry] * ODD * ((robot, joint) in fleet.odd)
            values[dry] += model.values[dry] * WEAR * ((robot, joint) in fleet.worn) * day / max(fleet.days - 1, 1)
            if fleet.changed is not None and day >= fleet.changed and kind == "base":
                values["drive.gain"] = 1.0 - FIRMWARE
            signal = idloop.excitation(
                "multisine", sample_time=SAMPLE_TIME, duration=SECONDS, amplitude=force, seed=int(rng.integers(2**31))
            )
            machine = model.with_values(values)
            record = idloop.simulate(machine, signal, seed=int(rng.integers(2**31)))
            command[f"j{joint}"] = {"effort": record.input}
            measured[f"j{joint}"] = {"position": record.output[:, 0], "velocity": record.output[:, 1]}
        begin = int((START + timedelta(days=day)).timestamp() * 1e9)
        stamps = begin + (np.arange(count) * SAMPLE_TIME * 1e9).astype(np.int64)
        bag.parent.mkdir(parents=True, exist_ok=True)
        write_bag(bag, [make_stream("joint_command", stamps, command), make_stream("joint_states", stamps, measured)])
        if lost > 1.0 - fleet.broken:
            (file,) = bag.glob("*.mcap")
            file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])


def write_models(folder: Path) -> list[str]:
    """Write the model of each kind; return the arguments of `idloop fleet` for joints by name."""
    for kind, text in KINDS.items():
        (folder / f"{kind}.yaml").write_text(text, encoding="utf-8")
    return []
