"""The ladder: a model that gains one missing effect at a time until nothing significant is left."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from idloop.api.result import Progress, Result, as_records, ignore_progress
from idloop.api.single_thread import single_threaded
from idloop.diagnosis import Ladder as Steps
from idloop.diagnosis import add_effect
from idloop.diagnosis import refine as climb
from idloop.diagnosis.equivalence.equivalent_effects import equivalent_effects_of_ladder
from idloop.diagnosis.options import MINIMUM_IMPROVEMENT
from idloop.reporting.estimates import parameter_estimates
from idloop.reporting.ladder_folder import Kept, check_target, write_all, write_report
from idloop.reporting.plots.diagnosis import plot_ladder
from idloop.reporting.residual_findings import ResidualFinding, findings_on_records
from idloop.reporting.text.blocks import Block
from idloop.reporting.text.diagnosis import ladder_blocks, parameter_blocks
from idloop.reporting.verdicts import conclusion, scope_text, undetectable

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from idloop.diagnosis import Step
    from idloop.physics import Model
    from idloop.records import Record


@dataclass(frozen=True)
class Ladder(Result):
    """Steps from the start model to the last one, and what is left.

    Attributes
    ----------
    climbed : idloop.diagnosis.Ladder
        Steps, verdict, candidates, what the data cannot show.
    records, validation : tuple of Record
        What was fitted, and what no fit has seen.
    remainders : tuple of ResidualFinding
        Residual tests of the last model on the fitted records.
    """

    climbed: Steps
    records: tuple[Record, ...] = field(repr=False)
    validation: tuple[Record, ...] = field(default=(), repr=False)
    remainders: tuple[ResidualFinding, ...] = field(default=(), repr=False)

    @property
    def model(self) -> Model:
        """The model of the last step, fitted."""
        return self.climbed.model

    @property
    def steps(self) -> tuple[Step, ...]:
        """The steps; the first is the start."""
        return self.climbed.steps

    @property
    def added(self) -> tuple[str, ...]:
        """Names of the added effects as ``name@site``, in their order."""
        return self.climbed.added

    @property
    def verdict(self) -> str:
        """``adequate``, ``unknown_structure``, ``not_excited``, or ``missing`` where it was stopped before its end."""
        return self.climbed.verdict

    def blocks(self) -> Iterator[Block]:
        """Yield the table of steps, the verdict, and the parameters of the last model."""
        yield from ladder_blocks(self.climbed, self.remainders)
        yield from parameter_blocks(self.climbed)

    def plot(self) -> Figure:
        """Draw the error of every step, on fitted and on unseen records."""
        return plot_ladder(self.climbed)

    def to_dict(self) -> dict[str, Any]:
        """Return the document of schema ``idloop/refine/1``."""
        return {
            **self.climbed.to_dict(),
            "parameters": parameter_estimates(self.model),
            "residual": [one.to_dict() for one in self.remainders],
            "conclusion": conclusion(self.climbed, self.remainders, scope_text(self.climbed)),
            "one_equation": [group.to_dict() for group in equivalent_effects_of_ladder(self.climbed)],
        }

    def undo(self) -> Ladder:
        """Return the ladder without its last step; InputError where no effect was added."""
        return _judged(self.climbed.undo(), self.records, self.validation)

    def add(self, effect: str, *, seed: int = 0, progress: Progress = ignore_progress) -> Ladder:
        """Return the ladder with one more step: an effect of the user's own choice, refitted.

        Parameters
        ----------
        effect : str
            As ``coulomb_friction@motor``, with values as ``dead_zone@input(width=0.1)``.
        seed : int
        progress : callable, optional

        Raises
        ------
        InputError
            Unknown effect, or one at a site that it does not fit.
        """
        longer = add_effect(self.climbed, effect, self.records, self.validation, seed=seed, progress=progress)
        return _judged(longer, self.records, self.validation)

    def report(self, path: str | Path, *, progress: Progress = ignore_progress) -> Path:
        """Write the report: one HTML page that loads nothing from elsewhere.

        Parameters
        ----------
        path : str or Path
        progress : callable, optional
        """
        from idloop.reporting.page.contents import gather

        contents = gather(self.climbed, self.records, self.validation, progress=progress)
        write_report(contents, Path(path))
        return Path(path)

    def save(self, folder: str | Path) -> Path:
        """Write model.yaml, ladder.json, the figures and the report; `idloop refine --resume` goes on from there.

        Raises
        ------
        InputError
            The folder holds a ladder already, or cannot be written.
        """
        target = Path(folder)
        check_target(target, "folder", overwrite=False)
        write_all(target, Kept(self.climbed), self.records, self.validation)
        return target


def _judged(climbed: Steps, records: Sequence[Record], validation: Sequence[Record]) -> Ladder:
    # An effect that was found later, or ties with one, is not what the data cannot show.
    climbed = replace(climbed, untestable=tuple(undetectable(climbed)))
    return Ladder(climbed, tuple(records), tuple(validation), tuple(findings_on_records(climbed.model, records)))


@single_threaded
def refine(
    model: Model,
    records: Record | Iterable[Record],
    validate: Record | Iterable[Record] = (),
    *,
    level: float = 0.01,
    minimum_improvement: float = MINIMUM_IMPROVEMENT,
    effects: Sequence[str] | None = None,
    criterion: str = "auto",
    most: int = 8,
    seed: int = 0,
    start: Ladder | None = None,
    on_step: Callable[[Steps], None] | None = None,
    progress: Progress = ignore_progress,
) -> Ladder:
    """Add the effects that a model lacks one by one, until nothing significant is left in the records.

    Parameters
    ----------
    model : Model
    records, validate : Record or iterable of Record
        What is fitted, and what judges every step without being fitted.
    level : float
        Probability at each step of adding an effect where none is missing.
    minimum_improvement : float
        Part by which an effect must reduce the errors on unseen samples to be added.
    effects : sequence of str, optional
        Choose from these only (``name`` or ``name@site``).
    criterion : {"auto", "prediction", "simulation", "force"}
        What the models are measured by.
    most : int
        Most effects to add.
    seed : int
        Equal seeds give equal answers.
    start : Ladder, optional
        Go on from this one.
    on_step : callable, optional
        Called with the `idloop.diagnosis.Ladder` after every step.
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
    >>> idloop.refine(model, record, effects=["dead_zone", "coulomb_friction"]).added
    ('dead_zone@input',)
    """
    train, validation = as_records(records), as_records(validate)
    climbed = climb(
        model, train, validation, level=level, criterion=criterion, minimum_improvement=minimum_improvement,
        effects=effects, seed=seed, most=most, ladder=None if start is None else start.climbed, progress=progress,
        on_step=on_step,
    )  # fmt: skip
    progress(1.0, "testing what is left of the records")
    return _judged(climbed, train, validation)
