"""Row B8: sweeps of excitation, sample time, number of states and horizon, beside tables 5.1, 5.2, figures 5.7-5.12."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from papers import Progress
from papers.claim import above, below, near
from papers.reproduction import Cell, Line, Reproduction, Table
from papers.torsion import torsion_methods
from papers.torsion import torsion_thesis as thesis

if TYPE_CHECKING:
    from idloop.records import Record

Array = NDArray[np.float64]

SETTINGS = thesis.TABLE_5_1[2:]
SAMPLE_TIMES = (0.005, 0.01, 0.02, 0.03, 0.04, 0.06, 0.08, 0.1)
STATES = tuple(range(1, 12))
HORIZONS = (2, 3, 4, 5, 6, 9, 14, 20, 28, 40)
# Of figure 5.11: the two numbers of states.
MANY, FEW = 9, 3
SWEPT = (thesis.VODMA, thesis.DIRECT, thesis.N4SID)
REFINED = (thesis.DIRECT_PEM, thesis.N4SID_PEM)
ALONE = (thesis.VODMA, thesis.DIRECT)
_ITERATIONS, _LONG = 8, 20


@dataclass(frozen=True, eq=False)
class Sweep:
    """FIT over one setting of the estimator.

    Attributes
    ----------
    name, unit : str
        Of the setting.
    figures : str
        Of the thesis.
    values : tuple of float
    fits : dict of str to ndarray
        By way, at `values` [%]; NaN where there is no model.
    seconds : dict of str to ndarray
        Time that the ways together took at `values`, by their group.
    """

    name: str
    unit: str
    figures: str
    values: tuple[float, ...]
    fits: Mapping[str, Array]
    seconds: Array

    def table(self) -> Table:
        """One line a value."""
        header = (f"{self.name} [{self.unit}]", *(f"{way} [%]" for way in self.fits), "time of all [s]")
        rows = [
            (value, *(_shown(fits[k]) for fits in self.fits.values()), float(self.seconds[k]))
            for k, value in enumerate(self.values)
        ]
        return Table(f"FIT over {self.name} ({self.figures})", header, rows)

    def at(self, way: str, value: float) -> float:
        """FIT of a way at a value of the sweep, 0 where it fails [%]."""
        found = float(self.fits[way][self.values.index(value)])
        return max(found, 0.0) if np.isfinite(found) else 0.0

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {"name": self.name, "values": list(self.values), "fits": dict(self.fits)}


@dataclass(frozen=True, eq=False)
class TorsionSweeps(Reproduction):
    """All sweeps on the simulated machine.

    Attributes
    ----------
    settings : tuple of Setting
    fits : dict of str to dict of str to float
        Table 5.1: FIT by setting and way [%].
    sample_time, states, many, few : Sweep
        Figures 5.7, 5.9, and 5.11 with nine and with three states.
    singular_values : ndarray
        Figure 5.10: of the direct variant of VODMA.
    """

    settings: tuple[thesis.Setting, ...]
    fits: Mapping[str, Mapping[str, float]]
    sample_time: Sweep
    states: Sweep
    many: Sweep
    few: Sweep
    singular_values: Array

    def rows(self) -> tuple[Line, ...]:
        """What the thesis says of each sweep."""
        lines = []
        for setting in self.settings:
            ours = {way: fit for way, fit in self.fits[setting.name].items() if np.isfinite(fit)}
            best = max(ours, key=lambda way: ours[way])
            paper = max(cell for cell in setting.fits if cell is not None)
            lines.append(Line(f"{setting.name}: best FIT, {best}", ours[best], paper, "%", "table 5.1"))
        ways = list(self.fits[self.settings[0].name])
        if len(self.settings) > 1:
            lines += [
                Line(f"average over the experiments, {way}", self.average(way), paper, "%", "table 5.2")
                for way, paper in zip(thesis.WAYS, thesis.TABLE_5_2, strict=True)
                if way in ways
            ]
        lines += self._excitation()
        return (*lines, *self._settings())

    def _best(self, setting: thesis.Setting) -> float | None:
        fits = self.fits.get(setting.name)
        return None if fits is None else max(fit for fit in fits.values() if np.isfinite(fit))

    def _excitation(self) -> list[Line]:
        """What amplitude and refinement do."""
        lines = []
        large, small = self._best(thesis.CHOSEN), self._best(thesis.TABLE_5_1[8])
        if large is not None and small is not None:
            lines.append(Line("amplitude 20 % against 90 %: change of the best FIT", small - large,
                              max(_numbers(thesis.TABLE_5_1[8])) - max(_numbers(thesis.CHOSEN)), "%", "section 5.4",
                              below(0.0)))  # fmt: skip
        middle = self._best(thesis.TABLE_5_1[7])
        if large is not None and middle is not None:
            lines.append(Line("amplitude 83 % against 90 %: change of the best FIT", middle - large,
                              max(_numbers(thesis.TABLE_5_1[7])) - max(_numbers(thesis.CHOSEN)), "%", "section 5.4",
                              near(0.0, 5.0)))  # fmt: skip
        pairs = (
            (thesis.VODMA_PEM, thesis.VODMA, 77.10 - 68.13),
            (thesis.DIRECT_PEM, thesis.DIRECT, 75.76 - 71.01),
            (thesis.N4SID_PEM, thesis.N4SID, 75.91 - 73.66),
        )
        for refined, plain, paper in pairs:
            if refined in self.fits[self.settings[0].name] and len(self.settings) > 1:
                gained = self.average(refined) - self.average(plain)
                # A refinement of what is already best may cost a tenth on other data.
                lines.append(Line(f"{plain}: what PEM gains on average", gained, paper, "%", "table 5.2",
                                  above(-0.5)))  # fmt: skip
        return lines

    def _settings(self) -> list[Line]:
        """What sample time, states and horizon do."""
        times, states = self.sample_time, self.states
        n4 = thesis.N4SID
        lines = []
        if 0.005 in times.values:
            change = times.at(n4, 0.005) - times.at(n4, 0.01)
            lines.append(Line("5 ms instead of 10 ms: change of FIT, N4SID", change, "almost zero", "%", "section 5.6",
                              near(0.0, 1.0)))  # fmt: skip
        last = times.values[-1]
        drop = times.at(n4, last) - times.at(n4, 0.01)
        lines.append(Line(f"{1000.0 * last:.0f} ms instead of 10 ms: change of FIT, N4SID", drop, "drops from 60 ms",
                          "%", "figure 5.7", below(0.0)))  # fmt: skip
        five = states.at(n4, 5) - states.at(n4, 9)
        lines += [
            Line("5 states instead of 9: change of FIT, N4SID", five, "hardly any", "%", "figure 5.9", near(0.0, 3.0)),
            Line("3 states: best FIT", max(states.at(way, 3) for way in states.fits), "works fine", "%", "figure 5.9",
                 above(60.0)),
            Line("1 state: best FIT", max(states.at(way, 1) for way in states.fits), "will not do", "%", "figure 5.9",
                 below(60.0)),
        ]  # fmt: skip
        steady = [self.many.at(thesis.DIRECT, i) for i in self.many.values if i > 6]
        collapsed = [self.many.at(thesis.DIRECT, i) for i in self.many.values if i <= 3]
        lines.append(Line("9 states, i above 6: spread of FIT, VODMA DI", max(steady) - min(steady), "quite steady",
                          "%", "figure 5.11", below(5.0)))  # fmt: skip
        if collapsed:
            lines.append(Line("9 states, i of 3 and less: best FIT, VODMA DI (0: no model)", max(collapsed),
                              "collapses", "%", "figure 5.11", below(min(steady) - 10.0)))  # fmt: skip
        return lines

    def average(self, way: str) -> float:
        """FIT over the experiments, failures counted as 0 [%]."""
        found = [self.fits[setting.name][way] for setting in self.settings]
        return float(np.mean([max(fit, 0.0) if np.isfinite(fit) else 0.0 for fit in found]))

    def tables(self) -> tuple[Table, ...]:
        """Table 5.1, then one table a sweep."""
        body: list[tuple[Cell, ...]] = []
        for setting in self.settings:
            fits = self.fits[setting.name]
            body.append((setting.name, "ours", *(_shown(fits[w]) if w in fits else None for w in thesis.WAYS)))
            body.append(("", "thesis", *("x" if cell is None else cell for cell in setting.fits)))
        first = Table("Table 5.1: FIT [%]; x: below 0", ("experiment", "whose", *thesis.WAYS), body)
        return (first, self.sample_time.table(), self.states.table(), self.many.table(), self.few.table())

    def notes(self) -> tuple[str, ...]:
        """What machine, what is swept, what is left out."""
        return (
            (
                "The machine of row B3, whose friction and imbalance are of our size: the thesis's cells are a guide,"
                " claimed is what it says of each sweep. Rows with RGS at 100 % are in B5."
            ),
            (
                f"Sweeps of the estimators: {thesis.CHOSEN.name}, one setting changed, the others nine states,"
                f" i = {thesis.HORIZON}, 10 ms. Both sides low-passed alike below the new half sample rate. PEM:"
                f" {_ITERATIONS} iterations of free-run errors ({_LONG} in the sweep of states); alone it starts at the"
                " sampled Quanser model with a leak, all entries free."
            ),
            (
                "The thesis's collapse at i = 3 is one of the count: windows of i samples of four outputs show at most"
                " 4 (i - 1) states. Times are of this computer; figures 5.8 and 5.12 are of the thesis's."
            ),
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            **super().to_dict(),
            "table_5_1": {name: dict(fits) for name, fits in self.fits.items()},
            "sweeps": [sweep.to_dict() for sweep in (self.sample_time, self.states, self.many, self.few)],
            "singular_values": self.singular_values,
        }

    def plot(self, axes: Any = None) -> Any:
        """Draw table 5.1, each sweep, times, and the singular values; returns the six axes."""
        import matplotlib.pyplot as plt

        from idloop import drawing

        with drawing.styled():
            if axes is None:
                _, axes = plt.subplots(3, 2, figsize=(10.0, 9.0), layout="constrained")
                axes = axes.ravel()
            place = np.arange(len(self.settings))
            for index, way in enumerate(self.fits[self.settings[0].name]):
                colour = drawing.MODELS[index % len(drawing.MODELS)]
                ours = [_from_zero(self.fits[setting.name][way]) for setting in self.settings]
                paper = [setting.fits[thesis.WAYS.index(way)] or 0.0 for setting in self.settings]
                axes[0].plot(place + 0.08 * index, ours, "o", color=colour, markersize=4, label=way)
                axes[0].plot(place + 0.08 * index, paper, "_", color=colour)
            axes[0].set_xticks(place, [setting.name for setting in self.settings], rotation=25, ha="right", fontsize=6)
            axes[0].set(ylabel=drawing.label("FIT", "%"), title="table 5.1; dashes: thesis")
            axes[0].legend(fontsize=6, ncols=2)
            for ax, sweep in ((axes[1], self.sample_time), (axes[2], self.states)):
                self._draw(ax, sweep, "")
            self._draw(axes[4], self.many, f", {MANY} states")
            self._draw(axes[4], self.few, f", {FEW} states", first=len(self.many.fits))
            numbers = np.arange(1, self.singular_values.size + 1)
            axes[3].semilogy(numbers, self.singular_values, "o", color=drawing.MODELS[0], markersize=4)
            axes[3].set(xlabel=drawing.label("number", "-"), ylabel=drawing.label("singular value", "-"),
                        title="figure 5.10")  # fmt: skip
            for index, (sweep, text) in enumerate(((self.many, f"i, {MANY} states"), (self.few, f"i, {FEW} states"))):
                axes[5].plot(sweep.values, sweep.seconds, "o-", markersize=3, color=drawing.MODELS[index], label=text)
            axes[5].set(xlabel=drawing.label("i", "samples"), ylabel=drawing.label("time", "s"), title="figure 5.12")
            axes[5].legend()
        return axes

    def _draw(self, ax: Any, sweep: Sweep, words: str, first: int = 0) -> None:
        from idloop import drawing

        for index, (way, fits) in enumerate(sweep.fits.items()):
            look = drawing.model_look(first + index)
            ax.plot(
                sweep.values, [_from_zero(fit) for fit in fits], marker="o", markersize=3, label=way + words, **look
            )
        ax.set(xlabel=drawing.label(sweep.name, sweep.unit), ylabel=drawing.label("FIT (0: fails)", "%"),
               title=sweep.figures)  # fmt: skip
        ax.legend(fontsize=6)


def _numbers(setting: thesis.Setting) -> list[float]:
    return [cell for cell in setting.fits if cell is not None]


def _from_zero(fit: float) -> float:
    return max(fit, 0.0) if np.isfinite(fit) else 0.0


def _shown(fit: float) -> Cell:
    """As in the thesis: a cross below 0."""
    return float(fit) if np.isfinite(fit) and fit >= 0.0 else "x"


def reproduce(
    seed: int,
    progress: Progress,
    length: float = thesis.LENGTH,
    settings: Sequence[thesis.Setting] = SETTINGS,
    sample_times: Sequence[float] = SAMPLE_TIMES,
    states: Sequence[int] = STATES,
    horizons: Sequence[int] = HORIZONS,
    ways: tuple[str, ...] = thesis.WAYS,
) -> TorsionSweeps:
    """Run the experiments of table 5.1 from its third row on, and sweep the estimators on the chosen one.

    Parameters
    ----------
    seed : int
        Of the excitation.
    progress : callable
    length : float
        Of the benchmark [s], 20 or more.
    settings : sequence of Setting
    sample_times : sequence of float
        [s], 0.01 among them.
    states, horizons : sequence of int
        5 and 9 among the states, as 1 and 3; one above 6 among the horizons.
    ways : tuple of str
        Of the settings.
    """
    choices = torsion_methods.Choices(iterations=_ITERATIONS)
    fits = {}
    for index, setting in enumerate(settings):
        progress(0.6 * index / len(settings), setting.name)
        record = torsion_methods.laboratory(setting, seed + 1, length)
        fits[setting.name] = torsion_methods.laboratory_fits(record, setting, choices, ways)
    record = torsion_methods.laboratory(thesis.CHOSEN, seed + 1, length)
    progress(0.6, "sample time")
    sampled = _sweep(record, "sample time", "s", "figures 5.7, 5.8", SWEPT, [(t, choices, t) for t in sample_times])
    progress(0.7, "number of states")
    every = thesis.IDENTIFIED_EVERY
    numbered = _sweep(
        record, "number of states", "-", "figure 5.9", (*SWEPT, *REFINED),
        [(float(n), replace(choices, states=n, iterations=_LONG), every) for n in states],
    )  # fmt: skip
    progress(0.85, "horizon")
    many, few = (
        _sweep(
            record, "i", "samples", "figures 5.11, 5.12", ALONE,
            [(float(i), replace(choices, states=n, horizon=i), every) for i in horizons],
        )
        for n in (MANY, FEW)
    )  # fmt: skip
    train, _ = thesis.halves(thesis.thinned(record, filtered=True))
    model = torsion_methods.black_box(train, None, choices, (thesis.DIRECT,))[thesis.DIRECT]
    values = np.ones(1) if model is None or model.singular_values is None else model.singular_values[:20]
    return TorsionSweeps(tuple(settings), fits, sampled, numbered, many, few, values)


def _sweep(
    record: Record,
    name: str,
    unit: str,
    figures: str,
    ways: tuple[str, ...],
    cases: Sequence[tuple[float, torsion_methods.Choices, float]],
) -> Sweep:
    found: dict[str, list[float]] = {way: [] for way in ways}
    seconds = []
    for _, choices, sample_time in cases:
        begin = time.perf_counter()
        fits = torsion_methods.laboratory_fits(record, thesis.CHOSEN, choices, ways, sample_time)
        seconds.append(time.perf_counter() - begin)
        for way in ways:
            found[way].append(fits[way])
    values = tuple(value for value, _, _ in cases)
    return Sweep(name, unit, figures, values, {way: np.array(f) for way, f in found.items()}, np.array(seconds))
