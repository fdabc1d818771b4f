"""The list of all cases. Every choice comes from the case's id, so the list never depends on a run.

python benchmarks/diagnosis/cases.py            # how many there are, by category and condition
python benchmarks/diagnosis/cases.py --list     # one line each
"""

from __future__ import annotations

import argparse
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import lru_cache, partial

import numpy as np
from case import Case, Disturbance, Drive, Hidden, Noise
from machines import MACHINES
from plan import DOUBLES, SINGLES, TRIPLES
from realistic import realistic
from strengths import STRENGTHS, hidden
from traps import TRAPS

# Half of the simulations share nothing with idloop.
SIMULATORS = ("idloop", "mujoco", "idloop", "equations")
# Most samples of all training recordings of a case together, with one body and with four; shortest recording [s].
MOST_SAMPLES, MOST_SAMPLES_OF_FOUR, SHORTEST = 12000, 6000, 6.0
CLEAN_PER_KIND = 28
SHARES = (0.005, 0.01, 0.02, 0.05)

_DURATIONS = {100.0: (30.0, 60.0), 200.0: (15.0, 30.0), 250.0: (15.0, 30.0), 500.0: (12.0, 25.0), 1000.0: (10.0, 16.0)}


def _number(text: str) -> int:
    """A number that belongs to a text: what it decides stays when the list grows."""
    return zlib.crc32(text.encode())


def _random(text: str) -> np.random.Generator:
    return np.random.default_rng(_number(text))


def _rate_and_duration(machine: str, random: np.random.Generator, bags: int, longest: float) -> tuple[float, float]:
    rate = float(random.choice(MACHINES[machine].rates))
    low, high = _DURATIONS[rate]
    duration = float(random.uniform(low, high))
    # four bodies make a sample four times as dear
    budget = MOST_SAMPLES_OF_FOUR if machine.startswith(("torsion", "lead_screw")) else MOST_SAMPLES
    duration = min(duration, longest, budget / (rate * bags))
    return rate, float(round(max(duration, SHORTEST)))


def _disturbed(random: np.random.Generator) -> Disturbance:
    kind = str(random.choice(["none", "none", "white", "walk", "ar", "ar"]))
    return Disturbance(kind, 0.0 if kind == "none" else float(random.choice(SHARES)))


def _noise(random: np.random.Generator) -> Noise:
    kind = "ar" if random.random() < 0.15 else "white"
    return Noise(kind, float(random.choice([0.3, 1.0, 1.0, 2.0])), bool(random.random() < 0.7))


def _levels(random: np.random.Generator) -> tuple[float, ...]:
    """Levels of the training recordings: one, two or three of them."""
    bags = int(random.choice([1, 1, 2, 2, 3]))
    return (1.0, 0.5, 0.75)[:bags]


def _assembled(
    case_id: str,
    category: str,
    machine: str,
    effects: tuple[tuple[str, str], ...],
    loops: tuple[tuple[str, ...], tuple[str, ...]],
    loop: str,
    strengths: tuple[str, ...],
    simulator: str,
) -> Case:
    random = _random(case_id)
    kind = str(random.choice(loops[0] if loop == "open" else loops[1]))
    levels = _levels(random)
    rate, duration = _rate_and_duration(machine, random, len(levels), 60.0)
    drives = tuple(Drive(kind, level) for level in levels)
    items: list[Hidden] = []
    for (effect, at), strength in zip(effects, strengths, strict=True):
        seed = int(random.integers(1 << 31))
        items.append(hidden(effect, at, machine, loop, drives[0], rate, strength, seed, items))
    return Case(
        id=case_id,
        category=category,
        machine=machine,
        simulator=simulator,
        hidden=tuple(items),
        training=drives,
        validation=Drive(kind, 0.85),
        loop=loop,
        rate=rate,
        duration=duration,
        disturbance=_disturbed(random),
        noise=_noise(random),
        strength=strengths[0] if len(set(strengths)) == 1 else "mixed",
    )


def _every(_case_id: str) -> bool:
    return True


def singles(wanted: Callable[[str], bool] = _every) -> Iterator[Case]:
    """One hidden effect: every row of the plan at every strength."""
    for row in SINGLES:
        number = _number(f"{row.effect}/{row.machine}/{row.at}")
        for index, strength in enumerate(STRENGTHS):
            loop = ("open", "closed")[(number + index) % 2]
            case_id = f"single/{row.effect}/{row.machine}/{row.at}/{strength}"
            if not wanted(case_id):
                continue
            simulator = SIMULATORS[(number + index) % 4] if index % 2 else SIMULATORS[(number + index + 1) % 4]
            yield _assembled(
                case_id,
                "single",
                row.machine,
                ((row.effect, row.at),),
                (row.open, row.closed),
                loop,
                (strength,),
                simulator,
            )


def several(category: str, wanted: Callable[[str], bool] = _every) -> Iterator[Case]:
    """Two or three hidden effects, three cases of each combination."""
    plan = DOUBLES if category == "double" else TRIPLES
    for machine, effects, loops in plan:
        name = "+".join(effect for effect, _ in effects)
        number = _number(f"{name}/{machine}")
        for index in range(3):
            case_id = f"{category}/{name}/{machine}/{index}"
            if not wanted(case_id):
                continue
            random = _random(case_id + "/strength")
            mix = ("weak", "clear", "clear", "dominant")
            strengths = tuple(str(random.choice(mix)) for _ in effects)
            yield _assembled(
                case_id,
                category,
                machine,
                effects,
                loops,
                ("open", "closed")[(number + index) % 2],
                strengths,
                SIMULATORS[(number + index) % 4],
            )


_CLEAN = {
    # condition: disturbances, kind of noise, quantised
    "quiet": (("none",), "white", False),
    "white": (("white",), "white", False),
    "walk": (("walk",), "white", False),
    "quantised": (("none", "white"), "white", True),
    "ar_torque": (("ar",), "white", False),
    "ar_torque_quantised": (("ar",), "white", True),
    "ar_noise": (("none", "white"), "ar", False),
    "ar_both": (("ar",), "ar", False),
}
_CLEAN_MACHINES = ("axis", "dc_motor", "axis_position", "torsion", "dc_position", "lead_screw", "axis")
_CLEAN_DRIVES = (
    ("multilevel", "multisine", "chirp", "slow_sines", "plateaus", "coast"),
    ("moves", "slow_moves", "reference_sines", "reference_steps", "speeds"),
)


def clean() -> Iterator[Case]:
    """Nothing hidden, short recordings; half of the cases with coloured disturbance or noise."""
    for place, (condition, (kinds, noise, quantised)) in enumerate(_CLEAN.items()):
        for index in range(CLEAN_PER_KIND):
            machine = _CLEAN_MACHINES[index % len(_CLEAN_MACHINES)]
            case_id = f"clean/{condition}/{machine}/{index}"
            random = _random(case_id)
            loop = ("open", "closed")[(index // len(_CLEAN_MACHINES) + place) % 2]
            drive = str(random.choice(_CLEAN_DRIVES[loop == "closed"]))
            levels = (1.0, 0.5)[: int(random.integers(1, 3))]
            rate, duration = _rate_and_duration(machine, random, len(levels), 20.0)
            kind = str(random.choice(kinds))
            share = 0.0 if kind == "none" else float(random.choice(SHARES))
            factor = float(random.choice([0.3, 1.0, 2.0]))
            case = Case(
                id=case_id,
                category="clean",
                machine=machine,
                simulator=SIMULATORS[(index + index // 4 + place) % 4],
                hidden=(),
                training=tuple(Drive(drive, level) for level in levels),
                validation=Drive(drive, 0.85),
                loop=loop,
                rate=rate,
                duration=duration,
                disturbance=Disturbance(kind, share),
                noise=Noise(noise, factor, bool(random.random() < 0.7)),
            )
            yield replace(case, quantisation=_encoder(case, random)) if quantised else case


def _encoder(case: Case, random: np.random.Generator) -> dict[str, float]:
    """Resolution of the position sensors, of the size of their noise."""
    from machines import base_model

    steps = float(random.choice([0.5, 1.0, 2.0]))
    model = base_model(case.machine, case.rate, case.loop)
    return {o.site: float(f"{steps * case.noise.factor * o.noise:.3g}") for o in model.outputs if o.field == "position"}


def untestable(wanted: Callable[[str], bool] = _every) -> Iterator[Case]:
    """Effects behind an excitation that cannot show them."""
    for trap in TRAPS:
        number = _number(f"{trap.effect}/{trap.machine}/{trap.drive}")
        for index, strength in enumerate(trap.strengths):
            case_id = f"untestable/{trap.effect}/{trap.machine}/{trap.drive}/{strength}"
            if not wanted(case_id):
                continue
            case = _assembled(
                case_id,
                "untestable",
                trap.machine,
                ((trap.effect, trap.at),),
                ((trap.drive,), (trap.drive,)),
                trap.loop,
                (strength,),
                SIMULATORS[(number + index) % 4],
            )
            item = case.hidden[0]
            scaled = {k: v * (trap.scale or {}).get(k, 1.0) for k, v in item.values.items()}
            item = replace(item, values={**scaled, **(trap.values or {})})
            # one level only: a second one would show what the first hides
            drive = Drive(trap.drive, 1.0)
            yield replace(case, hidden=(item,), training=(drive,), validation=drive, trap=trap.why)


_PARTS: tuple[Callable[[Callable[[str], bool]], Iterator[Case]], ...] = (
    lambda _: clean(),
    singles,
    partial(several, "double"),
    partial(several, "triple"),
    untestable,
    realistic,
)


def cases_of(wanted: Callable[[str], bool]) -> tuple[Case, ...]:
    """The cases whose id is wanted: strengths are shares of what a machine does, and no other machine is run for them.

    Raises
    ------
    ValueError
        Two cases have one id.
    """
    found = [case for part in _PARTS for case in part(wanted) if wanted(case.id)]
    ids = [case.id for case in found]
    if len(set(ids)) < len(ids):
        raise ValueError("two cases have one id")
    # in the order of a hash, so that the first cases of any number are a fair sample
    return tuple(sorted(found, key=lambda case: zlib.crc32(case.id[::-1].encode())))


@lru_cache(maxsize=1)
def all_cases() -> tuple[Case, ...]:
    """Every case of the suite, in an order that mixes categories."""
    return cases_of(_every)


def main() -> None:
    """Count the cases, or list them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--list", action="store_true", help="one line per case")
    arguments = parser.parse_args()
    cases = all_cases()
    if arguments.list:
        for case in cases:
            values = "; ".join(f"{h.name} {dict(h.values)}" for h in case.hidden)
            print(
                f"{case.id}  {case.simulator} {case.loop} {'+'.join(d.kind for d in case.training)} {case.rate:g} Hz"
                f" {case.duration:g} s  torque {case.disturbance.kind} {case.disturbance.share:g}"
                f"  noise {case.noise.kind} x{case.noise.factor:g}  {values}"
            )
        return
    print(f"{len(cases)} cases, {sum(case.simulator != 'idloop' for case in cases)} by foreign simulators")
    for title, key in (
        ("category", lambda case: case.category),
        ("simulator", lambda case: case.simulator),
        ("loop", lambda case: case.loop),
        ("machine", lambda case: case.machine),
        ("disturbance", lambda case: case.disturbance.kind),
        ("noise", lambda case: case.noise.kind),
        ("strength", lambda case: case.strength or "-"),
    ):
        print(f"{title:12}", ", ".join(f"{name} {count}" for name, count in sorted(Counter(map(key, cases)).items())))


if __name__ == "__main__":
    main()
