"""Rows of the source papers that linear models could not carry, and what the diagnosis makes of them.

    python benchmarks/diagnosis/paper_rows.py a6      # DC motor, four amplitudes, dead zone and backlash hidden
    python benchmarks/diagnosis/paper_rows.py b2      # torsion system under PID: five effects, one by one and together
    python benchmarks/diagnosis/paper_rows.py b9      # the same machine at one amplitude and at another

A6 is Rungroungdouyboon (Lehigh 1999), B2 and B9 the Linkoping thesis of 2009 (Quanser torsion system).
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parent))

import numpy as np
from disturbances import disturbance, measurement_noise
from laws import law
from machines import perturbed
from numpy.typing import NDArray
from simulators import machine, run

Array = NDArray[np.float64]

# b and a of b / (s^2 + a s), fitted by the thesis with the adjustable backlash in place, by amplitude [V].
LEHIGH = {0.23: (8.4290, 1.6747), 0.30: (9.2629, 1.5843), 0.35: (9.8497, 1.5252), 0.40: (10.1907, 1.4421)}
DEAD_ZONE, GAP, FIFTH = 0.12, 0.1, 0.45
# Square wave of 0.5 Hz, sampled at 10 Hz, as in the thesis; the length of its records is not told.
A6_RATE, A6_DURATION, A6_FREQUENCY = 10.0, 120.0, 0.5


@dataclass(frozen=True)
class Recording:
    """A signal sent into a machine, and what disturbs it."""

    name: str
    signal: Array
    speed: Array | None
    rate: float
    torque: Array
    every: int = 1


def recorded(model: Any, recording: Recording, simulator: str, seed: int) -> Any:
    """Simulate a recording; outputs are kept every so many samples, all steps of the command are."""
    from idloop.records import Record

    count = len(recording.signal)
    noise = measurement_noise("white", np.array([o.noise for o in model.outputs], dtype=float), count, seed)
    built = machine(simulator, model, 1.0 / recording.rate, count)
    behind = law(simulator, model.controller, model.output_names)
    command, output = run(built, recording.signal, recording.speed, noise, recording.torque, behind)
    stamps = np.asarray(np.arange(count) / recording.rate)
    keep = slice(None, None, recording.every)
    closed = model.controller is not None
    rate = np.full(count, np.nan) if recording.speed is None else recording.speed
    return Record(
        name=recording.name,
        input_time=stamps,
        input=command,
        time=stamps[keep],
        output=output[keep],
        input_name=model.input.name,
        input_unit=model.input.unit,
        output_names=model.output_names,
        output_units=tuple(o.unit for o in model.outputs),
        reference_time=stamps if closed else None,
        reference=np.column_stack([recording.signal, rate]) if closed else None,
    )


def fits(model: Any, record: Any) -> str:
    """FIT of the free run and of the prediction ten steps ahead, in percent, by output."""
    from idloop.validate.compare import Comparison

    compared = Comparison(model, record, 10)
    free = ", ".join(f"{value:6.1f}" for value in compared.fit.values())
    ahead = ", ".join(f"{value:6.1f}" for value in compared.fit_ahead.values())
    return f"free run {free}   ten steps ahead {ahead}"


def describe(ladder: Any) -> None:
    """Print the ladder's steps and the values of what it added."""
    for step in ladder.steps[1:]:
        names = " | ".join(dict.fromkeys((step.added.name, *step.set)))
        print(f"    + {names}   p {step.p_value:.1g}, explains {100 * step.added.explains:.0f} % of what was left")
    values = {name: value for name, value in ladder.model.values.items() if "@" in name}
    print("    " + ", ".join(f"{name} {value:.4g}" for name, value in values.items()))
    print(f"    verdict {ladder.verdict}")


# -- A6 ---------------------------------------------------------------------------------------


def square(amplitude: float, seed: int) -> Recording:
    """The square wave of the thesis."""
    count = round(A6_DURATION * A6_RATE)
    phase = (np.arange(count) * A6_FREQUENCY / A6_RATE) % 1.0
    signal = np.where(phase < 0.5, amplitude, -amplitude)
    return Recording(f"square {amplitude:.2f} V", signal, None, A6_RATE, np.zeros(count))


def a6(simulator: str, level: float) -> None:
    """Linear fits at four amplitudes drift; one model with two effects explains all four and a fifth."""
    from idloop.diagnose import refine
    from idloop.estimate import fit
    from idloop.physics import load_model

    preset = replace(load_model("dc_motor"), controller=None)
    truth = preset.with_effect("dead_zone", "input", width=DEAD_ZONE)
    truth = truth.with_effect("backlash", "position[motor]", gap=GAP)
    records = {u: recorded(truth, square(u, i), simulator, 100 + i) for i, u in enumerate((*LEHIGH, FIFTH))}
    training = [records[u] for u in LEHIGH]
    start = perturbed(preset, 6)
    print(f"A6: dead zone {DEAD_ZONE} V and backlash {GAP} rad hidden in the preset dc_motor ({simulator})")
    print("linear fit at each amplitude, b / (s^2 + a s); b/a relative to that at 0.40 V")
    print(f"  {'V':>5} {'b':>8} {'a':>8} {'b/a':>8} {'relative':>9} {'thesis':>9} {'(u-0.12)/u':>11}")
    linear = {}
    for u in LEHIGH:
        linear[u] = fit(start, [records[u]], criterion="simulation").model.values
    last = linear[0.40]["drive.gain"] / linear[0.40]["motor.viscous_friction"]
    theirs = LEHIGH[0.40][0] / LEHIGH[0.40][1]
    active = (0.40 - DEAD_ZONE) / 0.40
    for u, values in linear.items():
        b, a = values["drive.gain"], values["motor.viscous_friction"]
        thesis = LEHIGH[u][0] / LEHIGH[u][1] / theirs
        predicted = (u - DEAD_ZONE) / u / active
        print(f"  {u:5.2f} {b:8.3f} {a:8.3f} {b / a:8.3f} {b / a / last:9.3f} {thesis:9.3f} {predicted:11.3f}")
    ladder = refine(start, training, [records[FIFTH]], level=level)
    print("from the linear model, nothing told, all four recordings at once:")
    describe(ladder)
    pooled = ladder.steps[0].model
    print(f"FIT [%] of position, velocity; {FIFTH} V was never fitted")
    for u, record in records.items():
        print(f"  {u:.2f} V  one linear model   {fits(pooled, record)}")
        print(f"          with the effects   {fits(ladder.model, record)}")


# -- B2 and B9 ----------------------------------------------------------------------------------

TORSION_RATE, KEPT_EVERY, TORSION_DURATION = 1000.0, 5, 20.0
# Kp, Ki, Kd and the limit of the thesis; the derivative is filtered, or encoder noise alone would fill the limit.
PID = {
    "type": "pid",
    "output": "motor.position",
    "kp": 8.3867,
    "ki": 0.3255,
    "kd": 0.8,
    "derivative_filter": 0.005,
    "limit": 2.95,
    "sample_time": 1.0 / TORSION_RATE,
}
# The offset is the thesis's; the others it observed without numbers.
TORSION_EFFECTS: dict[str, tuple[str, str, dict[str, float]]] = {
    "offset": ("input_offset", "input", {"offset": 0.0397}),
    "Coulomb friction": ("coulomb_friction", "motor", {"level": 0.005}),
    "imbalance": ("imbalance", "motor", {"amplitude": 0.006, "phase": 0.4}),
    "slip": ("slip", "motor-load1", {"limit": 0.09}),
    "saturation": ("saturation", "input", {"limit": 2.0}),
}
# Amplitudes of the references as shares of the thesis's: moves of 180 degrees, random steps of 36.
SMALL, LARGE = 0.35, 1.0


def torsion(names: Sequence[str]) -> Any:
    """The torsion system under PID with some of the effects."""
    from idloop.physics import load_model

    model = replace(load_model("torsion"), controller=dict(PID))
    for name in names:
        effect, at, values = TORSION_EFFECTS[name]
        model = model.with_effect(effect, at, **values)
    return model


def reference(kind: str, amplitude: float, share: float, seed: int) -> Recording:
    """Smooth moves, or random steps between levels, with a disturbance torque in between."""
    from idloop.signals import build_signal

    common = {"sample_time": 1.0 / TORSION_RATE, "duration": TORSION_DURATION, "seed": seed}
    if kind == "moves":
        signal = build_signal(
            "smooth", amplitude=np.pi * amplitude, velocity_limit=8.0, acceleration_limit=60.0, dwell=0.2, **common
        )
    else:
        signal = build_signal(
            "multilevel", amplitude=np.radians(36.0) * amplitude, hold_min=0.3, hold_max=1.5, **common
        )
    # the share is one of the usual drive, 0.25 A
    rms = share * 0.25 * 0.0742
    torque = disturbance("ar", rms, len(signal.value), seed + 1000)
    return Recording(
        f"{kind} {100 * amplitude:.0f} %", np.asarray(signal.value), signal.rate, TORSION_RATE, torque, KEPT_EVERY
    )


def torsion_records(model: Any, amplitude: float, share: float, simulator: str, seed: int) -> list[Any]:
    """One recording of moves and one of steps."""
    return [
        recorded(model, reference(kind, amplitude, share, seed + i), simulator, seed + 500 + i)
        for i, kind in enumerate(("moves", "steps"))
    ]


def b2(simulator: str, level: float) -> None:
    """Each nonlinearity of the thesis by itself and all together, with 1 to 5 % disturbance torque."""
    from idloop.diagnose import refine

    print(f"B2: torsion system under PID, {', '.join(TORSION_EFFECTS)} hidden ({simulator})")
    for names in (*((name,) for name in TORSION_EFFECTS), tuple(TORSION_EFFECTS)):
        for share in (0.01, 0.05):
            begin = time.perf_counter()
            truth = torsion(names)
            records = torsion_records(truth, LARGE, share, simulator, 20)
            validation = torsion_records(truth, 0.8, share, simulator, 40)
            ladder = refine(perturbed(torsion(()), 7), records, validation, level=level)
            print(f"  {' + '.join(names)}, disturbance {100 * share:.0f} %  [{time.perf_counter() - begin:.0f} s]")
            describe(ladder)


def b9(simulator: str, level: float) -> None:
    """A linear model of one amplitude fails at another; one model with the effects holds at both."""
    from idloop.diagnose import refine
    from idloop.estimate import fit

    truth = torsion(tuple(TORSION_EFFECTS))
    small = torsion_records(truth, SMALL, 0.01, simulator, 60)
    large = torsion_records(truth, LARGE, 0.01, simulator, 80)
    fresh = {
        f"{name} amplitude": torsion_records(truth, amplitude, 0.01, simulator, seed)
        for name, amplitude, seed in (("small", SMALL, 110), ("large", LARGE, 120), ("a third", 0.65, 130))
    }
    start = perturbed(torsion(()), 7)
    ladder = refine(start, [*small, *large], fresh["a third amplitude"], level=level)
    print(f"B9: all five effects hidden, 1 % disturbance torque ({simulator})")
    describe(ladder)
    models = {
        "linear, fitted at small amplitude": fit(start, small, criterion="prediction").model,
        "linear, fitted at large amplitude": fit(start, large, criterion="prediction").model,
        "with the effects, fitted at both": ladder.model,
    }
    for name, records in fresh.items():
        print(f"  tested at {name}; FIT [%] of motor, load1, load2, load3")
        for title, model in models.items():
            for record in records:
                print(f"    {title:36} {record.name:12} {fits(model, record)}")


def main() -> int:
    """Run the rows that were asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rows", nargs="+", choices=("a6", "b2", "b9"))
    parser.add_argument("--simulator", choices=("idloop", "mujoco", "equations"), default="equations")
    parser.add_argument("--level", type=float, default=0.01, help="family-wise error rate (default 0.01)")
    arguments = parser.parse_args()
    for row in arguments.rows:
        {"a6": a6, "b2": b2, "b9": b9}[row](arguments.simulator, arguments.level)
    return 0


if __name__ == "__main__":
    sys.exit(main())
