"""The next experiment: what separates effects or models that the data so far leave open."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from idloop.api.diagnosis import Diagnosis
from idloop.api.ladder import Ladder
from idloop.api.result import Progress, Result, as_records, ignore_progress, part
from idloop.api.single_thread import single_threaded
from idloop.diagnosis import diagnose
from idloop.diagnosis.design.effect_question import find_proposal, suggest_effect
from idloop.diagnosis.design.limits import Limits
from idloop.diagnosis.design.suggest import prepare_setup
from idloop.errors import InputError
from idloop.estimation import fit
from idloop.output_files import write_text
from idloop.reporting.next_experiment import Next, experiment_text, next_of_diagnosis, next_of_ladder, next_of_models
from idloop.reporting.plots.suggestion import plot_suggestion
from idloop.reporting.text.blocks import Block

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from idloop.diagnosis.design.suggest import Suggestion as Experiment
    from idloop.physics import Model
    from idloop.records import Record


@dataclass(frozen=True)
class Suggestion(Result):
    """What is to be done next: an experiment, a check by hand, or nothing.

    Attributes
    ----------
    answer : Next
        The experiment with its expected outcomes, effects that are one equation, and why there is no experiment.
    """

    answer: Next

    @property
    def experiment(self) -> Experiment | None:
        """The experiment: signal, duration, limits, expected outcomes; None where none is worth running."""
        return self.answer.suggestion

    def blocks(self) -> Iterator[Block]:
        """Yield the experiment with what each rival would show, or why there is none."""
        yield from self.answer.blocks()

    def plot(self) -> Figure:
        """Draw what is sent in, what each rival would show, and by how much they differ.

        Raises
        ------
        InputError
            There is no experiment that is worth running.
        """
        return plot_suggestion(self._worth_running())

    def to_dict(self) -> dict[str, Any]:
        """Return the document of schema ``idloop/suggest/1``."""
        experiment = {"experiment": None} if self.experiment is None else self.experiment.to_dict()
        return {"schema": "idloop/suggest/1", **experiment, **self.answer.to_dict()}

    def save(self, path: str | Path) -> Path:
        """Write the YAML that the excitation node takes as its parameter `experiment`.

        Raises
        ------
        InputError
            There is no experiment that is worth running.
        """
        write_text(Path(path), experiment_text(self._worth_running().to_dict()))
        return Path(path)

    def _worth_running(self) -> Experiment:
        if self.experiment is None:
            raise InputError(f"there is no experiment that is worth running: {self.answer.reason}")
        return self.experiment


@single_threaded
def suggest(
    subject: Ladder | Diagnosis | Model | Sequence[Model],
    records: Record | Iterable[Record] | None = None,
    *,
    show: str | None = None,
    max_command: float | None = None,
    position_range: tuple[float, float] | None = None,
    max_velocity: float | None = None,
    duration: float | None = None,
    start: float | None = None,
    criterion: str = "auto",
    fitted: bool = False,
    seed: int = 0,
    progress: Progress = ignore_progress,
) -> Suggestion:
    """Choose the experiment that best separates what the data so far leave open, within limits.

    Parameters
    ----------
    subject : Ladder, Diagnosis, Model or sequence of Model
        A ladder or a diagnosis: its ties and what it cannot show. A model: it is diagnosed first. Several models: these
        are the rivals.
    records : Record or iterable of Record, optional
        The data so far; those of the ladder or diagnosis when left out.
    show : str, optional
        With one model: make this effect (``name@site``) visible, which the data so far do not show.
    max_command : float, optional
        Largest command [input unit]; the largest in the data when left out, as for the other limits.
    position_range : (float, float), optional
        [position unit]
    max_velocity : float, optional
        [position unit/s]
    duration : float, optional
        [s]; chosen when left out.
    start : float, optional
        Position at which the axis will rest before [position unit].
    criterion : {"auto", "prediction", "simulation", "force"}
        What rivals are compared by.
    fitted : bool
        The models are fitted to the records already.
    seed : int
        Equal seeds give equal answers.
    progress : callable, optional
        Called with the share done in [0, 1] and a short text.

    Raises
    ------
    InputError
        No records, models with different signals, a closed loop without its controller, limits that nothing can
        move in.
    """
    limits = Limits(max_command, position_range, max_velocity)
    options: dict[str, Any] = {"duration": duration, "seed": seed, "start": start}
    if isinstance(subject, Ladder | Diagnosis):
        known = list(subject.records) if records is None else as_records(records)
        model = subject.model if isinstance(subject, Ladder) else subject.found.model
        _refuse([model], known, limits, options)
        options["progress"] = progress
        if isinstance(subject, Ladder):
            return Suggestion(next_of_ladder(subject.climbed, known, limits, options))
        return Suggestion(next_of_diagnosis(subject.found, known, limits, options))
    if records is None:
        raise InputError("records are missing: give the data so far")
    known = as_records(records)
    models = list(subject) if isinstance(subject, Sequence) else [subject]
    _refuse(models, known, limits, options, show)
    if len(models) == 1 and show is None:
        first = diagnose(models[0], known, criterion=criterion, seed=seed, progress=part(progress, 0.0, 0.4))
        return Suggestion(next_of_diagnosis(first, known, limits, {**options, "progress": part(progress, 0.4, 1.0)}))
    if not fitted:
        models = _fitted(models, known, criterion, part(progress, 0.0, 0.3))
    options["progress"] = part(progress, 0.3, 1.0)
    if show is not None:
        if len(models) > 1:
            raise InputError("show takes one model: the rivals are that model with and without the effect")
        return Suggestion(Next(suggest_effect(models[0], show, known, limits, **options)))
    return Suggestion(next_of_models(models, known, limits, criterion, options, fitted=not fitted))


def _fitted(models: Sequence[Model], records: Sequence[Record], criterion: str, progress: Progress) -> list[Model]:
    found = []
    for i, model in enumerate(models):
        own = part(progress, i / len(models), (i + 1) / len(models))
        found.append(fit(model, records, criterion=criterion, progress=own).model if model.free else model)
    return found


def _refuse(
    models: Sequence[Model],
    records: Sequence[Record],
    limits: Limits,
    options: Mapping[str, Any],
    show: str | None = None,
) -> None:
    """Raise now what would be raised after long work."""
    prepare_setup(models, records, limits, **{key: options[key] for key in ("duration", "seed", "start")})
    if show is not None:
        find_proposal(models[0], show)
