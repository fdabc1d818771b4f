"""Rows C2 to C4: identified models of the lead-screw stage on the same records, in prediction and in free run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from papers.claim import near
from papers.reproduction import Line, Reproduction, Table
from papers.stage import stage_paper

if TYPE_CHECKING:
    from idloop.estimation.black_box.sampled import SampledData
    from idloop.estimation.linear import LinearModel
    from idloop.estimation.networks import NarxModel
    from idloop.records import Record

Array = NDArray[np.float64]

# Seconds drawn.
_SHOWN = 12.0


@dataclass(frozen=True, eq=False)
class Bench:
    """Records that every candidate is judged on.

    Attributes
    ----------
    train, validation, half : SampledData
        Speed of the stage, two stretches of one PRBS and one of half its amplitude.
    records : tuple of Record
        The encoder's own records of the same experiments.
    reached : tuple of ndarray, shape (n,)
        Free run of the machine itself, before the encoder counts: what no model can beat but by chance [in/s].
    """

    train: SampledData
    validation: SampledData
    half: SampledData
    records: tuple[Record, Record, Record]
    reached: tuple[Array, Array, Array]


def bench(seed: int, duration: float = stage_paper.DURATION) -> Bench:
    """Run the three experiments.

    Parameters
    ----------
    seed : int
    duration : float
        Of each [s].
    """
    full, half = stage_paper.AMPLITUDE, 0.5 * stage_paper.AMPLITUDE
    runs = [(full, 3 * seed), (full, 3 * seed + 1), (half, 3 * seed + 2)]
    train, validation, weak = (stage_paper.measure(amplitude, number, duration) for amplitude, number in runs)
    records = (train, validation, weak)
    silent = stage_paper.machine().without_effect(stage_paper.ENCODER)
    reached = [stage_paper.free_run(silent, record).output[:, 0] for record in records]
    data = [stage_paper.speed(record) for record in records]
    return Bench(data[0], data[1], data[2], records, (reached[0], reached[1], reached[2]))


@dataclass(frozen=True, eq=False)
class Candidate:
    """A model by what it says of the records.

    Attributes
    ----------
    name : str
    ahead : ndarray, shape (n,), or None
        Prediction of the validation record one sample ahead [in/s]; None where it is the free run.
    free : tuple of ndarray
        Free runs of the training, the validation and the half record [in/s].
    """

    name: str
    ahead: Array | None
    free: tuple[Array, Array, Array]


@dataclass(frozen=True)
class Scores:
    """FIT [%] and mean square error [in²/s²] of a candidate: ahead and free on validation data, free at half.

    Attributes
    ----------
    ahead, ahead_mse, free, free_mse, half, half_mse : float
    train : float
        FIT of the free run of the record that it was fitted to.
    """

    ahead: float
    ahead_mse: float
    free: float
    free_mse: float
    half: float
    half_mse: float
    train: float

    @property
    def cells(self) -> tuple[float, ...]:
        """In the order of `HEADER`."""
        return (self.ahead, self.free, self.free_mse, self.half, self.half_mse)


HEADER = ("FIT one step ahead [%]", "FIT free run [%]", "MSE free run [in²/s²]", "FIT at half amplitude [%]",
          "MSE at half [in²/s²]")  # fmt: skip


def scores(candidate: Candidate, data: Bench) -> Scores:
    """Judge a candidate."""
    train, free, half = candidate.free
    ahead = free if candidate.ahead is None else candidate.ahead
    judged = (_judged(data.validation, ahead), _judged(data.validation, free), _judged(data.half, half))
    return Scores(*judged[0], *judged[1], *judged[2], _judged(data.train, train)[0])


def black_box(name: str, model: LinearModel | NarxModel, data: Bench) -> Candidate:
    """A discrete-time model as a candidate: its first samples are the measured ones, or its best first state."""
    runs = [np.asarray(model.simulate(each), dtype=float)[:, 0] for each in (data.train, data.validation, data.half)]
    ahead = np.asarray(model.predict(data.validation), dtype=float)[:, 0]
    return Candidate(name, ahead, (runs[0], runs[1], runs[2]))


def limit(data: Bench) -> Candidate:
    """The machine itself, whose free run only misses what the encoder's counts add."""
    return Candidate("the machine itself", None, data.reached)


def _judged(data: SampledData, modelled: Array) -> tuple[float, float]:
    from idloop.validation import fit_percent

    measured = data.output[:, 0]
    return float(fit_percent(measured, modelled)[0]), float(np.mean((measured - modelled) ** 2))


@dataclass(frozen=True, eq=False)
class StageFits(Reproduction):
    """Candidates of one kind beside the paper's figure.

    Attributes
    ----------
    data : Bench
    candidates : tuple of Candidate
        The one that stands beside the paper's first.
    published : Published
    lines : tuple of Line
        Further lines.
    said : tuple of str
        Notes of this kind.
    """

    data: Bench
    candidates: tuple[Candidate, ...]
    published: stage_paper.Published
    lines: tuple[Line, ...]
    said: tuple[str, ...]

    def rows(self) -> tuple[Line, ...]:
        """FIT and MSE of every candidate on validation data."""
        lines: list[Line] = []
        for index, candidate in enumerate(self.candidates):
            found, first = scores(candidate, self.data), index == 0
            fit, mse = (self.published.fit, self.published.mse) if first else (None, None)
            same = near(self.published.fit, stage_paper.NEAR) if first else None
            source = "table 2" if first else ""
            lines += [
                Line(f"{candidate.name}: FIT, one step ahead", found.ahead, fit, "%", source),
                Line(f"{candidate.name}: FIT, free run", found.free, fit, "%", source, same),
                Line(f"{candidate.name}: MSE, free run", found.free_mse, mse, "in²/s²", source),
            ]
        return (*lines, *self.lines)

    def tables(self) -> tuple[Table, ...]:
        """All measures of the candidates, and the most that can be reached."""
        everyone = (*self.candidates, limit(self.data))
        return (Table("On records that the fit has not seen", ("model", *HEADER),
                      [(each.name, *scores(each, self.data).cells) for each in everyone]),)  # fmt: skip

    def notes(self) -> tuple[str, ...]:
        """Notes of this kind, and how the experiment was chosen."""
        return (*self.said, *stage_paper.choices())

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        found = {each.name: vars(scores(each, self.data)) for each in (*self.candidates, limit(self.data))}
        return {**super().to_dict(), "scores": found}

    def plot(self, axes: Any = None) -> Any:
        """Draw measured speed and free runs at both amplitudes; returns the two axes."""
        return draw(self.data, self.candidates, axes)


def draw(data: Bench, candidates: tuple[Candidate, ...], axes: Any = None) -> Any:
    """Draw the free runs of candidates over the measured speed.

    Returns
    -------
    ndarray of axes, shape (2,)
        Validation record, record of half amplitude.
    """
    from idloop import drawing
    from idloop.validation import fit_percent

    with drawing.styled():
        if axes is None:
            _, grid = drawing.new_figure(2, heights=(2.4, 2.4))
            axes = grid[:, 0]
        for place, (ax, record) in enumerate(zip(axes, (data.validation, data.half), strict=True), start=1):
            drawing.line(ax, record.time, record.output[:, 0], color=drawing.MEASURED, label="measured")
            for index, candidate in enumerate(candidates):
                run = candidate.free[place]
                share = float(fit_percent(record.output[:, 0], run)[0])
                text = f"{candidate.name}, {share:.1f} %"
                drawing.line(ax, record.time, run, label=text, **drawing.model_look(index))
            # Room for the legend; a run that leaves it has failed.
            most = 2.6 * float(np.max(np.abs(record.output)))
            ax.set(xlim=(0.0, min(_SHOWN, float(record.time[-1]))), ylim=(-most, most))
            ax.set_title(record.name)
            ax.set_ylabel(drawing.label("speed", "in/s"))
            ax.legend(ncols=2, fontsize=7, loc="upper right")
        axes[-1].set_xlabel(drawing.label("time", "s"))
    return np.asarray(axes)
