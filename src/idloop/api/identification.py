"""Black-box models by any method, judged on the same data."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from idloop.api.result import Progress, Result, as_records, ignore_progress
from idloop.api.single_thread import single_threaded
from idloop.errors import IdloopError, InputError
from idloop.reporting.text.blocks import Block
from idloop.reporting.text.identification import (
    details_blocks,
    distortion_blocks,
    followed_blocks,
    loop_text,
    notes_blocks,
    outcomes_blocks,
    responses_blocks,
)
from idloop.validation.identification_outcome import Outcome, on_the_same_samples

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from idloop.estimation.black_box.method import Choices
    from idloop.estimation.black_box.sampled import SampledData
    from idloop.estimation.linear import LinearModel
    from idloop.records import Record

# What a model is identified from, and what it is judged on.
Grids = tuple[list["SampledData"], list["SampledData"]]

_FINEST = 0.95  # of a record's own sample time: less is no rounding of it


@dataclass(frozen=True)
class Identification(Result):
    """Models that several methods identified from the same records.

    Attributes
    ----------
    outcomes : tuple of Outcome
        One for each method: model, scores, information criteria, or why there is none.
    judged : tuple of SampledData
        What the models were judged on.
    steps : int
        Samples that the second score predicts ahead.
    document : dict
        Records, loop and settings for `to_dict`.
    """

    outcomes: tuple[Outcome, ...]
    judged: tuple[SampledData, ...] = field(repr=False)
    steps: int = 10
    document: dict[str, Any] = field(default_factory=dict, repr=False)

    @property
    def model(self) -> Any:
        """Model of the first method: linear, network, frequency response or impulse response."""
        found = self.outcomes[0].found
        if found is None:
            raise IdloopError(f"{self.outcomes[0].label}: {self.outcomes[0].error}")
        return found.model

    @property
    def linear(self) -> LinearModel | None:
        """Linear model of the first method; None where it gave another kind."""
        found = self.outcomes[0].found
        return None if found is None else found.linear

    @property
    def fit(self) -> dict[str, dict[str, float]]:
        """FIT of the free run in percent, by method and output."""
        return {
            one.label: dict(zip(one.score.output_names, map(float, one.score.free_run), strict=True))
            for one in self.outcomes
            if one.score is not None
        }

    def blocks(self) -> Iterator[Block]:
        """Yield scores, responses, poles of a single linear model, the loop, and notes."""
        yield f"{self.document['title']}, every {self.judged[0].sample_time * 1e3:.6g} ms"
        yield ""
        yield from outcomes_blocks(self.outcomes, self.steps)
        yield from responses_blocks(self.outcomes)
        yield from distortion_blocks(self.outcomes)
        yield from followed_blocks(self.outcomes)
        if len(self.outcomes) == 1:
            yield from details_blocks(self.outcomes[0])
        yield ""
        if self.document["loop"]["note"]:
            yield self.document["loop"]["note"]
        yield from notes_blocks(self.outcomes)

    def plot(self) -> Figure:
        """Draw the models on the data that judge them, with Bode plots and responses."""
        from idloop.reporting.plots.identification import Drawn, plot_identification

        drawn = [Drawn(one.label, one.found, one.score) for one in self.outcomes if one.found is not None]
        return plot_identification(drawn, list(self.judged), self.document["title"])

    def to_dict(self) -> dict[str, Any]:
        """Return the document of schema ``idloop/identify/1``."""
        document = {name: value for name, value in self.document.items() if name != "title"}
        results = [one.to_dict() for one in self.outcomes]
        return {**document, "sample_time": self.judged[0].sample_time, "results": results}

    def save(self, path: str | Path) -> Path:
        """Write the model of the first method: ``.json``, a linear one also ``.npz``."""
        from idloop.estimation import linear, networks

        if isinstance(self.model, networks.NarxModel):
            networks.save(self.model, Path(path))
        else:
            linear.save(self.model, Path(path))
        return Path(path)


def even_grids(
    records: Sequence[Record],
    sample_time: float,
    detrend: Literal["none", "mean", "linear"] = "none",
    drop: float = 0.0,
) -> list[SampledData]:
    """Cut records, remove their trends, and put them on one even grid.

    `sample_time`: [s]; not below that of a record.
    `detrend`: of each record by itself.
    `drop`: seconds left out at both ends.
    Raises InputError: a finer grid than the record's, or nothing left of it.
    """
    from idloop.estimation.black_box.sampled import sampled

    stretches: list[SampledData] = []
    for record in records:
        if sample_time < _FINEST * record.sample_time:
            raise InputError(
                f"{record.name}: --sample-time {sample_time:g}, but the record has a sample every"
                f" {record.sample_time:.4g} s and nothing between; take that or more"
            )
        length = float(record.time[-1] - record.time[0])
        if drop and 2.0 * drop >= length:
            raise InputError(
                f"{record.name}: --drop {drop:g}: nothing left after that at both ends: the record is {length:.4g} s"
                f" long, drop less than {0.5 * length:.4g}"
            )
        kept = record.drop(drop, drop) if drop else record
        level = kept if detrend == "none" else kept.detrend(detrend)
        stretches += sampled(level, sample_time)
    return stretches


def identify_one(name: str, data: Grids, choices: Choices, steps: int, progress: Progress) -> Outcome:
    """Identify by one method and judge the model. Raises IdloopError: the method cannot use the data."""
    from idloop.estimation.black_box.identification import identify as identify_by
    from idloop.estimation.black_box.identification import information
    from idloop.estimation.black_box.methods import find_method
    from idloop.validation.score import score

    train, judged = data
    own = {degree: number for degree, number in choices.structure.items() if degree in find_method(name).polynomials}

    found = identify_by(train, name, replace(choices, structure=own), progress)
    if not found.predicts:
        return Outcome(name, found)
    model: Any = found.model
    return Outcome(name, found, score(model, judged, steps), information(found, train))


def identify_all(names: Sequence[str], data: Grids, choices: Choices, steps: int, progress: Progress) -> list[Outcome]:
    """Identify by every method; a failure of one of several is its outcome.

    Raises IdloopError: the only method failed.
    """
    outcomes = []
    for index, name in enumerate(names):

        def tell(fraction: float, note: str, index: int = index, name: str = name) -> None:
            progress((index + fraction) / len(names), f"{name} {note}")

        tell(0.0, "")
        try:
            outcomes.append(identify_one(name, data, choices, steps, tell))
        except IdloopError as error:
            if len(names) == 1:
                raise
            outcomes.append(Outcome(name, error=str(error)))
    return on_the_same_samples(outcomes)


def describe(
    names: Iterable[str],
    train: Sequence[Record],
    unseen: Sequence[Record],
    data: Sequence[SampledData],
    choices: Choices,
    **settings: Any,
) -> dict[str, Any]:
    """What an identification was made from, for `Identification.to_dict`; and which methods a closed loop biases.

    `data`: `train` on an even grid.
    `settings`: how it was made.
    """
    from idloop.estimation.black_box.methods import find_method
    from idloop.estimation.feedback import closed_loop_methods, detect_feedback, handles_feedback

    loop = detect_feedback(data)
    biased = [name for name in names if loop.closed and not handles_feedback(find_method(name), choices)]
    judged = ", ".join(record.name for record in unseen or train)
    return {
        "schema": "idloop/identify/1",
        "title": f"{'unseen' if unseen else 'fitted'}: {judged}",
        "records": [record.name for record in train],
        "validation": [record.name for record in unseen],
        "judged_on": "validation" if unseen else "train",
        "input": train[0].input_name,
        "outputs": list(train[0].output_names),
        **settings,
        "loop": loop.to_dict()
        | {
            "biased_methods": biased,
            "suitable_methods": list(closed_loop_methods(loop)) if loop.closed else [],
            "note": loop_text(loop, biased),
        },
    }


def grids_of(
    train: Sequence[Record], unseen: Sequence[Record], detrend: Literal["none", "mean", "linear"], drop: float
) -> Callable[[float], Grids]:
    """Function from a sample time [s] to both sets of records on that grid."""

    def grids(period: float) -> Grids:
        fitted = even_grids(train, period, detrend, drop)
        return fitted, even_grids(unseen, period, detrend, drop) if unseen else fitted

    return grids


@single_threaded
def identify(
    records: Record | Iterable[Record],
    methods: str | Sequence[str] = "n4sid",
    validate: Record | Iterable[Record] = (),
    *,
    sample_time: float | None = None,
    detrend: Literal["none", "mean", "linear"] = "none",
    drop: float = 0.0,
    steps: int = 10,
    progress: Progress = ignore_progress,
    **choices: Any,
) -> Identification:
    """Identify black-box models from all records together, by one or several methods.

    Parameters
    ----------
    records, validate : Record or iterable of Record
        What the models are identified from; what judges them, the records themselves when left out.
    methods : str or sequence of str
        Names of ``idloop identify --list``.
    sample_time : float, optional
        Even grid to identify on [s]; the record's own when left out.
    detrend : {"none", "mean", "linear"}
        What is removed from command and outputs of each record.
    drop : float
        Seconds left out at both ends of a record.
    steps : int
        Samples that the second score predicts ahead.
    progress : callable, optional
        Called with the share done in [0, 1] and a short text.
    **choices
        Fields of `idloop.estimation.black_box.method.Choices`: ``order``, ``delay``, ``structure``, ``horizon``,
        ``window``, ``period``, ``units``, ``focus``, ``band``, ``stable``, ``integrates``, ``closed_loop``,
        ``controller``, ``seed``.

    Raises
    ------
    InputError
        Unknown method or choice, or records that it cannot use.
    IdloopError
        The only method failed.

    Examples
    --------
    >>> import idloop
    >>> model = idloop.load_model("dc_motor")
    >>> record = idloop.simulate(model, idloop.excitation("prbs", sample_time=0.05, duration=60.0))
    >>> idloop.identify(record, "n4sid", order=2).linear.order
    2
    """
    from idloop.estimation.black_box.method import Choices
    from idloop.estimation.black_box.methods import find_method
    from idloop.spelling import check_known

    names = [methods] if isinstance(methods, str) else list(methods)
    for name in names:
        find_method(name)
    known = tuple(Choices.__dataclass_fields__)
    for choice in choices:
        check_known(choice, known, "identify: no choice", 20)
    chosen = Choices(**choices)
    train, unseen = as_records(records), as_records(validate)
    # Stamps are whole nanoseconds: 20 ms is to be 0.02 s, for a controller of that period to fit.
    data = grids_of(train, unseen, detrend, drop)(sample_time or round(train[0].sample_time, 9))
    document = describe(names, train, unseen, data[0], chosen, detrend=detrend, steps=steps)
    return Identification(tuple(identify_all(names, data, chosen, steps, progress)), tuple(data[1]), steps, document)
