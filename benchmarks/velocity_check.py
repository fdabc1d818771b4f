"""How often a good velocity is told to be wrong, and a wrong one is found.

Axes with inertia and friction under many commands, open and in a loop, with velocities as drives and drivers give them,
and with columns that are none. Prints a row for each kind: told wrong, of how many.

    .venv/bin/python benchmarks/velocity_check.py [--runs 60]
"""

from __future__ import annotations

import argparse
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from idloop.records.inspection.velocity_check import velocity_slope

Floats = NDArray[np.float64]
Random = np.random.Generator
Column = Callable[[Random, Floats, Floats, Floats], Floats]

_FINE = 5  # steps of the simulation in a sample


def motion(random: Random, kind: str) -> tuple[Floats, Floats, Floats]:
    """Time, position and velocity of an axis, shape (n,): each kind at a rate and of a length of its own."""
    rate = float(random.choice([50.0, 100.0, 200.0, 1000.0]))
    count = int(rate * random.uniform(4.0, 30.0))
    fine = np.arange(count * _FINE) / (rate * _FINE)
    lag = float(10.0 ** random.uniform(-1.5, 0.0))
    top = random.uniform(0.5, 3.0)
    if kind == "steps":
        hold = int(random.uniform(0.2, 1.5) * rate * _FINE)
        command = np.repeat(random.normal(size=fine.size // hold + 1), hold)[: fine.size]
    elif kind == "sines":
        phases = random.uniform(0.0, 2.0 * np.pi, size=8)
        command = np.sum([np.sin(2 * np.pi * top * (k + 1) / 8 * fine + a) for k, a in enumerate(phases)], axis=0)
    elif kind == "sine":
        command = np.sin(2 * np.pi * top * fine)
    elif kind == "sweep":
        command = np.sin(2 * np.pi * (0.1 + 0.5 * (2.0 * top) * fine / fine[-1]) * fine)
    elif kind == "one way":
        hold = int(random.uniform(0.5, 2.0) * rate * _FINE)
        command = np.repeat(random.uniform(0.5, 3.0, size=fine.size // hold + 1), hold)[: fine.size]
    elif kind == "step":
        command = np.where(fine > 0.3 * fine[-1], 1.0, 0.0)
    elif kind == "loop":
        hold = int(random.uniform(0.5, 2.0) * rate * _FINE)
        reference = np.repeat(random.normal(size=fine.size // hold + 1), hold)[: fine.size]
        return sampled(random, fine, *in_loop(reference, fine[1], lag))
    else:
        command = 0.02 * np.sin(2 * np.pi * 0.05 * fine)
    decay = float(np.exp(-fine[1] / lag))
    velocity = lfilter([0.0, 1.0 - decay], [1.0, -decay], command)
    return sampled(random, fine, np.cumsum(velocity) * fine[1], velocity)


def in_loop(reference: Floats, step: float, lag: float) -> tuple[Floats, Floats]:
    """Position and velocity of an axis that a controller holds on a reference, with friction that sticks."""
    position, velocity, x, v = np.zeros(reference.size), np.zeros(reference.size), 0.0, 0.0
    gain = 4.0 / lag
    for k, wanted in enumerate(reference.tolist()):
        v += step * (gain * (wanted - x) - 0.5 * v - 0.1 * np.tanh(v / 0.01)) / lag
        x += step * v
        position[k], velocity[k] = x, v
    return position, velocity


def sampled(random: Random, fine: Floats, position: Floats, velocity: Floats) -> tuple[Floats, Floats, Floats]:
    """Every so many samples of a motion; in one of three records these are uneven, and some are missing."""
    index = np.arange(0, fine.size - _FINE, _FINE)
    if random.uniform() < 1 / 3:
        index = np.unique(index + random.integers(0, _FINE, size=index.size))
        index = index[random.uniform(size=index.size) > 0.05]
    size = 10.0 ** random.uniform(-1.0, 1.0)
    return fine[index], size * position[index], size * velocity[index]


def encoder(random: Random, position: Floats) -> Floats:
    """What is recorded of a position: exact, noisy or in steps."""
    span = float(np.ptp(position))
    kind = random.integers(3)
    if kind == 0:
        return position
    if kind == 1:
        return position + 10.0 ** random.uniform(-4.5, -2.5) * span * random.normal(size=position.size)
    step = span / 10.0 ** random.uniform(2.0, 4.5)
    return np.asarray(step * np.round(position / step))


def _pace(time: Floats, v: Floats) -> float:
    """Time in which a velocity changes by its own size [s]."""
    return float(np.std(v) / max(np.std(np.gradient(v, time)), 1e-12))


def _filtered(random: Random, time: Floats, seen: Floats, v: Floats) -> Floats:
    """Behind a low pass of first order with its corner above the motion."""
    step = float(np.median(np.diff(time)))
    decay = float(np.exp(-step / (random.uniform(0.1, 0.7) * _pace(time, v))))
    return np.asarray(lfilter([1.0 - decay], [1.0, -decay], v))


def _delayed(random: Random, time: Floats, seen: Floats, v: Floats) -> Floats:
    return np.interp(time - random.uniform(0.1, 0.7) * _pace(time, v), time, v)


def _steps(random: Random, v: Floats, *, cut: bool) -> Floats:
    step = float(np.max(np.abs(v))) / random.uniform(3.0, 50.0)
    return np.asarray(step * (np.trunc if cut else np.round)(v / step))


GOOD: dict[str, Column] = {
    "exact": lambda random, t, seen, v: v,
    "noise of 5 %": lambda random, t, seen, v: v + 0.05 * np.std(v) * random.normal(size=v.size),
    "noise of 100 %": lambda random, t, seen, v: v + np.std(v) * random.normal(size=v.size),
    "slow noise of 30 %": lambda random, t, seen, v: v + 0.3 * np.std(v) * coloured(random, v.size),
    "difference": lambda random, t, seen, v: np.concatenate([[0.0], np.diff(seen) / np.diff(t)]),
    "difference by a fixed period": lambda random, t, seen, v: (
        np.concatenate([[0.0], np.diff(seen)]) / np.median(np.diff(t))
    ),
    "low pass": _filtered,
    "late": _delayed,
    "rounded": lambda random, t, seen, v: _steps(random, v, cut=False),
    "rounded to zero": lambda random, t, seen, v: _steps(random, v, cut=True),
    "bias": lambda random, t, seen, v: v + random.uniform(-0.5, 0.5) * np.std(v),
}
BAD: dict[str, Column] = {
    "scale of 10 % off": lambda random, t, seen, v: random.choice([0.9, 1.1]) * v,
    "zero": lambda random, t, seen, v: np.zeros(v.size),
    "a constant": lambda random, t, seen, v: np.full(v.size, 2.0 * np.std(v)),
    "rpm": lambda random, t, seen, v: 30.0 / np.pi * v,
    "deg/s": lambda random, t, seen, v: 180.0 / np.pi * v,
    "rev/s": lambda random, t, seen, v: v / (2.0 * np.pi),
    "sign": lambda random, t, seen, v: -v,
    "noisy, sign": lambda random, t, seen, v: -v + 0.3 * np.std(v) * random.normal(size=v.size),
    "twice": lambda random, t, seen, v: 2.0 * v,
    "1/60, noisy": lambda random, t, seen, v: v / 60.0 + 0.01 * np.std(v) * random.normal(size=v.size),
    "white noise": lambda random, t, seen, v: np.std(v) * random.normal(size=v.size),
    "slow noise": lambda random, t, seen, v: np.std(v) * coloured(random, v.size),
    "3 x position": lambda random, t, seen, v: 3.0 * seen,
}
MOTIONS = ("steps", "sines", "sine", "sweep", "one way", "step", "loop", "slow")


def coloured(random: Random, count: int) -> Floats:
    """Noise of unit power that a low pass of some samples has made slow."""
    noise = np.asarray(lfilter([1.0], [1.0, -0.9], random.normal(size=count)))
    return noise / max(float(np.std(noise)), 1e-12)


def told(column: Column, kind: str, runs: int, seed: int = 0) -> tuple[int, int]:
    """Of how many records of a kind of motion the column is told to be wrong, and of how many to be right."""
    wrong = right = 0
    for run in range(runs):
        random = np.random.default_rng([seed, MOTIONS.index(kind), run])
        time, position, velocity = motion(random, kind)
        seen = encoder(random, position)
        slope = velocity_slope(time, seen, column(random, time, seen, velocity))
        wrong += slope is not None and slope.wrong
        right += slope is not None and not slope.wrong
    return wrong, right


def main() -> None:
    """Print the counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=30, help="records of each motion and column")
    runs = parser.parse_args().runs
    for title, columns in (("good", GOOD), ("bad", BAD)):
        print(f"{title:30s}" + "".join(f"{kind:>10s}" for kind in MOTIONS) + "     told wrong")
        total = 0
        for name, column in columns.items():
            found = [told(column, kind, runs)[0] for kind in MOTIONS]
            total += sum(found)
            print(f"{name:30s}" + "".join(f"{one:10d}" for one in found) + f"{sum(found):8d} of {runs * len(MOTIONS)}")
        print(f"{title}: {total} of {runs * len(MOTIONS) * len(columns)} told wrong\n")


if __name__ == "__main__":
    main()
