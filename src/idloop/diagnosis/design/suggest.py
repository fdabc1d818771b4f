"""The next experiment: within limits, the one that best separates rival models.

Its value is the log-likelihood by which the right model is expected to lead the closest other one: each rival in turn
is taken as the truth, and the others are refitted to its simulated response.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from idloop.diagnosis.design.expected_outcome import Outcome, describe, describe_visible, outcomes_of
from idloop.diagnosis.design.experiment import COMMAND, REFERENCE, Experiment, Setup
from idloop.diagnosis.design.limits import Limits, follows_reference, motion
from idloop.diagnosis.design.rival_set import check_signals, prepare_rivals
from idloop.diagnosis.design.rivals import Rival
from idloop.diagnosis.design.search import Choice, Search
from idloop.diagnosis.options import Progress, silent
from idloop.errors import IdloopError, InputError
from idloop.estimation.dataset import output_noise, prepare
from idloop.signals.base import LONGEST

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from idloop.physics import Model
    from idloop.records import Record

__all__ = ["Limits", "Outcome", "Suggestion", "suggest"]

SCHEMA = "idloop/suggest/1"


@dataclass(frozen=True)
class Suggestion:
    """An experiment and what to expect of it.

    Attributes
    ----------
    signal : dict
        For ``build_signal(**signal)``.
    adds_to : {"command", "reference"}
        Where the signal goes; the reference is held at `start` otherwise.
    duration : float
        [s]
    discrimination : float
        Expected difference in log-likelihood of the two closest rivals: geometric mean of the cases that the
        one and that the other is right. Against a first rival: geometric mean over the others, each up to 100.
    outcomes : tuple of Outcome
        What to expect if each rival is right.
    text : str
        One or two sentences.
    limits : Limits
        Within which it was chosen.
    start : float
        Position at rest at which it begins [position unit].
    controller : dict or None
        Of the loop that it was computed for.
    sample_time : float
        Of the measurements [s].
    rivals : tuple of (str, Model)
        What sets each rival apart, as in `outcomes`, and the rival itself; for the figure, not in `to_dict`.
    noise : tuple of float
        Standard deviation of each output's measurement noise [output unit]; likewise.
    against_first : bool
        Whether every rival is compared with the first one only; likewise.
    """

    signal: dict[str, Any]
    adds_to: str
    duration: float
    discrimination: float
    outcomes: tuple[Outcome, ...]
    text: str
    limits: Limits
    start: float
    controller: dict[str, Any] | None
    sample_time: float
    rivals: tuple[tuple[str, Model], ...] = field(repr=False)
    noise: tuple[float, ...] = field(repr=False)
    against_first: bool = False

    @property
    def experiment(self) -> Experiment:
        """To simulate it with any model."""
        return Experiment(self.signal, self.adds_to, self.controller, self.start, self.sample_time)

    @property
    def unit(self) -> str:
        """Of the signal: that of the command, or of what the controller follows."""
        model = self.rivals[0][1]
        if self.adds_to == "command":
            return model.input.unit
        followed = (model.controller or {}).get("output")
        units = {output.name: output.unit for output in model.outputs}
        return units.get(str(followed), model.units.position)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {
            "signal": dict(self.signal),
            "adds_to": self.adds_to,
            "unit": self.unit,
            "duration": self.duration,
            "discrimination": self.discrimination,
            "outcomes": [outcome.to_dict() for outcome in self.outcomes],
            "text": self.text,
            "limits": self.limits.to_dict(),
            "start": self.start,
        }


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def suggest(
    rivals: Sequence[Model],
    records: Sequence[Record],
    limits: Limits | None = None,
    *,
    duration: float | None = None,
    criterion: str = "auto",
    seed: int = 0,
    start: float | None = None,
    adds_to: str | None = None,
    against_first: bool = False,
    progress: Progress | None = None,
) -> Suggestion:
    """Choose the experiment that best separates rival models.

    Parameters
    ----------
    rivals : sequence of Model
        Two or more, each fitted to the records.
    records : sequence of Record
        The data so far.
    limits : Limits, optional
        What the experiment may do; what is not given is the largest seen in the records.
    duration : float, optional
        Length [s]; chosen when left out.
    criterion : str
        What rivals are compared by, as in `idloop.diagnosis.diagnose`.
    seed : int
        Equal seeds give equal suggestions.
    start : float, optional
        Position at which the axis will rest before [position unit]; where the last record starts by default.
    adds_to : {"command", "reference"}, optional
        By default the reference when one was recorded, else the command.
    against_first : bool
        Compare every rival with the first one only: which of many effects exists at all?
    progress : callable, optional
        Called with the share done in [0, 1] and a short text.

    Raises
    ------
    InputError
        Fewer than two rivals, rivals that do not suit each other or the records, a closed loop without its
        controller, or limits within which nothing can move.
    """
    if len(rivals) < 2:
        raise InputError("a suggestion needs at least two rival models to tell apart")
    report = progress or silent
    report(0.0, "reading the data so far")
    setup = prepare_setup(rivals, records, limits, duration=duration, seed=seed, start=start, adds_to=adds_to)
    prepared = prepare_rivals(rivals, records, criterion)
    search = Search(
        prepared, setup, duration, lambda share, text: report(0.05 + 0.9 * share, text), against_first=against_first
    )
    choice = search.best()
    if choice is None:
        raise InputError("limits: no experiment keeps every rival inside them; widen the position range or velocity")
    report(0.97, "expected outcomes")
    noise = output_noise(prepared[0].model, prepare(prepared[0].model, records))
    return _suggestion(prepared, setup, choice, noise, against_first=against_first)


def _suggestion(
    rivals: Sequence[Rival], setup: Setup, choice: Choice, noise: NDArray[np.float64], *, against_first: bool
) -> Suggestion:
    experiment = setup.experiment(choice.design, choice.level, choice.duration)
    outcomes = outcomes_of(rivals, experiment, choice.gains, against_first=against_first)
    return Suggestion(
        dict(experiment.signal),
        setup.adds_to,
        experiment.duration,
        float(choice.score),
        outcomes,
        describe_visible(outcomes)
        if against_first
        else describe(rivals, experiment, setup.limits, choice.score, choice.gains),
        setup.limits,
        setup.start,
        dict(setup.controller) if setup.controller is not None else None,
        setup.sample_time,
        tuple((rival.label, rival.model) for rival in rivals),
        tuple(map(float, noise)),
        against_first,
    )


def detect_feedback(
    model: Model, records: Sequence[Record], adds_to: str | None = None
) -> tuple[str, Mapping[str, Any] | None]:
    """What an experiment is added to, "command" or "reference", and the controller that acts then.

    By default as in the records. An `InputError` where the loop was closed and the model states no controller.
    """
    closed = any(follows_reference(record) for record in records)
    target = adds_to or (REFERENCE if closed else COMMAND)
    controller: Mapping[str, Any] | None = model.controller if closed or target == REFERENCE else None
    if target == REFERENCE and controller is None:
        output = model.output_names[0]
        raise InputError(
            f"model {model.name}: the records follow a reference, and so will the next experiment: add the controller"
            f" that ran to the model file, for example `controller: {{type: p, output: {output}, kp: 1.0,"
            f" sample_time: {records[0].sample_time:.4g}}}`"
        )
    return target, controller


def prepare_setup(
    models: Sequence[Model],
    records: Sequence[Record],
    limits: Limits | None = None,
    *,
    duration: float | None = None,
    seed: int = 0,
    start: float | None = None,
    adds_to: str | None = None,
) -> Setup:
    """Where the experiment is to be run; what can be refused without a fit is refused here.

    The values of the models do not count; the other arguments are those of `suggest`. An `InputError` for models with
    different signals, a closed loop without its controller or with one that reads what is not measured, and a start
    or a duration that is out of range.
    """
    check_signals(models)
    if start is not None and not np.isfinite(start):
        raise InputError(f"start is {start}; give the position at which the axis will rest")
    setup = _setup(models[0], records, limits or Limits(), start, adds_to, seed)
    if duration is not None and not 1 <= round(duration / setup.signal_time) <= LONGEST:
        raise InputError(
            f"duration is {duration:g} s, the signal has a sample every {setup.signal_time:g} s:"
            f" give it 1 to {LONGEST} samples"
        )
    Experiment({}, setup.adds_to, setup.controller, setup.start, setup.sample_time).check_controller(models[0])
    return setup


def _setup(
    model: Model,
    records: Sequence[Record],
    limits: Limits,
    start: float | None,
    adds_to: str | None,
    seed: int,
) -> Setup:
    target, controller = detect_feedback(model, records, adds_to)
    step = float(np.median([record.sample_time for record in records]))
    complete = limits.completed(model, records)
    if start is None:
        place, _ = motion(model, records[-1])
        start = float(np.mean(place[:3])) if place.size and _measures_position(model) else 0.0
    if complete.position is not None:
        start = float(np.clip(start, *complete.position))
    signal_time = step
    if controller is not None:
        signal_time = float(controller["sample_time"])
    else:
        periods = np.concatenate([np.diff(record.input_time) for record in records])
        period = float(np.median(periods)) if len(periods) else step
        if 0.05 * step <= period <= 20.0 * step:
            signal_time = period
    return Setup(
        target, dict(controller) if controller is not None else None, start, _without_jitter(signal_time),
        _without_jitter(step), complete, limits.velocity if target == REFERENCE else None, seed,
    )  # fmt: skip


def _measures_position(model: Model) -> bool:
    return any(output.field == "position" for output in model.outputs)


def _without_jitter(seconds: float) -> float:
    """Sample time without the jitter of stamps."""
    value = float(f"{seconds:.3g}")
    if value <= 0.0:
        raise IdloopError("the records have no sample time")
    return value
