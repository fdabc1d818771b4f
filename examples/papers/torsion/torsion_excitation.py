"""Row B4: the references of the torsion thesis, their levels, bands and lengths, and how a record is prepared."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from papers import Progress
from papers.claim import above, below, equals, within
from papers.reproduction import Line, Reproduction, Table
from papers.torsion import torsion_methods
from papers.torsion import torsion_thesis as thesis

Array = NDArray[np.float64]

# Motion slower than this counts as rest [deg/s], within this of the reference [deg].
_REST, _REACHED = 2.0, 1.5


@dataclass(frozen=True, eq=False)
class Excited:
    """A reference and what came of it.

    Attributes
    ----------
    setting : Setting
    wanted : ndarray, shape (n,)
        [deg], every millisecond, both ends included.
    frequency, power : ndarray, shape (f,)
        Its power spectrum [Hz], [deg^2/Hz].
    below : float
        Share of its power below its band.
    angle : ndarray, shape (n,)
        Of the motor [deg].
    limited : float
        Share of the samples at the limit of the control signal [%].
    rests : float
        Share of the reference's levels at whose end the motor rests at them [%].
    """

    setting: thesis.Setting
    wanted: Array
    frequency: Array
    power: Array
    below: float
    angle: Array
    limited: float
    rests: float


@dataclass(frozen=True, eq=False)
class TorsionExcitations(Reproduction):
    """Benchmark signals and their scalings.

    Attributes
    ----------
    signals : tuple of Excited
    counts : dict of str to int
        Samples of the benchmark as measured, without its ends, and down-sampled.
    """

    signals: tuple[Excited, ...]
    counts: Mapping[str, int]

    def rows(self) -> tuple[Line, ...]:
        """Levels, bands, lengths and samples."""
        place = "section 4.1"
        lines = []
        benchmark = {
            one.setting.signal: one for one in self.signals if one.setting.amplitude == one.setting.band == 1.0
        }
        prbs, rgs = benchmark["prbs"], benchmark["rgs"]
        level = float(np.max(np.abs(prbs.wanted)))
        deviation = 2.0 * float(np.std(rgs.wanted))
        lines += [
            Line("PRBS: level", level, thesis.PRBS_LEVEL, "deg", place, within(thesis.PRBS_LEVEL, 1e-9)),
            Line("RGS: two deviations", deviation, thesis.RGS_TWO_DEVIATIONS, "deg", place,
                 within(thesis.RGS_TWO_DEVIATIONS, 0.08)),
        ]  # fmt: skip
        for one in self.signals:
            setting, seconds = one.setting, one.wanted.size * thesis.MEASURED_EVERY - 2.0 * thesis.DROPPED
            band = thesis.BAND * setting.band
            length = thesis.LENGTH / setting.band
            if not setting.compensated:
                continue
            lines.append(Line(f"{setting.name}: power below {band:.3g} Hz", 100.0 * one.below, "most", "%",
                              "figure 5.4", above(50.0)))  # fmt: skip
            if setting.band != 1.0:
                lines.append(Line(f"{setting.name}: length", seconds, length, "s", place,
                                  within(length, 1e-3)))  # fmt: skip
        alike = float(np.max(np.abs(np.log10(_smooth(prbs) / np.sum(prbs.power)) - np.log10(
            _smooth(rgs) / np.sum(rgs.power)))))  # fmt: skip
        lines.append(Line("spectra of PRBS and RGS below 10 Hz: largest factor between them", 10.0**alike,
                          "highly similar", "", "figure 5.4", below(2.0)))  # fmt: skip
        for name, expected, text in (
            ("measured", round((thesis.LENGTH + 2.0 * thesis.DROPPED) / thesis.MEASURED_EVERY), "samples at 1 kHz"),
            ("kept", round(thesis.LENGTH / thesis.MEASURED_EVERY), "without the first and last second"),
            ("thinned", round(thesis.LENGTH / thesis.IDENTIFIED_EVERY), "down-sampled to 100 Hz"),
        ):
            lines.append(Line(text, float(self.counts[name]), float(expected), "", "chapter 4",
                              equals(expected)))  # fmt: skip
        # The thesis says none; what it does not tell of its loop decides, so nothing is claimed.
        lines += [
            Line(f"{one.setting.name}: samples at the limit", one.limited, "almost", "%", "figure 5.4")
            for one in (rgs, prbs)
        ]
        slow = next(one for one in self.signals if one.setting == thesis.TABLE_5_1[6])
        lines.append(Line(f"{slow.setting.name}: levels at whose end the motor rests", slow.rests,
                          "the longer ones", "%", "figure 5.5", above(0.0)))  # fmt: skip
        return tuple(lines)

    def tables(self) -> tuple[Table, ...]:
        """One line a signal."""
        header = (
            "signal", "level or two deviations [deg]", "band [Hz]", "clock [ms]", "length [s]", "power below band [%]",
            "at the limit [%]", "rests [%]",
        )  # fmt: skip
        rows = []
        for one in self.signals:
            size = float(np.max(np.abs(one.wanted)) if one.setting.signal == "prbs" else 2.0 * np.std(one.wanted))
            band = thesis.BAND * one.setting.band
            rows.append(
                (
                    one.setting.name, size, band, 1000.0 * thesis.held_for(band),
                    one.wanted.size * thesis.MEASURED_EVERY - 2.0 * thesis.DROPPED, 100.0 * one.below,
                    one.limited, one.rests,
                )
            )  # fmt: skip
        return (Table("References", header, rows),)

    def notes(self) -> tuple[str, ...]:
        """How the thesis's words are read."""
        rgs, prbs = (
            next(one for one in self.signals if one.setting == thesis.TABLE_5_1[k]).limited for k in (1, 4)
        )  # fmt: skip
        return (
            (
                "A band of B Hz is read as levels held for 1/(2B): the thesis plays a signal of so many values slower"
                " or faster (its length is inverse to the band), and its figure 5.4 has most of the power below 10 Hz,"
                " not all. The clock is rounded down to whole samples of 10 ms, as idinput does."
            ),
            (
                f"The thesis's benchmarks come close to the limit without reaching it. In our loop {rgs:.1f} % (RGS)"
                f" and {prbs:.1f} % (PRBS) of the samples are at it, for some milliseconds after a large step:"
                " something of its loop differs that it does not tell."
            ),
            (
                "For the estimators both sides of a record are low-passed alike, without phase, before every tenth"
                " sample is taken."
            ),
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {**super().to_dict(), "counts": dict(self.counts)}

    def plot(self, axes: Any = None) -> Any:
        """Draw both signals, their spectra, and the resting motor (figures 5.4 and 5.5); returns the four axes."""
        import matplotlib.pyplot as plt

        from idloop import drawing

        shown = slice(0, round(4.0 / thesis.MEASURED_EVERY))
        slow = next(one for one in self.signals if one.setting == thesis.TABLE_5_1[6])
        with drawing.styled():
            if axes is None:
                _, axes = plt.subplots(2, 2, figsize=(10.0, 6.0), layout="constrained")
                axes = axes.ravel()
            for index, setting in enumerate((thesis.TABLE_5_1[1], thesis.TABLE_5_1[4])):
                one = next(found for found in self.signals if found.setting == setting)
                time = np.arange(one.wanted.size) * thesis.MEASURED_EVERY
                axes[index].plot(time[shown], one.wanted[shown], color=drawing.COMMAND, label="reference")
                axes[index].plot(time[shown], one.angle[shown], color=drawing.MODELS[0], label="motor")
                axes[index].set(title=setting.name, xlabel=drawing.label("time", "s"),
                                ylabel=drawing.label("angle", "deg"))  # fmt: skip
                if index == 0:
                    axes[index].legend()
            for index, one in enumerate(self.signals):
                axes[2].semilogy(one.frequency, one.power, label=one.setting.name, **drawing.model_look(index))
            axes[2].set(xlim=(0.0, 30.0), ylim=(1e-3, None), xlabel=drawing.label("frequency", "Hz"),
                        ylabel=drawing.label("power", "deg²/Hz"))  # fmt: skip
            axes[2].legend(fontsize=6)
            time = np.arange(slow.wanted.size) * thesis.MEASURED_EVERY
            axes[3].plot(time[shown], slow.wanted[shown], color=drawing.COMMAND, label="reference")
            axes[3].plot(time[shown], slow.angle[shown], color=drawing.MODELS[0], label="motor")
            axes[3].set(title=slow.setting.name, xlabel=drawing.label("time", "s"),
                        ylabel=drawing.label("angle", "deg"))  # fmt: skip
        return axes


def _smooth(one: Excited) -> Array:
    """Power in bands of 2 Hz below 10 Hz."""
    edges = np.arange(0.0, 10.1, 2.0)
    place = np.digitize(one.frequency, edges) - 1
    return np.array([np.sum(one.power[place == k]) for k in range(edges.size - 1)])


def reproduce(seed: int, progress: Progress, length: float = thesis.LENGTH) -> TorsionExcitations:
    """Generate the references of table 5.1 and run each in the loop.

    Parameters
    ----------
    seed : int
        Of the signals.
    progress : callable
    length : float
        Of the benchmark [s], 20 or more.
    """
    from scipy.signal import welch

    chosen = [thesis.TABLE_5_1[k] for k in (1, 2, 3, 4, 5, 6, 7, 8)]
    signals, counts = [], {}
    for index, setting in enumerate(chosen):
        progress(index / len(chosen), setting.name)
        record = torsion_methods.laboratory(setting, seed + 1, length)
        wanted = np.degrees(thesis.reference(setting, seed + 1, length))
        frequency, power = welch(wanted, 1.0 / thesis.MEASURED_EVERY, nperseg=min(4096, wanted.size))
        band = thesis.BAND * setting.band
        held = 0.5 / thesis.held_for(band)
        angle = np.degrees(record.output[:, 0])
        current = np.abs(record.input - thesis.CURRENT_OFFSET) / thesis.CURRENT_GAIN
        signals.append(
            Excited(
                setting, wanted, frequency, power, float(np.sum(power[frequency <= held]) / np.sum(power)), angle,
                float(100.0 * np.mean(current >= thesis.LIMIT * (1.0 - 1e-6))), _rests(wanted, angle),
            )
        )  # fmt: skip
        if setting == thesis.TABLE_5_1[4]:
            data = thesis.thinned(record)
            # Scaled, so that a shortened run counts as the full one would.
            share = thesis.LENGTH / length
            counts = {
                "measured": round(len(record.time) + (share - 1.0) * length / thesis.MEASURED_EVERY),
                "kept": round((len(record.time) - 2.0 * thesis.DROPPED / thesis.MEASURED_EVERY) * share),
                "thinned": round(len(data) * share),
            }
    return TorsionExcitations(tuple(signals), counts)


def _rests(wanted: Array, angle: Array) -> float:
    """Share of the levels at whose end the motor is there and at rest [%]."""
    ends = np.flatnonzero(np.diff(wanted))
    ends = ends[ends > 20]
    speed = np.abs(angle[ends] - angle[ends - 20]) / (20 * thesis.MEASURED_EVERY)
    return float(100.0 * np.mean((speed < _REST) & (np.abs(angle[ends] - wanted[ends]) < _REACHED)))
