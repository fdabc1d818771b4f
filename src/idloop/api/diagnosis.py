"""Which physical effect a model lacks, ranked by the evidence on samples that no fit has seen."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from idloop.api.result import Progress, Result, as_records, ignore_progress, part
from idloop.api.single_thread import single_threaded
from idloop.diagnosis import diagnose as find_missing
from idloop.diagnosis.model_errors import model_errors
from idloop.diagnosis.worsened import Worsened, worsened
from idloop.reporting.plots.diagnosis import plot_diagnosis
from idloop.reporting.residual_findings import ResidualFinding, findings_on_records
from idloop.reporting.text.blocks import Block
from idloop.reporting.text.diagnosis import diagnosis_blocks

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from idloop.diagnosis import Candidate
    from idloop.diagnosis import Diagnosis as Found
    from idloop.physics import Model
    from idloop.records import Record


@dataclass(frozen=True)
class Diagnosis(Result):
    """What a model lacks to explain its records.

    Attributes
    ----------
    found : idloop.diagnosis.Diagnosis
        Candidates, ties, verdict, what the data can show.
    records : tuple of Record
    remainders : tuple of ResidualFinding
        Residual tests of the model as it is.
    worse : tuple of Worsened
        The missing effect, where the free run is worse with it.
    errors : dict
        Of the model as it is, as a step of a ladder has them.
    """

    found: Found
    records: tuple[Record, ...]
    remainders: tuple[ResidualFinding, ...] = ()
    worse: tuple[Worsened, ...] = ()
    errors: dict[str, Any] = field(default_factory=dict)

    @property
    def missing(self) -> tuple[str, ...]:
        """The missing effect as ``name@site``; two that show only together; empty where none is named."""
        if self.found.best is None:
            return ()
        return tuple(self.found.pair or (self.found.best.name,))

    @property
    def ties(self) -> tuple[str, ...]:
        """Effects that this data cannot tell from the missing one, itself included."""
        return self.found.set

    @property
    def verdict(self) -> str:
        """``missing``, ``adequate``, ``unknown_structure`` or ``not_excited``."""
        return self.found.verdict

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """Every effect that was weighed, the best first."""
        return self.found.candidates

    @property
    def model(self) -> Model:
        """The model with the missing effect, fitted; the fitted model itself where none is named."""
        best = self.found.best
        return self.found.model if best is None or best.model is None else best.model

    def blocks(self, *, everything: bool = False) -> Iterator[Block]:
        """Yield the ranked table, ties and verdict; with `everything` also effects that were only screened."""
        return diagnosis_blocks(self.found, self.remainders, self.worse, self.errors, everything=everything)

    def plot(self) -> Figure:
        """Draw the missing effect on the data that ask for it; the share that each effect explains where none is."""
        return plot_diagnosis(self.found, self.records)

    def to_dict(self) -> dict[str, Any]:
        """Return the document of schema ``idloop/diagnose/1``."""
        return {
            **self.found.to_dict(),
            "residual": [one.to_dict() for one in self.remainders],
            "worsened": [one.to_dict() for one in self.worse],
        }


@single_threaded
def diagnose(
    model: Model,
    records: Record | Iterable[Record],
    *,
    validate: Record | Iterable[Record] = (),
    level: float = 0.01,
    minimum_improvement: float = 0.01,
    effects: Sequence[str] | None = None,
    criterion: str = "auto",
    seed: int = 0,
    progress: Progress = ignore_progress,
) -> Diagnosis:
    """Name the physical effect that a model lacks to explain all records.

    Parameters
    ----------
    model : Model
    records : Record or iterable of Record
        Several amplitudes tell more than one.
    validate : Record or iterable of Record
        Not seen by the fits: what does not reduce the errors there as well is listed, not named.
    level : float
        Probability of naming an effect where none is missing, over the whole catalogue.
    minimum_improvement : float
        Part by which an effect must reduce the errors on unseen samples to be named.
    effects : sequence of str, optional
        Choose from these only (``name`` or ``name@site``).
    criterion : {"auto", "prediction", "simulation", "force"}
        What the models are measured by.
    seed : int
        Equal seeds give equal answers.
    progress : callable, optional
        Called with the share done in [0, 1] and a short text.

    Raises
    ------
    InputError
        Bad level or improvement, unknown effects, records that do not suit the model.

    Examples
    --------
    >>> import idloop
    >>> model = idloop.load_model("dc_motor")
    >>> machine = model.with_effect("dead_zone", "input", width=0.3)
    >>> record = idloop.simulate(machine, idloop.excitation("rgs", sample_time=0.01, duration=30.0))
    >>> idloop.diagnose(model, record, effects=["dead_zone", "coulomb_friction"]).missing
    ('dead_zone@input',)
    """
    known = as_records(records)
    found = find_missing(
        model,
        known,
        as_records(validate),
        level=level,
        criterion=criterion,
        minimum_improvement=minimum_improvement,
        effects=effects,
        seed=seed,
        progress=part(progress, 0.0, 0.9),
    )
    progress(0.9, "residual tests")
    errors, worse = model_errors(found.model, known), list[Worsened]()
    best = found.best
    if best is not None and best.model is not None:
        names = ["", " with ".join(found.pair or (best.name,))]
        worse = worsened(names, [errors, model_errors(best.model, known)], unseen=False)
    return Diagnosis(found, tuple(known), tuple(findings_on_records(found.model, known)), tuple(worse), errors)
