"""Row B7: the measure of fit of the torsion thesis, per output and averaged, on validation data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from idloop.errors import IdloopError
from papers import Progress
from papers.claim import above, below, near
from papers.reproduction import Cell, Line, Reproduction, Table
from papers.torsion import torsion_methods
from papers.torsion import torsion_thesis as thesis

Array = NDArray[np.float64]

# Of the thesis's model of choice (section 6.1): five states.
STATES = 5
PERFECT, AVERAGE, QUANSER, CHOICE = "the data itself", "the average value", "Quanser model", "N4SID+PEM, five states"


@dataclass(frozen=True, eq=False)
class FitMeasure(Reproduction):
    """FIT of some predictions of the same validation data.

    Attributes
    ----------
    names : tuple of str
        Outputs.
    time : ndarray, shape (n,)
        [s]
    measured : ndarray, shape (n, 4)
        [rad]
    predicted : dict of str to ndarray, shape (n, 4)
        [rad]
    fits : dict of str to ndarray, shape (4,)
        By `idloop.validation.fit_percent` [%].
    """

    names: tuple[str, ...]
    time: Array
    measured: Array
    predicted: Mapping[str, Array]
    fits: Mapping[str, Array]

    def rows(self) -> tuple[Line, ...]:
        """The formula, its ends, and two models."""
        place = "eq. 4.3"
        formula = max(float(np.max(np.abs(self.fits[n] - by_formula(self.measured, y)))) for n, y in
                      self.predicted.items())  # fmt: skip
        ends = {name: float(np.mean(self.fits[name])) for name in self.fits}
        return (
            Line("FIT against eq. 4.3: largest difference", formula, 0.0, "%", place, below(1e-9)),
            Line(f"FIT of {PERFECT}", ends[PERFECT], 100.0, "%", place, near(100.0, 1e-9)),
            Line(f"FIT of {AVERAGE}", ends[AVERAGE], 0.0, "%", place, near(0.0, 1e-9)),
            Line(f"{QUANSER}: average FIT", ends[QUANSER], "very poor, negative", "%", "figure 1.3", below(50.0)),
            Line(f"{CHOICE}: average FIT", ends[CHOICE], "figure 6.1", "%", "section 6.1", above(80.0)),
        )  # fmt: skip

    def tables(self) -> tuple[Table, ...]:
        """Every output and the average."""
        rows: list[tuple[Cell, ...]] = [
            (name, *(float(value) for value in fits), float(np.mean(fits))) for name, fits in self.fits.items()
        ]  # fmt: skip
        return (Table("FIT on validation data [%]", ("prediction", *self.names, "average"), rows),)

    def notes(self) -> tuple[str, ...]:
        """Data and models."""
        return (
            (
                f"{thesis.CHOSEN.name} on the simulated machine, first half to identify, second to validate; the models"
                " run free from the command, from the first state that suits the data best."
            ),
            (
                "The Quanser model knows no friction, imbalance or damping of this machine but has the preset's viscous"
                " friction, which the thesis does not print."
            ),
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {**super().to_dict(), "fits": dict(self.fits)}

    def plot(self, axes: Any = None) -> Any:
        """Draw the data and the two models, an axis for each output; returns the four axes."""
        import matplotlib.pyplot as plt

        from idloop import drawing

        shown = slice(0, min(self.time.size, round(8.0 / thesis.IDENTIFIED_EVERY)))
        with drawing.styled():
            if axes is None:
                _, axes = plt.subplots(4, 1, sharex=True, figsize=(8, 8), layout="constrained")
            for column, name in enumerate(self.names):
                degrees = np.degrees(self.measured[shown, column])
                axes[column].plot(self.time[shown], degrees, color=drawing.MEASURED, label="measured")
                for index, model in enumerate((CHOICE, QUANSER)):
                    values = np.degrees(self.predicted[model][shown, column])
                    label = f"{model}: {self.fits[model][column]:.1f} %"
                    axes[column].plot(self.time[shown], values, label=label, **drawing.model_look(index))
                axes[column].set_ylabel(drawing.label(name, "deg"))
                axes[column].legend(fontsize=7)
            axes[-1].set_xlabel(drawing.label("time", "s"))
        return axes


def by_formula(measured: Array, predicted: Array) -> Array:
    """Eq. 4.3 as it is printed, in percent, for every column."""
    mean = measured.mean(axis=0)
    return np.asarray(
        100.0 * (1.0 - np.linalg.norm(predicted - measured, axis=0) / np.linalg.norm(measured - mean, axis=0))
    )


def reproduce(seed: int, progress: Progress, length: float = thesis.LENGTH) -> FitMeasure:
    """Identify the thesis's model of choice and measure it, and three others.

    Parameters
    ----------
    seed : int
        Of the excitation.
    progress : callable
    length : float
        Of the benchmark [s], 20 or more.
    """
    from idloop.estimation.dataset import prepare
    from idloop.physics import Engine
    from idloop.validation import fit_percent
    from idloop.validation.free_run import free_run

    progress(0.0, "experiment")
    record = torsion_methods.laboratory(thesis.CHOSEN, seed + 1, length)
    _, second = torsion_methods.half_records(record)
    plant = thesis.quanser()
    progress(0.3, QUANSER)
    (data,) = prepare(plant, [second])
    quanser = free_run(Engine(plant), data)
    progress(0.5, CHOICE)
    train, validation = thesis.halves(thesis.thinned(record, filtered=True))
    choices = torsion_methods.Choices(states=STATES, iterations=10)
    model = torsion_methods.black_box(train, None, choices, (thesis.N4SID_PEM,))[thesis.N4SID_PEM]
    if model is None:
        raise IdloopError(f"{CHOICE}: no model found on a record of {length:g} s; use a longer one")
    chosen = model.simulate(validation)
    count = min(len(chosen), len(quanser))
    measured = np.asarray(data.output[:count])
    predicted = {
        PERFECT: measured,
        AVERAGE: np.broadcast_to(measured.mean(axis=0), measured.shape),
        QUANSER: quanser[:count],
        CHOICE: chosen[:count],
    }
    fits = {name: np.asarray(fit_percent(measured, values)) for name, values in predicted.items()}
    return FitMeasure(validation.output_names, validation.time[:count] - validation.start, measured, predicted, fits)
