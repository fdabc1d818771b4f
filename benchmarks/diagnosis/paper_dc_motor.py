"""Row A6: a DC motor whose linear fits drift with the amplitude (Rungroungdouyboon, Lehigh 1999).

The thesis fits b / (s^2 + a s) to square waves of four amplitudes, with an adjustable backlash between
gearbox and potentiometer, on a motor whose dead zone it measured as 0.12 V. Its gains b/a rise with the
amplitude u as K (1 - 0.12 V / u) does; the K and the a of its table are those of the machine here. It does
not tell the gap of its coupling, nor the length of its records.

Its a falls with the amplitude, which a dead zone alone does not make it do: dry friction does, because it
brakes after a reversal. A second machine therefore has a quarter of the 0.12 V as Coulomb friction.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from paper_records import RUNG_HEADS, Answer, Recording, Tell, climb, recorded, rung_rows, table

Array = NDArray[np.float64]

# b and a by amplitude [V], as published.
THESIS = {0.23: (8.4290, 1.6747), 0.30: (9.2629, 1.5843), 0.35: (9.8497, 1.5252), 0.40: (10.1907, 1.4421)}
DEAD_ZONE, GAP, UNSEEN = 0.12, 0.1, 0.45
# Part of the dead zone that is dry friction, in the two machines.
FRICTION = (0.0, 0.25)
# Square wave of 0.5 Hz read at 10 Hz, as in the thesis.
RATE, DURATION, FREQUENCY = 10.0, 120.0, 0.5
ALONE = 0.30


@dataclass(frozen=True)
class Drift:
    """Linear fits at each amplitude.

    Attributes
    ----------
    b, a : dict
        Value and standard error by amplitude.
    """

    b: dict[float, tuple[float, float]]
    a: dict[float, tuple[float, float]]

    def gain(self, amplitude: float) -> float:
        """Apparent gain b/a."""
        return self.b[amplitude][0] / self.a[amplitude][0]


@dataclass(frozen=True)
class DcMotorRow:
    """Everything that the row shows, for one seed.

    Attributes
    ----------
    seed : int
    friction : float
        Part of the dead zone that is dry friction.
    drift : Drift
    found : Answer
        From all amplitudes at once.
    alone : Answer
        From one amplitude.
    fits : dict
        FIT of the free run in percent: ``fits[model][amplitude] = (position, velocity)``.
    records : dict
        By amplitude.
    models : dict
        By name, as in `fits`.
    """

    seed: int
    friction: float
    drift: Drift
    found: Answer
    alone: Answer
    fits: dict[str, dict[float, tuple[float, float]]]
    records: dict[float, Any]
    models: dict[str, Any]

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            "seed": self.seed,
            "friction": self.friction,
            "drift": {
                f"{u:.2f}": {
                    "b": self.drift.b[u][0],
                    "b_stderr": self.drift.b[u][1],
                    "a": self.drift.a[u][0],
                    "a_stderr": self.drift.a[u][1],
                    "thesis_b": THESIS[u][0],
                    "thesis_a": THESIS[u][1],
                }
                for u in THESIS
            },
            "ladder": self.found.to_dict(),
            "one_amplitude": {
                **self.alone.to_dict(),
                "amplitude": ALONE,
                "untestable": list(self.alone.ladder.untestable),
            },
            "fit": {
                name: {f"{u:.2f}": {"position": p, "velocity": v} for u, (p, v) in by_amplitude.items()}
                for name, by_amplitude in self.fits.items()
            },
        }


def implied(gains: Mapping[float, float]) -> tuple[float, float]:
    """Gain and dead zone that a table of apparent gains follows: least squares on K (1 - width / u).

    Parameters
    ----------
    gains : mapping of float to float
        b/a by amplitude.

    Returns
    -------
    gain, width : float
    """
    regressor = np.array([[1.0, -1.0 / u] for u in gains])
    gain, product = np.linalg.lstsq(regressor, np.array(list(gains.values())), rcond=None)[0]
    return float(gain), float(product / gain)


def thesis_gains() -> dict[float, float]:
    """Published b/a by amplitude."""
    return {u: b / a for u, (b, a) in THESIS.items()}


def true_motor(friction: float) -> Any:
    """The thesis's motor: gain and damping read off its table, its dead zone, and a gap.

    Parameters
    ----------
    friction : float
        Part of the dead zone that is Coulomb friction instead, 0 to 1.

    Returns
    -------
    Model
    """
    from idloop.physics import load_model

    share = np.array([1.0 - DEAD_ZONE / u for u in THESIS])
    gain = float(share @ np.array(list(thesis_gains().values())) / (share @ share))
    damping = float(np.mean([a for _, a in THESIS.values()]))
    model = replace(load_model("dc_motor"), controller=None)
    model = model.with_values({"drive.gain": gain * damping, "motor.viscous_friction": damping})
    model = model.with_effect("dead_zone", "input", width=DEAD_ZONE * (1.0 - friction))
    if friction > 0.0:
        model = model.with_effect("coulomb_friction", "motor", level=gain * damping * DEAD_ZONE * friction)
    return model.with_effect("backlash", "position[motor]", gap=GAP)


def square(amplitude: float) -> Recording:
    """The square wave of the thesis."""
    count = round(DURATION * RATE)
    phase = (np.arange(count) * FREQUENCY / RATE) % 1.0
    signal = np.where(phase < 0.5, amplitude, -amplitude)
    return Recording(f"square {amplitude:.2f} V", signal, None, RATE, np.zeros(count))


def linear_fits(start: Any, records: Mapping[float, Any]) -> Drift:
    """The linear model fitted to every record by itself, by output error."""
    from idloop.estimate import fit

    b, a = {}, {}
    for u, record in records.items():
        model = fit(start, [record], criterion="simulation").model
        gain, damping = model.parameter("drive.gain"), model.parameter("motor.viscous_friction")
        b[u] = gain.value, gain.stderr or float("nan")
        a[u] = damping.value, damping.stderr or float("nan")
    return Drift(b, a)


def a6(friction: float, simulator: str, level: float, seed: int, tell: Tell) -> DcMotorRow:
    """Linear fits drift; one model with the effects explains all amplitudes and one that it never saw.

    Parameters
    ----------
    friction : float
        Part of the dead zone that is dry friction.
    simulator : str
        One of `simulators.SIMULATORS`.
    level : float
        Family-wise error rate.
    seed : int
        Of the measurement noise.
    tell : callable
        Share done and a text.

    Returns
    -------
    DcMotorRow
    """
    from idloop.physics import load_model
    from idloop.validate import compare

    truth = true_motor(friction)
    records = {u: recorded(truth, square(u), simulator, 100 * seed + i) for i, u in enumerate((*THESIS, UNSEEN))}
    training = {u: records[u] for u in THESIS}
    start = replace(load_model("dc_motor"), controller=None)
    tell(0.0, "A6: linear fits")
    drift = linear_fits(start, training)
    found = climb(
        start, truth, list(training.values()), [records[UNSEEN]], level, lambda s, t: tell(0.1 + 0.6 * s, f"A6: {t}")
    )
    alone = climb(start, truth, [records[ALONE]], [], level, lambda s, t: tell(0.7 + 0.2 * s, f"A6, one record: {t}"))
    models = {
        "one linear model": found.ladder.steps[0].model,
        "with the effects": found.ladder.model,
        "the true machine": truth,
    }
    tell(0.9, "A6: free runs")
    fits = {
        name: {u: _two(compare(model, record).fit) for u, record in records.items()} for name, model in models.items()
    }
    return DcMotorRow(seed, friction, drift, found, alone, fits, records, models)


def _two(by_output: Mapping[str, float]) -> tuple[float, float]:
    position, velocity = by_output.values()
    return position, velocity


def hidden_words(friction: float) -> str:
    """What is hidden, in words."""
    if friction == 0.0:
        return f"dead zone {DEAD_ZONE} V and backlash {GAP} rad"
    dead, dry = DEAD_ZONE * (1.0 - friction), DEAD_ZONE * friction
    return f"dead zone {dead:.2f} V, dry friction worth {dry:.2f} V and backlash {GAP} rad"


def text(row: DcMotorRow) -> str:
    """The row in tables."""
    said = "right" if row.found.right else "WRONG"
    gains = {u: row.drift.gain(u) for u in THESIS}
    theirs = thesis_gains()
    drift = [
        [
            f"{u:.2f}",
            *(f"{value:.3f} ± {stderr:.3f}" for value, stderr in (row.drift.b[u], row.drift.a[u])),
            f"{gains[u]:.2f}",
            *(f"{value:.4f}" for value in THESIS[u]),
            f"{theirs[u]:.2f}",
        ]
        for u in THESIS
    ]
    lines = [
        "",
        f"A6  DC motor, {hidden_words(row.friction)} hidden, seed {row.seed}: {said}   [{row.found.seconds:.0f} s]",
        "",
        "Linear fit b / (s^2 + a s) at each amplitude, and the thesis's:",
        table(("u [V]", "b", "a", "b/a", "thesis: b", "thesis: a", "thesis: b/a"), drift),
    ]
    for whose, values in (("these fits", gains), ("the thesis's", theirs)):
        gain, width = implied(values)
        lines.append(f"  least squares on b/a, {whose}: b/a = {gain:.2f} (1 - {width:.3f} V / u)")
    lines += ["", "From the linear model, nothing told, all four recordings at once:"]
    lines += [table(RUNG_HEADS, rung_rows(row.found)), f"  verdict {row.found.ladder.verdict}"]
    names = ", ".join(rung.name for rung in row.alone.rungs) or "nothing"
    untestable = ", ".join(row.alone.ladder.untestable)
    lines += [
        "",
        f"From {ALONE} V alone: {names}; verdict {row.alone.ladder.verdict}; this data cannot show {untestable}",
        "",
        f"FIT of the free run [%], position / velocity; {UNSEEN} V was never fitted. The true machine's is the most",
        "that the sensors' noise allows:",
        table(
            ("u [V]", *row.fits),
            [
                [
                    f"{u:.2f}",
                    *(f"{p:.1f} / {v:.1f}" for p, v in (by_amplitude[u] for by_amplitude in row.fits.values())),
                ]
                for u in row.records
            ],
        ),
    ]
    return "\n".join(lines)


def counted(rows: Sequence[DcMotorRow]) -> str:
    """How often the answer was right, over the seeds."""
    lines = [""]
    for friction in FRICTION:
        several = [row for row in rows if row.friction == friction]
        right = sum(row.found.right for row in several)
        lines.append(f"A6  {hidden_words(friction)}: all found and nothing else in {right} of {len(several)} seeds")
    return "\n".join(lines)
