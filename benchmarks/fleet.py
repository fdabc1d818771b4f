"""A fleet of simulated robots: what `idloop fleet` finds of what was planted, and how fast.

Every joint is of one of two kinds and has parameters of its own; its viscous friction wanders from day to day, as with
the temperature. Planted are five odd units (dry friction 60 % above their kind's), wear (dry friction of some joints
grows by 40 % over the days), and one change of firmware (a drive gain of all joints of one kind that is 3 % less from
the middle of the days on). Some bags are missing, some are broken.

    python benchmarks/fleet.py                                       # 200 robots, 6 joints, 30 days: about an hour
    python benchmarks/fleet.py --robots 20 --days 10                 # minutes
    python benchmarks/fleet.py --robots 8 --days 4 --scaling         # one worker beside two
    python benchmarks/fleet.py --robots 30 --statistics 200          # many fleets of estimates, without recordings
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import resource
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
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
ERRORS = {"inertia": 0.0018, "viscous": 0.006, "dry": 0.0035}  # of the fits of such records, as shares
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


def models() -> dict[str, Any]:
    """Model of each kind by the pattern of its joints' names, for six joints or two."""
    from idloop.physics.model_file import from_text

    return {kind: from_text(text, None) for kind, text in KINDS.items()}


def write_table(folder: Path, fleet: Fleet) -> Path:
    """Write the table of all joints and days, missing bags included."""
    lines = ["robot,joint,time,bag,kind"]
    for robot in range(fleet.robots):
        for day in range(fleet.days):
            date = f"{START + timedelta(days=day):%Y-%m-%d}"
            name = robot_name(robot)
            lines += [f"{name},j{joint},{date},{name}/{date},{fleet.kind(joint)}" for joint in range(fleet.joints)]
    table = folder / "fleet.csv"
    table.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return table


def make(folder: Path, fleet: Fleet) -> Path:
    """Simulate the fleet with two processes; return its table."""
    with ProcessPoolExecutor(2) as pool:
        list(pool.map(write_robot, *zip(*((folder, fleet, robot) for robot in range(fleet.robots)), strict=True)))
    return write_table(folder, fleet)


class Memory:
    """Largest resident memory of any child process, looked at every second."""

    def __init__(self) -> None:
        self.largest = 0
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._look, daemon=True)

    def _look(self) -> None:
        import psutil

        while not self._ended.wait(1.0):
            for child in psutil.Process().children(recursive=True):
                with contextlib.suppress(psutil.Error):
                    self.largest = max(self.largest, child.memory_info().rss)

    def __enter__(self) -> Memory:  # noqa: PYI034 - Self needs Python 3.11
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()


def processor_time() -> float:
    """Processor time of this process and of its children that have ended [s]."""
    return sum(sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))


def judge(fleet: Fleet, findings: Sequence[Any], periods: Sequence[Any] = ()) -> dict[str, Any]:
    """Count what was found of what was planted, and what was found beside it, each with its 95 % interval."""
    from interval_coverage import binomial_interval

    planted_units = {(robot_name(robot), f"j{joint}") for robot, joint in (*fleet.odd, *fleet.worn)}

    def units(which: Sequence[tuple[int, int]], *what: str) -> int:
        named = {(one.robot, one.joint) for one in findings if one.what in what}
        return sum((robot_name(robot), f"j{joint}") in named for robot, joint in which)

    true_kind = [one for one in findings if not one.robot and one.kind == "base"]
    false = [
        one
        for one in findings
        if (one.robot and (one.robot, one.joint) not in planted_units) or (not one.robot and one.kind != "base")
    ]
    day = None if fleet.changed is None else (START + timedelta(days=fleet.changed)).timestamp() // 86400
    firmware = [one for one in true_kind if one.what == "step" and abs(one.day - day) <= 1]
    counts = {
        "odd units found": (units(fleet.odd, "odd"), len(fleet.odd)),
        "wear found": (units(fleet.worn, "trend", "step"), len(fleet.worn)),
        "firmware found at its date": (min(len(firmware), 1), int(fleet.changed is not None)),
        "false among what is listed": (len(false), len(findings)),
        "false among the joints that changed since the firmware": (
            sum((one.robot, one.joint) not in planted_units for one in periods if one.robot),
            sum(bool(one.robot) for one in periods),
        ),
    }
    return {
        name: {"count": count, "of": of, "interval": binomial_interval(count, of) if of else None}
        for name, (count, of) in counts.items()
    }


def estimates(fleet: Fleet, tails: float) -> list[Any]:
    """Series of a fleet as the fits of its recordings would give them; `tails`: degrees of freedom of their errors."""
    from idloop.fleet.joint_day import FORCE_ERROR
    from idloop.fleet.statistics import Series

    rng = np.random.default_rng([fleet.seed, 3])
    days = np.arange(fleet.days) + START.timestamp() // 86400
    lost = rng.uniform(size=(fleet.robots, fleet.days)) < fleet.missing + fleet.broken
    warmth = 0.05 * rng.normal(size=lost.shape)
    found = []
    for kind, model in models().items():
        units = [one for one in fleet.units() if fleet.kind(one[1]) == kind]
        names = tuple((robot_name(robot), f"j{joint}") for robot, joint in units)
        robot, size = [one for one, _ in units], (len(units), fleet.days)
        odd, worn = (np.array([[one in several] for one in units]) for several in (fleet.odd, fleet.worn))
        gain = 1.0 - FIRMWARE * ((np.arange(fleet.days) >= (fleet.changed or fleet.days)) & (kind == "base"))
        shares = {
            "inertia": 0.03 * rng.normal(size=(len(units), 1)),
            "viscous": 0.1 * rng.normal(size=(len(units), 1)) + warmth[robot] + 0.03 * rng.normal(size=size),
            "dry": 0.1 * rng.normal(size=(len(units), 1)) + 0.02 * rng.normal(size=size) + ODD * odd
            + WEAR * worn * np.arange(fleet.days) / (fleet.days - 1),
        }  # fmt: skip
        for key, share in shares.items():
            value = model.values[NAMES[key]]
            error = ERRORS[key] * value * rng.uniform(0.7, 1.5, size=size)
            y = value * (1.0 + share) / gain + error * rng.standard_t(tails, size=size)
            found.append(Series(kind, NAMES[key], "", names, days, np.where(lost[robot], np.nan, y), error**2, 0.0))
        y = np.log(0.01) + 0.2 * rng.normal(size=(len(units), 1)) + 0.15 * rng.standard_t(tails, size=size)
        found.append(Series(kind, FORCE_ERROR, "1", names, days, np.where(lost[robot], np.nan, y), np.zeros(size)))
    return found


def judge_statistics(fleet: Fleet, tails: float) -> dict[str, tuple[int, int]]:
    """Of the estimates of one fleet: what is found of what was planted, and what is false of what is listed."""
    from idloop.fleet.joint_day import FORCE_ERROR
    from idloop.fleet.statistics import Hypotheses, between_periods, take_apart

    parts = [take_apart(one) for one in estimates(fleet, tails)]
    tests, changes = Hypotheses(), Hypotheses()
    for one in parts:
        tests.test(one)
        since = one.series.days[0] + (fleet.changed or 0)
        several = [found for which in between_periods(one, since, None) for found in which]
        changes.add(np.array([found.p_value for found in several]), several.__getitem__)
    odd, worn = ({(robot_name(robot), f"j{joint}") for robot, joint in one} for one in (fleet.odd, fleet.worn))

    def true(found: Any) -> bool:
        unit = found.robot, found.joint
        if not found.robot:
            return bool(found.kind == "base" and found.parameter != FORCE_ERROR)
        # The gain changes what a joint has: that of an odd one more than that of its kind.
        several = odd | worn if found.what in {"odd", "beyond"} else worn
        return bool(found.what != "day" and found.parameter == NAMES["dry"] and unit in several)

    groups = {
        "odd": ("odd",), "trend or step": ("trend", "step"), "day": ("day",), "since the date": ("period", "beyond"),
    }  # fmt: skip
    listed = [*tests.found(), *changes.found()]
    counts = {}
    for name, what in groups.items():
        own = [one for one in listed if one.what in what]
        counts[f"false: {name}, joints"] = (
            sum(not true(one) for one in own if one.robot),
            sum(bool(one.robot) for one in own),
        )
        counts[f"false: {name}, all"] = sum(not true(one) for one in own), len(own)
    for name, which, what in (("odd", odd, ("odd",)), ("wear", worn, ("trend", "step"))):
        counts[f"found: {name}"] = len(which & {(o.robot, o.joint) for o in listed if o.what in what}), len(which)
    steps = [one for one in listed if one.what == "step" and not one.robot and true(one)]
    counts["found: firmware at its date"] = any(abs(one.day - since) <= 1.0 for one in steps), 1
    return counts


def statistics(arguments: argparse.Namespace) -> dict[str, Any]:
    """Count over many fleets of estimates: sums, and the mean share of each fleet with its 95 % interval."""
    found = {}
    for words, tails in (("normal errors", 1e6), ("errors by Student's t of 4", 4.0)):
        shares: dict[str, list[tuple[int, int]]] = {}
        for seed in range(arguments.seed, arguments.seed + arguments.statistics):
            fleet = planted(arguments.robots, arguments.joints, arguments.days, seed)
            for name, one in judge_statistics(fleet, tails).items():
                shares.setdefault(name, []).append(one)
        for name, several in shares.items():
            each = np.array([count / max(of, 1) for count, of in several])
            reach = 1.96 * np.std(each) / np.sqrt(len(each))
            count, of = np.sum(several, axis=0).tolist()
            mean = [float(np.mean(each)), float(np.mean(each) - reach), float(np.mean(each) + reach)]
            found[f"{words}; {name}"] = {"count": count, "of": of, "mean share of a fleet": mean}
    return found


def timed(bag: Any, settings: Any) -> tuple[float, float, int]:
    """Seconds and seconds of the processor that a worker takes for a recording, and joints that it identifies."""
    from idloop.fleet.joint_day import identify_bag

    begun, used = time.perf_counter(), time.process_time()
    rows = identify_bag(bag, settings) or []
    joints = {row["joint"] for row in rows if row.get("parameter")}
    return time.perf_counter() - begun, time.process_time() - used, len(joints)


def scaling(table: Path) -> dict[str, float]:
    """Joint-days a second of one worker and of two, after a first recording on each, and the share of time they work.

    The ratio needs idle cores; where workers work all the time, nothing but the cores limits them.
    """
    from idloop.fleet.bags import find_bags
    from idloop.fleet.engine import Workers
    from idloop.fleet.joint_day import Settings

    settings, bags = Settings(tuple(models().items())), find_bags(str(table))
    rates = {}
    for count in (1, 2):
        with Workers(count) as workers:
            ways: dict[str, Any] = {"size": 1, "lost": lambda one: None}
            list(workers.map(timed, bags[: 2 * count], settings, **ways))
            begun = time.perf_counter()
            several = [one for _, found in workers.map(timed, bags, settings, **ways) for one in found]
            wall = time.perf_counter() - begun
        busy, used, joints = (sum(column) for column in zip(*several, strict=True))
        rates |= {
            f"{count} workers": joints / wall, f"{count} workers, busy": busy / (count * wall),
            f"{count} workers, processor time a joint-day [s]": used / joints,
        }  # fmt: skip
    return rates | {"ratio": rates["2 workers"] / rates["1 workers"], "load": os.getloadavg()[0]}


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Simulate, identify and judge."""
    import idloop

    fleet = planted(arguments.robots, arguments.joints, arguments.days, arguments.seed)
    table = make(folder, fleet)
    if arguments.scaling:
        return scaling(table)
    before, begun = processor_time(), time.perf_counter()
    since = str((START + timedelta(days=fleet.changed or 0)).date())
    with Memory() as memory:
        found = idloop.identify_fleet(
            table, models(), folder / "out", workers=arguments.workers, diagnose=0, since=since,
            progress=lambda share, text: print(f"\r{100 * share:5.1f} % {text}   ", end="", file=sys.stderr),
        )  # fmt: skip
    wall, used = time.perf_counter() - begun, processor_time() - before
    found.save()
    days = max(found.joint_days, 1)
    size = sum(file.stat().st_size for file in (folder / "out" / "rows").iterdir())
    again = time.perf_counter()
    idloop.identify_fleet(table, models(), folder / "out", workers=arguments.workers, diagnose=0)
    return {
        "joint-days": found.joint_days, "recordings": found.bags, "not identified": len(found.failed),
        "tests": found.tests, **judge(fleet, found.findings, found.periods),
        "change of the firmware": [
            {"parameter": one.parameter, "size": one.size, "interval": [one.low, one.high]}
            for one in found.periods if not one.robot and one.kind == "base"
        ],
        "wall time [s]": wall, "processor time a joint-day, all included [s]": used / days,
        "largest memory of a worker [MB]": memory.largest / 1e6, "bytes of results a joint-day": size / days,
        "the same again [s]": time.perf_counter() - again,
        "10^6 joint-days": {"processor hours": 1e6 * used / days / 3600.0, "results [GB]": size / days / 1e3},
        "load": os.getloadavg()[0],
    }  # fmt: skip


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", type=int, default=200)
    parser.add_argument("--joints", type=int, default=6)
    parser.add_argument("--days", type=int, default=30)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--scaling", action="store_true", help="one worker beside two")
    parser.add_argument("--folder", type=Path, help="keep bags and results here; what is there is not made again")
    parser.add_argument("--statistics", type=int, metavar="FLEETS", help="so many fleets of estimates alone")
    arguments = parser.parse_args()
    if arguments.statistics:
        print(json.dumps(statistics(arguments), indent=2))
        return
    place = contextlib.nullcontext(arguments.folder) if arguments.folder else tempfile.TemporaryDirectory()
    with place as folder:
        Path(folder).mkdir(parents=True, exist_ok=True)
        print(json.dumps(run(arguments, Path(folder)), indent=2))


if __name__ == "__main__":
    main()
