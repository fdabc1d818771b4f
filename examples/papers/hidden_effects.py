"""Rows whose answer is a diagnosis: effects hidden in a machine, and what the ladder makes of its recordings.

The machines are solved by `independent_motor` and `independent_torsion`, which share no physics with the rest of
idloop: a model is not held against data of its own making. ``benchmarks/diagnosis`` runs the same rows on its own
simulators.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from papers import Progress
from papers.claim import Claim, stated
from papers.reproduction import Cell, Table

if TYPE_CHECKING:
    from idloop.diagnosis import Ladder
    from idloop.physics import Model
    from idloop.records import Record

Array = NDArray[np.float64]

# Family-wise error rate of a ladder.
LEVEL = 0.01


@dataclass(frozen=True, eq=False)
class Recording:
    """A signal sent into a machine, and what disturbs it.

    Attributes
    ----------
    name : str
    signal : ndarray, shape (n,)
        Command, or with a controller the reference.
    speed : ndarray, shape (n,), or None
        Velocity of the reference.
    rate : float
        Samples per second.
    torque : ndarray, shape (n,)
        Disturbance at the first body.
    """

    name: str
    signal: Array
    speed: Array | None
    rate: float
    torque: Array


# A true machine, what is sent in, and the seed of the measurement noise, to what was recorded.
Simulate = Callable[["Model", Recording, int], "Record"]


def part_of(progress: Progress, number: int, count: int) -> Progress:
    """Progress of one of several parts of equal length."""
    return lambda share, text: progress((number + share) / count, text)


def white_noise(model: Model, count: int, seed: int) -> Array:
    """Measurement noise of every output of a model, shape (count, outputs)."""
    deviation = np.array([output.noise for output in model.outputs], dtype=float)
    return np.asarray(np.random.default_rng(seed).standard_normal((count, len(deviation))) * deviation)


def coloured_torque(rms: float, count: int, seed: int, pole: float = 0.9) -> Array:
    """Disturbance that forgets by ``pole`` from sample to sample, stationary from the first on, shape (count,)."""
    from scipy.signal import lfilter

    white = np.random.default_rng(seed).standard_normal(count)
    white[1:] *= math.sqrt(1.0 - pole**2)
    return rms * np.asarray(lfilter([1.0], [1.0, -pole], white))


def to_record(model: Model, recording: Recording, command: Array, output: Array) -> Record:
    """What a machine that was simulated elsewhere has shown.

    Parameters
    ----------
    model : Model
        Whose names and units the streams have.
    recording : Recording
    command : ndarray, shape (n,)
    output : ndarray, shape (n, p)
    """
    from idloop.records import Record

    count = len(recording.signal)
    stamps = np.arange(count) / recording.rate
    closed = model.controller is not None
    speed = np.full(count, np.nan) if recording.speed is None else recording.speed
    return Record(
        name=recording.name,
        input_time=stamps,
        input=command,
        time=stamps,
        output=output,
        input_name=model.input.name,
        input_unit=model.input.unit,
        output_names=model.output_names,
        output_units=tuple(o.unit for o in model.outputs),
        reference_time=stamps if closed else None,
        reference=np.column_stack([recording.signal, speed]) if closed else None,
    )


def told_nothing(model: Model, seed: int) -> Model:
    """The same model with every free parameter moved by 20 to 40 % up or down."""
    random = np.random.default_rng(seed)
    moved = {name: random.uniform(0.2, 0.4) * random.choice([-1.0, 1.0]) for name in model.free}
    return model.with_values({name: model.values[name] * (1.0 + share) for name, share in moved.items()})


@dataclass(frozen=True)
class Worth:
    """How well a model does on some records.

    Attributes
    ----------
    free_run : float
        FIT of the free run, mean over outputs and records [%]. On a plant that integrates, a constant or a
        disturbance of a few percent makes it drift far off.
    force : float
        Error of the drive's force for the measured motion, in percent of that force.
    """

    free_run: float
    force: float


def worth(model: Model, records: Sequence[Record]) -> Worth:
    """Hold a model against records."""
    from idloop.diagnosis.model_errors import model_errors
    from idloop.validation.drive import force_error

    fit = list(model_errors(model, records)["fit"].values())
    forces = [force_error(model, record).relative for record in records]
    return Worth(float(np.mean(fit)) if fit else math.nan, 100.0 * float(np.sqrt(np.mean(np.square(forces)))))


@dataclass(frozen=True)
class Estimate:
    """A parameter of an effect: what was found and what is true (NaN when nothing of the kind was hidden)."""

    name: str
    value: float
    stderr: float
    true: float
    unit: str

    @property
    def deviations(self) -> float:
        """Error in standard errors."""
        return (self.value - self.true) / self.stderr if self.stderr > 0.0 else math.nan


@dataclass(frozen=True)
class Rung:
    """An effect that was added.

    Attributes
    ----------
    name : str
    set : tuple of str
        What the data cannot tell from it, itself included.
    p_value : float
    hidden : str or None
        The hidden effect that it stands for; None when it is false.
    estimates : tuple of Estimate
        From the last model of the ladder.
    """

    name: str
    set: tuple[str, ...]
    p_value: float
    hidden: str | None
    estimates: tuple[Estimate, ...]

    @property
    def how(self) -> str:
        """Whether it is hidden, one of a set with a hidden one, or false."""
        return "false" if self.hidden is None else "found" if self.hidden == self.name else "in the set"


@dataclass(frozen=True)
class Answer:
    """What `idloop.diagnosis.refine` answered.

    Attributes
    ----------
    ladder : Ladder
    rungs : tuple of Rung
    missed : dict
        Hidden effects that were not named: p-value and testability as the tool gave them at its end.
    seconds : float
    """

    ladder: Ladder
    rungs: tuple[Rung, ...]
    missed: dict[str, str]
    seconds: float

    @property
    def right(self) -> bool:
        """All hidden effects named, if only in a set, and nothing else."""
        return not self.missed and all(rung.hidden is not None for rung in self.rungs)

    @property
    def claim(self) -> Claim:
        """That it is right."""
        return stated("all hidden, no other", self.right)

    @property
    def farthest(self) -> float:
        """Largest error of a parameter in its standard errors; NaN without one."""
        found = [abs(e.deviations) for rung in self.rungs for e in rung.estimates if math.isfinite(e.deviations)]
        return max(found, default=math.nan)

    @property
    def words(self) -> str:
        """What was found and what was not, in one line."""
        found = [" or ".join((rung.name, *(one for one in rung.set if one != rung.name))) for rung in self.rungs]
        return "; ".join([*(found or ["nothing"]), *(f"missed {name}" for name in self.missed)])

    def table(self, title: str) -> Table:
        """One line for each parameter of each rung, missed effects below."""
        head = ("hidden", "found", "cannot be told from", "p", "parameter", "value", "standard error", "true")
        rows: list[list[Cell]] = []
        for rung in self.rungs:
            tied = ", ".join(name for name in rung.set if name != rung.name) or "-"
            first: list[Cell] = [rung.hidden or "-", rung.name, tied, f"{rung.p_value:.1g}"]
            for e in rung.estimates:
                name = f"{e.name} [{e.unit}]" if e.unit else e.name
                rows.append([*first, name, *(v if math.isfinite(v) else None for v in (e.value, e.stderr, e.true))])
                first = ["", "", "", ""]
        rows += [[name, f"missed ({why})", "-", "-", "", None, None, None] for name, why in self.missed.items()]
        return Table(f"{title}: verdict {self.ladder.verdict}, {self.seconds:.0f} s", head, rows)

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        rungs = [
            {**asdict(rung), "how": rung.how, "estimates": [asdict(estimate) for estimate in rung.estimates]}
            for rung in self.rungs
        ]
        return {
            "right": self.right,
            "rungs": rungs,
            "missed": self.missed,
            "verdict": self.ladder.verdict,
            "criterion": self.ladder.criterion,
            "seconds": round(self.seconds, 1),
        }


def climb(
    start: Model, truth: Model, training: Sequence[Record], validation: Sequence[Record], progress: Progress,
    level: float = LEVEL,
) -> Answer:  # fmt: skip
    """Refine the start model and hold the answer against the truth.

    Parameters
    ----------
    start, truth : Model
    training, validation : sequence of Record
    progress : callable
    level : float
        Family-wise error rate.
    """
    from idloop.diagnosis import refine

    begin = time.perf_counter()
    so_far: list[str] = []

    def report(share: float, text: str) -> None:
        progress(share, "; ".join([*so_far, text]))

    def on_step(ladder: Ladder) -> None:
        so_far[:] = [f"found {', '.join(ladder.added)}"]

    ladder = refine(start, training, validation, level=level, progress=report, on_step=on_step)
    return answer(ladder, truth, time.perf_counter() - begin)


def answer(ladder: Ladder, truth: Model, seconds: float) -> Answer:
    """Hold a ladder against the truth.

    Parameters
    ----------
    ladder : Ladder
    truth : Model
    seconds : float
        That it took.
    """
    hidden = list(truth.effect_names)
    rungs = []
    for step in ladder.steps:
        if step.added is None:
            continue
        several = tuple(dict.fromkeys((step.added.name, *step.set)))
        meant = next((name for name in several if name in hidden), None)
        if meant is not None:
            hidden.remove(meant)
        estimates = _estimates(ladder.model, truth, step.added.name)
        p_value = math.nan if step.p_value is None else float(step.p_value)
        rungs.append(Rung(step.added.name, several, p_value, meant, estimates))
    missed = {}
    for name in hidden:
        last = next((c for c in ladder.candidates if c.name == name), None)
        missed[name] = "not weighed" if last is None else f"p {last.p_value:.2g}, testable: {last.testable}"
    return Answer(ladder, tuple(rungs), missed, seconds)


def _estimates(model: Model, truth: Model, effect: str) -> tuple[Estimate, ...]:
    prefix = f"{effect}."
    true = _true_values(truth)
    found = []
    for p in model.parameters:
        if not p.name.startswith(prefix):
            continue
        stderr = math.nan if p.stderr is None else float(p.stderr)
        expected = true.get(p.name, math.nan)
        value = float(p.value)
        if p.name.endswith(".phase") and math.isfinite(expected):
            # the turn that is nearest to the truth
            value = expected + (value - expected + math.pi) % (2.0 * math.pi) - math.pi
        found.append(Estimate(p.name.removeprefix(prefix), value, stderr, expected, p.unit))
    return tuple(found)


def _true_values(truth: Model) -> dict[str, float]:
    """Parameters of the hidden effects; a constant at the command is one at the driven body, and the reverse."""
    values: dict[str, float] = {k: float(v) for k, v in truth.values.items() if "@" in k}
    offset = values.get("input_offset@input.offset")
    if offset is not None:
        values.setdefault(f"load_torque@{truth.bodies[0]}.torque", offset * float(truth.values["drive.gain"]))
    return values
