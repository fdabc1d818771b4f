"""Row A2: the four signals of the generator, and command and sensors recorded together."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from papers import Progress
from papers.claim import at_least, below, within
from papers.motor import lehigh_motor
from papers.reproduction import Line, Reproduction

if TYPE_CHECKING:
    from idloop.records import Record
    from idloop.signals import Signal

# Chapter 4: what the program can generate, and the channels that it has to record at once.
KINDS = ("sine", "square", "saw", "triangle")
CHANNELS = 3
# Update of the generator [s] and length of each experiment [s].
STEP, DURATION = 0.01, 12.0


@dataclass(frozen=True, eq=False)
class SignalGenerator(Reproduction):
    """One experiment on the simulated motor with each signal, written to a bag and read again.

    Attributes
    ----------
    signals : tuple of Signal
        One of each kind.
    recorded : tuple of Record
        As read from the bags.
    lost : float
        Largest difference between what the simulator gave and what was read from the bags [unit of the channel].
    """

    signals: tuple[Signal, ...]
    recorded: tuple[Record, ...]
    lost: float

    def rows(self) -> tuple[Line, ...]:
        """Size and frequency of every signal, and the channels."""
        lines: list[Line] = []
        for signal in self.signals:
            size, frequency = signal.peak, _strongest(signal)
            asked = lehigh_motor.SQUARE_AMPLITUDE, lehigh_motor.SQUARE_FREQUENCY
            lines += [
                Line(f"{signal.name}: amplitude", size, asked[0], "V", "chapter 4", within(asked[0], 0.02)),
                Line(f"{signal.name}: frequency", frequency, asked[1], "Hz", "chapter 4", within(asked[1], 1e-6)),
            ]  # fmt: skip
        count = min(1 + len(record.output_names) for record in self.recorded)
        return (
            *lines,
            Line("channels recorded together", float(count), f"at least {CHANNELS}", "", "chapter 4",
                 at_least(CHANNELS)),
            Line("largest error of a channel read from its bag", self.lost, 0.0, "", "", below(1e-12)),
        )  # fmt: skip

    def notes(self) -> tuple[str, ...]:
        """How to see the channels live."""
        return (
            (
                "The channels are those of the live graph (idloop launch dc_motor), where any plotter shows them"
                " while the experiment runs. The amplitude and frequency asked for are those of the thesis's square"
                " wave."
            ),
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            **super().to_dict(),
            "signals": [signal.summary() for signal in self.signals],
            "channels": [[record.input_name, *record.output_names] for record in self.recorded],
        }

    def plot(self, axes: Any = None) -> Any:
        """Draw the three channels of every experiment; returns the matplotlib axes, shape (3, 4)."""
        from idloop import drawing

        with drawing.styled():
            if axes is None:
                _, axes = drawing.new_figure(CHANNELS, len(self.recorded))
            for column, (signal, record) in enumerate(zip(self.signals, self.recorded, strict=True)):
                shown = record.input_time >= 0.0
                drawing.steps(axes[0, column], record.input_time[shown], record.input[shown], color=drawing.COMMAND)
                axes[0, column].set_title(signal.name)
                for row in range(len(record.output_names)):
                    drawing.line(axes[row + 1, column], record.time, record.output[:, row], color=drawing.MEASURED)
                axes[-1, column].set_xlabel(drawing.label("time", "s"))
            first = self.recorded[0]
            labels = ((first.input_name, first.input_unit), *zip(first.output_names, first.output_units, strict=True))
            for row, (name, unit) in enumerate(labels):
                axes[row, 0].set_ylabel(drawing.label(name, unit))
        return axes


def _strongest(signal: Signal) -> float:
    """Frequency of the largest line of a signal's spectrum [Hz]."""
    frequency, amplitude = signal.spectrum()
    return float(frequency[1 + np.argmax(amplitude[1:])])


def reproduce(seed: int, progress: Progress) -> SignalGenerator:
    """Send each signal into the simulated motor and record command, potentiometer and tachometer.

    Parameters
    ----------
    seed : int
        Of the measurement noise.
    progress : callable
    """
    from idloop.diagnosis.design.experiment import Experiment
    from idloop.records import read_record, write_bag

    model = lehigh_motor.motor()
    signals, recorded, lost = [], [], 0.0
    for index, kind in enumerate(KINDS):
        progress(index / len(KINDS), kind)
        experiment = Experiment(
            {
                "name": kind,
                "sample_time": STEP,
                "duration": DURATION,
                "amplitude": lehigh_motor.SQUARE_AMPLITUDE,
                "frequency": lehigh_motor.SQUARE_FREQUENCY,
            }
        )
        given = experiment.run(model, noise=True, seed=seed + index, name=kind)
        with tempfile.TemporaryDirectory() as folder:
            record = read_record(write_bag(Path(folder) / kind, given), model)
        signals.append(experiment.built)
        recorded.append(record)
        # A bag says each command once more with every reading, so the values are compared where they are in force.
        lost = max(
            lost,
            float(np.max(np.abs(record.output - given.output))),
            float(np.max(np.abs(record.input_at(record.time[:-1]) - given.input_at(given.time[:-1])))),
        )
    return SignalGenerator(tuple(signals), tuple(recorded), lost)
