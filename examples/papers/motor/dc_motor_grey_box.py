"""Row A3: the grey-box fit of the DC motor, with standard deviations, loss function and Akaike's FPE."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from papers import Progress
from papers.claim import within, within_errors
from papers.motor import lehigh_motor
from papers.reproduction import Line, Reproduction

if TYPE_CHECKING:
    from idloop.estimation import FitResult
    from idloop.estimation.linear import LinearModel
    from idloop.records import Record

Array = NDArray[np.float64]

REPEATS = 40
# An estimate may lie this many standard errors off: once in 15000 runs it does by chance.
_FAR = 4.0
# The classical standard deviation is the same in every run up to this share.
_SHARE = 0.2

# Parameters of the model file by the thesis's names.
NAMES = {"a": "motor.viscous_friction", "b": "drive.gain"}
PUBLISHED = {
    "a": (lehigh_motor.A, lehigh_motor.A_STDERR, "1/s"),
    "b": (lehigh_motor.B, lehigh_motor.B_STDERR, "rad/s²/V"),
}


@dataclass(frozen=True, eq=False)
class GreyBoxFit(Reproduction):
    """Fits of b / (s² + a s) to a simulated record of the thesis's experiment.

    Attributes
    ----------
    record : Record
        Square wave of 0.25 V and 0.5 Hz.
    recipe : LinearModel
        By the thesis's recipe: at rest at the first sample, which counts as known.
    grey_box : FitResult
        The model file fitted by ``idloop.estimation.fit``, which estimates where the motion began.
    repeats : ndarray, shape (r, 2)
        a and b by the recipe in repeated experiments.
    """

    record: Record
    recipe: LinearModel
    grey_box: FitResult
    repeats: Array

    def rows(self) -> tuple[Line, ...]:
        """Parameters, standard deviations, loss, FPE and noise by both ways of fitting."""
        place = "appendix B.2.1"
        found = lehigh_motor.values(self.recipe)
        lines = [
            Line("samples", float(self.recipe.samples), float(lehigh_motor.samples()), "", "FPE and loss tell it"),
        ]
        for name, (paper, spread, unit) in PUBLISHED.items():
            ours, error = found[name]
            lines += [
                Line(name, ours, paper, unit, place, within_errors(paper, _FAR, error)),
                Line(f"{name}: standard deviation", error, spread, unit, place, within(spread, _SHARE)),
            ]
        lines += self._sizes("", self.recipe.loss, self.recipe.fpe, place)
        for index, (signal, unit) in enumerate((("position", "rad²"), ("velocity", "(rad/s)²"))):
            variance, paper = float(self.recipe.covariance[index, index]), lehigh_motor.VARIANCES[index]
            lines.append(Line(f"noise variance of the {signal}", variance, paper, unit, place,
                              within(paper, _FAR * math.sqrt(2.0 / self.recipe.samples))))  # fmt: skip
        for index, (name, (_, spread, unit)) in enumerate(PUBLISHED.items()):
            repeated = float(np.std(self.repeats[:, index], ddof=1))
            slack = _FAR / math.sqrt(2.0 * (len(self.repeats) - 1))
            lines.append(Line(f"{name}: spread over {len(self.repeats)} repeated experiments", repeated, spread, unit,
                              place, within(found[name][1], slack)))  # fmt: skip
        for name, (paper, spread, unit) in PUBLISHED.items():
            place_of = self.grey_box.names.index(NAMES[name])
            ours, error = float(self.grey_box.values[place_of]), float(self.grey_box.stderr[place_of])
            lines += [
                Line(f"idloop fit: {name}", ours, paper, unit, place, within_errors(paper, _FAR, error)),
                Line(f"idloop fit: {name}: standard deviation", error, spread, unit, place),
            ]
        return (*lines, *self._sizes("idloop fit: ", self.grey_box.loss, self.grey_box.fpe, place))

    def _sizes(self, prefix: str, loss: float, fpe: float, place: str) -> list[Line]:
        # A determinant of two variances from n samples spreads by √(4/n) of itself.
        slack = _FAR * math.sqrt(4.0 / self.recipe.samples)
        return [
            Line(f"{prefix}loss function", loss, lehigh_motor.LOSS, "", place, within(lehigh_motor.LOSS, slack)),
            Line(f"{prefix}Akaike's FPE", fpe, lehigh_motor.FPE, "", place, within(lehigh_motor.FPE, slack)),
            Line(f"{prefix}FPE / loss", fpe / loss, lehigh_motor.FPE / lehigh_motor.LOSS, "", place,
                 within(lehigh_motor.FPE / lehigh_motor.LOSS, 5e-5)),
        ]  # fmt: skip

    def notes(self) -> tuple[str, ...]:
        """What the recipe is, and why the other fit is less sure of a."""
        return (
            (
                "The first lines are by the thesis's recipe: the start at rest counts as known (XO = 0), no Kalman"
                " gain, determinant of the error covariance."
            ),
            "idloop fit estimates where the motion began; a part of what the position tells of a goes into that.",
            (
                "The loss is the determinant of the covariance: the thesis's variances multiply to"
                f" {lehigh_motor.VARIANCES[0] * lehigh_motor.VARIANCES[1]:.3g}."
            ),
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            **super().to_dict(),
            "recipe": self.recipe.to_dict(),
            "grey_box": self.grey_box.to_dict(),
            "repeats": self.repeats,
        }

    def plot(self, axes: Any = None) -> Any:
        """Draw measured and modelled outputs, as the thesis's figure 7.1; returns the two matplotlib axes."""
        import matplotlib.pyplot as plt

        from idloop import drawing
        from idloop.estimation.black_box.sampled import sampled
        from idloop.validation import fit_percent

        data = sampled(self.record)[0]
        modelled = self.recipe.simulate(data, "zero")
        fit = fit_percent(data.output, modelled)
        with drawing.styled():
            if axes is None:
                _, axes = plt.subplots(2, 1, sharex=True, figsize=(8, 5), layout="constrained")
            for column, ax in enumerate(axes):
                drawing.line(ax, data.time, data.output[:, column], color=drawing.MEASURED, label="measured")
                text = f"model, FIT {fit[column]:.1f} %"
                drawing.line(ax, data.time, modelled[:, column], **drawing.model_look(0), label=text)
                ax.set_ylabel(drawing.label(data.output_names[column], data.output_units[column]))
                ax.legend()
            axes[0].set_xlim(0.0, min(20.0, float(data.time[-1])))
            axes[1].set_xlabel(drawing.label("time", "s"))
        return axes


def reproduce(seed: int, progress: Progress, repeats: int = REPEATS) -> GreyBoxFit:
    """Repeat the thesis's experiment on the simulated motor and fit it.

    Parameters
    ----------
    seed : int
        Of the measurement noise.
    progress : callable
    repeats : int
        Experiments from which the spread of the estimates is counted, 2 or more.
    """
    from idloop.estimation import fit
    from idloop.estimation.black_box.sampled import sampled

    model, count = lehigh_motor.motor(), lehigh_motor.samples()

    def experiment(number: int) -> Record:
        return lehigh_motor.square_wave(model, lehigh_motor.SQUARE_AMPLITUDE, count, number)

    progress(0.0, "the thesis's recipe")
    record = experiment(seed)
    recipe = lehigh_motor.toolbox_fit(sampled(record))
    progress(0.1, "idloop fit")
    # A wrong start, as far off as the thesis's own guess of a.
    start = model.with_values({NAMES["a"]: 1.0, NAMES["b"]: 1.0})
    grey_box = fit(start, [record], progress=lambda share, text: progress(0.1 + 0.5 * share, text))
    found = []
    for index in range(repeats):
        progress(0.6 + 0.4 * index / repeats, "repeated experiments")
        # Seeds of their own, so that no repeat is the record above.
        again = lehigh_motor.values(lehigh_motor.toolbox_fit(sampled(experiment(1000 * (seed + 1) + index))))
        found.append([again[name][0] for name in NAMES])
    return GreyBoxFit(record, recipe, grey_box, np.array(found))
