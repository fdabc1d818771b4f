"""Recordings of simulated machines for the rows of the papers, and what a ladder made of them."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from disturbances import measurement_noise
from laws import law
from numpy.typing import NDArray
from simulators import machine, run

Array = NDArray[np.float64]
Tell = Callable[[float, str], None]


@dataclass(frozen=True)
class Recording:
    """A signal sent into a machine, and what disturbs it.

    Attributes
    ----------
    name : str
    signal : ndarray (n,)
        Command, or with a controller the reference.
    speed : ndarray (n,) or None
        Velocity of the reference.
    rate : float
        Samples per second of the signal.
    torque : ndarray (n,)
        Disturbance at the first body.
    every : int
        Of the outputs every so many samples are kept; of the command all.
    """

    name: str
    signal: Array
    speed: Array | None
    rate: float
    torque: Array
    every: int = 1


def recorded(model: Any, recording: Recording, simulator: str, seed: int) -> Any:
    """Simulate a recording.

    Parameters
    ----------
    model : Model
        The true machine.
    recording : Recording
    simulator : str
        One of `simulators.SIMULATORS`.
    seed : int
        Of the measurement noise.

    Returns
    -------
    Record
    """
    from idloop.records import Record

    count = len(recording.signal)
    noise = measurement_noise("white", np.array([o.noise for o in model.outputs], dtype=float), count, seed)
    built = machine(simulator, model, 1.0 / recording.rate, count)
    behind = law(simulator, model.controller, model.output_names)
    command, output = run(built, recording.signal, recording.speed, noise, recording.torque, behind)
    stamps = np.asarray(np.arange(count) / recording.rate)
    keep = slice(None, None, recording.every)
    closed = model.controller is not None
    speed = np.full(count, np.nan) if recording.speed is None else recording.speed
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
        reference=np.column_stack([recording.signal, speed]) if closed else None,
    )


@dataclass(frozen=True)
class Worth:
    """How well a model does on some records.

    Attributes
    ----------
    free_run : float
        FIT of the free run in percent, mean over outputs and records. On a plant that integrates, a
        constant or a disturbance of a few percent makes it drift far off.
    force : float
        Error of the drive's force for the measured motion, in percent of that force.
    """

    free_run: float
    force: float


def worth(model: Any, records: Sequence[Any]) -> Worth:
    """Hold a model against records.

    Parameters
    ----------
    model : Model
    records : sequence of Record

    Returns
    -------
    Worth
    """
    from idloop.diagnose.errors import model_errors

    errors = model_errors(model, records)
    force = math.nan if errors["force"] is None else 100.0 * errors["force"]
    fit = list(errors["fit"].values())
    return Worth(float(np.mean(fit)) if fit else math.nan, force)


# -- what a ladder made of it -----------------------------------------------------------------


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
    """What `idloop.diagnose.refine` answered.

    Attributes
    ----------
    ladder : Ladder
    rungs : tuple of Rung
    missed : dict
        Hidden effects that were not named: p-value and testability as the tool gave them at its end.
    seconds : float
    worth : dict
        `Worth` on validation records by model.
    """

    ladder: Any
    rungs: tuple[Rung, ...]
    missed: dict[str, str]
    seconds: float
    worth: dict[str, Worth] = field(default_factory=dict)

    @property
    def right(self) -> bool:
        """All hidden effects named, if only in a set, and nothing else."""
        return not self.missed and all(rung.hidden is not None for rung in self.rungs)

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            "right": self.right,
            "rungs": [
                {
                    "found": rung.name,
                    "set": list(rung.set),
                    "p_value": rung.p_value,
                    "hidden": rung.hidden,
                    "how": rung.how,
                    "parameters": {
                        e.name: {"value": e.value, "stderr": e.stderr, "true": e.true, "unit": e.unit}
                        for e in rung.estimates
                    },
                }
                for rung in self.rungs
            ],
            "missed": self.missed,
            "verdict": self.ladder.verdict,
            "criterion": self.ladder.criterion,
            "validation": {name: asdict(w) for name, w in self.worth.items()},
            "seconds": round(self.seconds, 1),
        }


def climb(
    start: Any, truth: Any, training: Sequence[Any], validation: Sequence[Any], level: float, tell: Tell
) -> Answer:
    """Refine the start model and hold the answer against the truth.

    Parameters
    ----------
    start, truth : Model
    training, validation : sequence of Record
    level : float
        Family-wise error rate.
    tell : callable
        Share done and a text.

    Returns
    -------
    Answer
    """
    from idloop.diagnose import refine

    begin = time.perf_counter()
    so_far: list[str] = []

    def report(share: float, text: str) -> None:
        tell(share, "; ".join([*so_far, text]))

    def on_step(ladder: Any) -> None:
        so_far[:] = [f"found {', '.join(ladder.added)}"]

    ladder = refine(start, training, validation, level=level, progress=report, on_step=on_step)
    return answer(ladder, truth, time.perf_counter() - begin)


def answer(ladder: Any, truth: Any, seconds: float) -> Answer:
    """Hold a ladder against the truth.

    Parameters
    ----------
    ladder : Ladder
    truth : Model
    seconds : float
        That it took.

    Returns
    -------
    Answer
    """
    hidden = list(truth.effect_names)
    rungs = []
    for step in ladder.steps[1:]:
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


def _estimates(model: Any, truth: Any, effect: str) -> tuple[Estimate, ...]:
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


def _true_values(truth: Any) -> dict[str, float]:
    """Parameters of the hidden effects; a constant at the command is one at the driven body, and the reverse."""
    values: dict[str, float] = {k: float(v) for k, v in truth.values.items() if "@" in k}
    body = truth.bodies[0]
    offset = values.get("input_offset@input.offset")
    if offset is not None:
        values.setdefault(f"load_torque@{body}.torque", offset * float(truth.values["drive.gain"]))
    return values


# -- words --------------------------------------------------------------------------------------


def table(heads: Sequence[str], rows: Sequence[Sequence[str]], indent: str = "  ") -> str:
    """Columns under their heads: words stand to the left, numbers to the right."""
    cells = [list(heads), *[list(row) for row in rows]]
    widths = [max(len(row[i]) for row in cells) for i in range(len(heads))]
    words = [any(row[i][:1].isalpha() for row in rows) for i in range(len(heads))]

    def text(row: Sequence[str]) -> str:
        parts = [c.ljust(w) if left else c.rjust(w) for c, w, left in zip(row, widths, words, strict=True)]
        return (indent + "  ".join(parts)).rstrip()

    return "\n".join([text(cells[0]), indent + "-" * (sum(widths) + 2 * len(widths) - 2), *map(text, cells[1:])])


def rung_rows(found: Answer) -> list[list[str]]:
    """Rows of `RUNG_HEADS`: one line a rung, further parameters and missed effects below."""
    rows = []
    for rung in found.rungs:
        tie = ", ".join(name for name in rung.set if name != rung.name) or "-"
        first = [rung.hidden or "-", rung.name, tie, f"{rung.p_value:.1g}"]
        for estimate in rung.estimates or (None,):
            rows.append([*first, *_estimate_cells(estimate)])
            first = ["", "", "", ""]
    rows += [[name, f"missed ({why})", "-", "-", *[""] * 4] for name, why in found.missed.items()]
    return rows or [["-", "nothing", "-", "-", *[""] * 4]]


def worth_rows(found: Mapping[str, Worth]) -> list[list[str]]:
    """Rows of a model, its FIT and its force error."""
    return [[name, *(f"{v:.1f}" for v in (w.free_run, w.force))] for name, w in found.items()]


RUNG_HEADS = ("hidden", "found", "cannot be told from", "p", "parameter", "value", "stderr", "true")


def _estimate_cells(estimate: Estimate | None) -> list[str]:
    if estimate is None:
        return [""] * 4
    name = f"{estimate.name} [{estimate.unit}]" if estimate.unit else estimate.name
    return [name, *(f"{v:.4g}" if math.isfinite(v) else "-" for v in (estimate.value, estimate.stderr, estimate.true))]


def plain_numbers(value: Any) -> Any:
    """The same document with None for what is no number, as JSON needs it."""
    if isinstance(value, Mapping):
        return {str(k): plain_numbers(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain_numbers(v) for v in value]
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    return value
