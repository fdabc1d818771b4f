"""Rows B2 and B9: the Quanser torsion system under PID (Linköping thesis, 2009).

The thesis observed an offset of the command (0.0397 A), Coulomb friction, lopsided slip rings, a slip
between motor and first load and saturation, and modelled none but the offset. Its size is the thesis's;
those of the others, which it gives without numbers, are ours. The disturbance torque is coloured
noise at the motor, of 1 or 5 % of the rms torque of the drive.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from disturbances import disturbance
from machines import perturbed
from paper_records import (
    RUNG_HEADS,
    Answer,
    Recording,
    Tell,
    Worth,
    climb,
    recorded,
    rung_rows,
    table,
    worth,
    worth_rows,
)

# Every sample that the controller saw is kept: it answers a disturbance within a few milliseconds, and in a
# record thinned to 200 Hz the command seems to know beforehand what disturbs the motion, which looks like friction.
RATE, DURATION = 1000.0, 6.0
# Kp, Ki, Kd and the limit of the thesis; the derivative is filtered, or encoder noise alone would fill the limit.
PID = {
    "type": "pid",
    "output": "motor.position",
    "kp": 8.3867,
    "ki": 0.3255,
    "kd": 0.8,
    "derivative_filter": 0.005,
    "limit": 2.95,
    "sample_time": 1.0 / RATE,
}
EFFECTS: dict[str, tuple[str, str, dict[str, float]]] = {
    "offset": ("input_offset", "input", {"offset": 0.0397}),
    "friction": ("coulomb_friction", "motor", {"level": 0.005}),
    "imbalance": ("imbalance", "motor", {"amplitude": 0.006, "phase": 0.4}),
    "slip": ("slip", "motor-load1", {"limit": 0.09}),
    "saturation": ("saturation", "input", {"limit": 2.0}),
}
ALL = tuple(EFFECTS)
# One by one; what section 6.2.1 of the thesis suspects behind its row B9; what its normal operation has; everything.
CASES: dict[str, tuple[str, ...]] = {
    **{name: (name,) for name in EFFECTS},
    "friction+imbalance": ("friction", "imbalance"),
    "offset+friction+imbalance": ("offset", "friction", "imbalance"),
    "all": ALL,
}
# Amplitudes of figure 5.6, and one that no fit sees.
SMALL, LARGE, THIRD = 0.2, 0.9, 0.5
LINEAR, LINEAR_SMALL, LINEAR_LARGE = "linear", "linear, from 20 %", "linear, from 90 %"
ONE, TRUE = "with the effects", "the true machine"
WORTH_HEADS = ("validation", "FIT free run [%]", "force error [%]")


def torsion(names: Sequence[str]) -> Any:
    """The torsion system under PID with some of the effects."""
    from idloop.physics import load_model

    model = replace(load_model("torsion"), controller=dict(PID))
    for name in names:
        effect, at, values = EFFECTS[name]
        model = model.with_effect(effect, at, **values)
    return model


def reference(kind: str, amplitude: float, seed: int) -> Recording:
    """Smooth moves over three turns, or the thesis's steps of 36 degrees on many levels.

    The moves show what depends on the angle and on the direction; the steps drive the command into its
    limits and twist the couplings.
    """
    from idloop.signals import build_signal

    common = {"sample_time": 1.0 / RATE, "duration": DURATION, "seed": seed}
    if kind == "moves":
        signal = build_signal(
            "smooth",
            amplitude=3.0 * np.pi * amplitude,
            velocity_limit=8.0,
            acceleration_limit=60.0,
            dwell=0.2,
            **common,
        )
    else:
        signal = build_signal(
            "multilevel", amplitude=np.radians(36.0) * amplitude, hold_min=0.2, hold_max=0.8, **common
        )
    value = np.asarray(signal.value)
    return Recording(f"{kind} {100 * amplitude:.0f} %", value, signal.rate, RATE, np.zeros(len(value)))


def torsion_records(model: Any, amplitude: float, share: float, simulator: str, seed: int) -> list[Any]:
    """One recording of moves and one of steps, disturbed by a share of the drive's torque."""
    records = []
    for i, kind in enumerate(("moves", "steps")):
        quiet = reference(kind, amplitude, seed + i)
        command = recorded(model, quiet, simulator, seed + i).input
        rms = share * float(model.values["drive.gain"]) * float(np.sqrt(np.mean(command**2)))
        torque = disturbance("ar", rms, len(quiet.signal), seed + 50 + i)
        records.append(recorded(model, replace(quiet, torque=torque), simulator, seed + i))
    return records


# -- B2 -------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class TorsionCase:
    """What was found of some hidden effects."""

    name: str
    share: float
    seed: int
    found: Answer

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            "case": self.name,
            "hidden": [f"{EFFECTS[n][0]}@{EFFECTS[n][1]}" for n in CASES[self.name]],
            "disturbance": self.share,
            "seed": self.seed,
            **self.found.to_dict(),
        }


def b2(name: str, share: float, simulator: str, level: float, seed: int, tell: Tell) -> TorsionCase:
    """One case of `CASES`: from the linear model, nothing told.

    Parameters
    ----------
    name : str
        A key of `CASES`.
    share : float
        Disturbance torque over that of the drive.
    simulator : str
        One of `simulators.SIMULATORS`.
    level : float
        Family-wise error rate.
    seed : int
    tell : callable
        Share done and a text.

    Returns
    -------
    TorsionCase
    """
    truth = torsion(CASES[name])
    records = torsion_records(truth, 1.0, share, simulator, 1000 * seed + 100)
    validation = torsion_records(truth, 0.8, share, simulator, 1000 * seed + 300)
    title = f"B2 {name}, {100 * share:.0f} %"
    found = climb(
        perturbed(torsion(()), seed), truth, records, validation, level, lambda s, t: tell(0.95 * s, f"{title}: {t}")
    )
    return TorsionCase(name, share, seed, replace(found, worth=_worth(found, truth, validation)))


def _worth(found: Answer, truth: Any, validation: Sequence[Any]) -> dict[str, Worth]:
    """The models before and after, and the true machine's."""
    models = {LINEAR: found.ladder.steps[0].model, ONE: found.ladder.model, TRUE: truth}
    return {name: worth(model, validation) for name, model in models.items()}


def b2_text(case: TorsionCase) -> str:
    """The case in a table."""
    found = case.found
    said = "right" if found.right else "WRONG"
    title = f"B2  {case.name} hidden, disturbance {100 * case.share:.0f} %, seed {case.seed}: {said}"
    return "\n".join(
        (
            "",
            f"{title}   [{found.seconds:.0f} s]",
            table(RUNG_HEADS, rung_rows(found)),
            f"  verdict {found.ladder.verdict}",
            table(WORTH_HEADS, worth_rows(found.worth)),
        )
    )


def b2_counted(cases: Sequence[TorsionCase]) -> str:
    """One line a case, and the counts."""
    rows = []
    for case in cases:
        rungs, worths = case.found.rungs, case.found.worth
        hidden = len(CASES[case.name])
        named = sum(rung.hidden is not None for rung in rungs)
        worst = [abs(e.deviations) for rung in rungs for e in rung.estimates if np.isfinite(e.deviations)]
        rows.append(
            [
                case.name,
                f"{100 * case.share:.0f}",
                str(case.seed),
                f"{named} of {hidden}",
                str(sum(rung.hidden is None for rung in rungs)),
                f"{max(worst):.1f}" if worst else "-",
                " / ".join(f"{worths[name].free_run:.1f}" for name in (LINEAR, ONE, TRUE)),
                " / ".join(f"{worths[name].force:.1f}" for name in (LINEAR, ONE, TRUE)),
                f"{case.found.seconds:.0f}",
            ]
        )
    heads = (
        "hidden", "disturbance [%]", "seed", "found", "false", "largest error [stderr]", "FIT free run [%]",
        "force error [%]", "time [s]",
    )  # fmt: skip
    right = sum(case.found.right for case in cases)
    return "\n".join(
        (
            "",
            "B2  summary",
            table(heads, rows),
            f"  {right} of {len(cases)} answers right; FIT and force error: linear / with the effects / true",
        )
    )


# -- B9 -------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class AmplitudeRow:
    """What the row B9 shows.

    Attributes
    ----------
    share, seed
        As in `b2`.
    found : Answer
        From both amplitudes at once.
    models : dict
        Linear models of each amplitude, the ladder's and the true one.
    worths : dict
        ``worths[model][amplitude]`` on fresh records.
    shown : Record
        Fresh steps of the large amplitude.
    """

    share: float
    seed: int
    found: Answer
    models: dict[str, Any]
    worths: dict[str, dict[float, Worth]]
    shown: Any

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            "disturbance": self.share,
            "seed": self.seed,
            "ladder": self.found.to_dict(),
            "parameters": {name: {p: model.values[p] for p in torsion(()).free} for name, model in self.models.items()},
            "validation": {n: {f"{u:.2f}": asdict(w) for u, w in by.items()} for n, by in self.worths.items()},
        }


def b9(share: float, simulator: str, level: float, seed: int, tell: Tell) -> AmplitudeRow:
    """A linear model of one amplitude fails at another; one model with the effects holds at all.

    Parameters
    ----------
    share : float
        Disturbance torque over that of the drive.
    simulator : str
        One of `simulators.SIMULATORS`.
    level : float
        Family-wise error rate.
    seed : int
    tell : callable
        Share done and a text.

    Returns
    -------
    AmplitudeRow
    """
    from idloop.estimate import fit

    truth, start = torsion(ALL), perturbed(torsion(()), seed)
    tell(0.0, "B9: simulating")
    small, large = (
        torsion_records(truth, amplitude, share, simulator, 1000 * seed + place)
        for amplitude, place in ((SMALL, 500), (LARGE, 600))
    )
    fresh = {
        amplitude: torsion_records(truth, amplitude, share, simulator, 1000 * seed + place)
        for amplitude, place in ((SMALL, 700), (THIRD, 800), (LARGE, 900))
    }
    title = f"B9 {100 * share:.0f} %"
    found = climb(
        start, truth, [*small, *large], fresh[THIRD], level, lambda s, t: tell(0.05 + 0.8 * s, f"{title}: {t}")
    )
    tell(0.85, f"{title}: linear fits")
    models = {
        LINEAR_SMALL: fit(start, small, criterion="prediction").model,
        LINEAR_LARGE: fit(start, large, criterion="prediction").model,
        ONE: found.ladder.model,
        TRUE: truth,
    }
    tell(0.92, f"{title}: predictions")
    worths = {
        name: {amplitude: worth(model, records) for amplitude, records in fresh.items()}
        for name, model in models.items()
    }
    return AmplitudeRow(share, seed, found, models, worths, fresh[LARGE][1])


def b9_text(row: AmplitudeRow) -> str:
    """The row in tables."""
    found = row.found
    said = "right" if found.right else "WRONG"
    title = f"B9  all five hidden, disturbance {100 * row.share:.0f} %, seed {row.seed}: {said}"
    free = torsion(()).free
    drift = [
        [name, *(f"{model.values[name]:.4g}" for model in row.models.values()), model_unit(row.models[TRUE], name)]
        for name in free
    ]
    return "\n".join(
        (
            "",
            f"{title}   [{found.seconds:.0f} s]",
            f"From the linear model, recordings of {100 * SMALL:.0f} and {100 * LARGE:.0f} % at once:",
            table(RUNG_HEADS, rung_rows(found)),
            f"  verdict {found.ladder.verdict}",
            "",
            "Parameters by what was fitted:",
            table(("parameter", *row.models, "unit"), drift),
            "",
            f"Fresh recordings; {100 * THIRD:.0f} % was never fitted:",
            *(
                table((f"at {100 * u:.0f} %", *WORTH_HEADS[1:]), worth_rows({n: by[u] for n, by in row.worths.items()}))
                for u in row.worths[ONE]
            ),
        )
    )


def model_unit(model: Any, name: str) -> str:
    """Unit of a parameter."""
    return str(model.parameter(name).unit)
