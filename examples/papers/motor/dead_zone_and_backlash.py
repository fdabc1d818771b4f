"""Row A5: linear fits of a motor with a dead zone and an adjustable backlash before its potentiometer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from papers import Progress
from papers.claim import above, below, between, within
from papers.motor import lehigh_motor
from papers.reproduction import Line, Reproduction, Table

if TYPE_CHECKING:
    from idloop.estimation import FitResult
    from idloop.estimation.black_box.sampled import SampledData
    from idloop.estimation.linear import LinearModel
    from idloop.records import Record

Array = NDArray[np.float64]

POSITION, VELOCITY = 0, 1
# The amplitude at which the gap is chosen [V], and the gaps between which it is searched [rad].
CHOSEN_AT, GAPS = 0.30, (0.05, 0.6)
# Periods left out at the beginning when the first harmonics are compared.
SETTLING = 5
# Levels of the command at which the dead zone is measured [V], and how long each is held [s].
LEVELS, HOLD = (-0.5, -0.4, -0.3, -0.2, -0.08, 0.08, 0.2, 0.3, 0.4, 0.5), 8.0
# The position of a square wave is nearly a sine, so describing functions are right to this share where it moves
# clearly more than the gap.
_ACCURACY, _CLEAR = 0.05, 1.2
# FIT of the velocity by the linear fit lies this close to the most that the noise allows [%].
_FITS = 1.0


@dataclass(frozen=True, eq=False)
class Level:
    """One amplitude of the square wave.

    Attributes
    ----------
    amplitude : float
        [V]
    data : SampledData
    model : LinearModel
        b / (s² + a s), fitted as in the thesis.
    modelled : ndarray, shape (n, 2)
        Its free run from rest.
    fit, most : ndarray, shape (2,)
        FIT of position and velocity [%], and that of the machine itself, which the noise limits.
    ratio : float
        First harmonic of the modelled position over that of the measured one.
    late : float
        Phase by which the measured position lags the modelled one [deg].
    moved : float
        First harmonic of the position before the coupling, by the tachometer [rad].
    passed, theory : complex
        Describing function of the coupling: from the tachometer's first harmonic, integrated, to the potentiometer's,
        and in closed form at that amplitude.
    """

    amplitude: float
    data: SampledData
    model: LinearModel
    modelled: Array
    fit: Array
    most: Array
    ratio: float
    late: float
    moved: float
    passed: complex
    theory: complex


@dataclass(frozen=True, eq=False)
class DeadZoneAndBacklash(Reproduction):
    """Linear fits at the thesis's four amplitudes, the dead zone measured, and one model with both effects.

    Attributes
    ----------
    gap : float
        Of the coupling [rad]: not published, chosen so that one position error is the thesis's.
    width : float
        Dead zone measured by levels of the command [V].
    levels : tuple of Level
    with_effects : FitResult
        The model file with both effects, fitted to all amplitudes at once.
    fits_with_effects : ndarray, shape (k, 2)
        Its FIT of position and velocity at each amplitude [%].
    """

    gap: float
    width: float
    levels: tuple[Level, ...]
    with_effects: FitResult
    fits_with_effects: Array

    def rows(self) -> tuple[Line, ...]:
        """What the thesis saw, in numbers."""
        width = lehigh_motor.DEAD_ZONE
        lines = [Line("dead zone by levels of the command", self.width, width, "V", "figure 6.4",
                      within(width, 0.1))]  # fmt: skip
        for level in self.levels:
            at, published = f"{level.amplitude:.2f} V", lehigh_motor.WITH_BACKLASH[level.amplitude]
            fits = above(level.most[VELOCITY] - _FITS).of(level.fit[VELOCITY])
            worse = below(level.most[POSITION] - 5.0 * _FITS).of(level.fit[POSITION])
            variance = float(level.model.covariance[POSITION, POSITION])
            fixed = level.amplitude == CHOSEN_AT
            speed, place = (f"{level.fit[i]:.1f} of {level.most[i]:.1f}" for i in (VELOCITY, POSITION))
            lines += [
                Line(f"{at}: FIT of the velocity, of at most", speed, "fits perfectly", "%", "chapter 8", fits),
                Line(f"{at}: FIT of the position, of at most", place, "no good fit", "%", "chapter 8", worse),
                Line(f"{at}: modelled position over measured", level.ratio, "much higher", "", "chapter 8", above(1.1)),
                Line(f"{at}: measured position late by", level.late, "a little", "deg", "chapter 8", above(1.0)),
                Line(f"{at}: variance of the position's error", variance, published.position, "rad²", "appendix B.3",
                     None if fixed else between(0.5 * published.position, 2.0 * published.position)),
            ]  # fmt: skip
        for level in self.levels:
            error, clear = abs(level.passed / level.theory - 1.0), level.moved > _CLEAR * self.gap
            claim = below(100.0 * _ACCURACY) if clear else None
            lines.append(Line(f"{level.amplitude:.2f} V: describing function of the coupling, measured off theory by",
                              100.0 * error, None, "%", "eq. 6.2", claim))  # fmt: skip
        most = np.array([level.most[POSITION] for level in self.levels])
        worst = int(np.argmin(self.fits_with_effects[:, POSITION] - most))
        reached = float(self.fits_with_effects[worst, POSITION])
        parameters = self.with_effects.model
        return (
            *lines,
            Line("one model with both effects: FIT of the position, of at most, where it is worst",
                 f"{reached:.1f} of {most[worst]:.1f}", None, "%", "",
                 above(most[worst] - _FITS).of(reached)),
            Line("one model with both effects: dead zone", parameters.values["dead_zone@input.width"], width, "V",
                 "figure 6.4", within(width, 0.1)),
            Line("one model with both effects: gap", parameters.values["backlash@position[motor].gap"], None, "rad", "",
                 within(self.gap, 0.1)),
        )  # fmt: skip

    def tables(self) -> tuple[Table, ...]:
        """The linear fits, and the position's first harmonic by measurement and theory."""
        rows = []
        for level in self.levels:
            found, published = lehigh_motor.values(level.model), lehigh_motor.WITH_BACKLASH[level.amplitude]
            rows.append((f"{level.amplitude:.2f}", found["b"][0], published.b, found["a"][0], published.a, level.ratio,
                         level.late, abs(level.passed), abs(level.theory), float(np.degrees(np.angle(level.passed))),
                         float(np.degrees(np.angle(level.theory)))))  # fmt: skip
        header = ("u [V]", "b", "paper", "a", "paper", "model / measured", "late [deg]", "|N|", "theory",
                  "phase of N [deg]", "theory")  # fmt: skip
        return (Table("Linear fits, and what they make of the position", header, rows),)

    def notes(self) -> tuple[str, ...]:
        """Where the gap comes from."""
        return (
            (
                f"The thesis does not tell the gap of its coupling. {self.gap:.3f} rad leaves the position error that"
                f" it publishes for {CHOSEN_AT:g} V; those at the other amplitudes are then predictions."
            ),
            (
                "A dead zone takes its width off a square wave and nothing else, so the velocity fits with a smaller"
                " gain; the backlash takes amplitude and adds lag behind the tachometer, where no linear fit of both"
                " can follow."
            ),
            "At 0.23 V the position moves no more than the gap: there the harmonics of the square wave count as well.",
            "The thesis's a falls with the amplitude; friction does that, which is row A6.",
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            **super().to_dict(),
            "gap": self.gap,
            "dead_zone": self.width,
            "levels": [
                {
                    "amplitude": level.amplitude,
                    "model": level.model.to_dict(),
                    "fit": level.fit,
                    "most": level.most,
                    "ratio": level.ratio,
                    "late": level.late,
                    "passed": {"real": level.passed.real, "imag": level.passed.imag},
                    "theory": {"real": level.theory.real, "imag": level.theory.imag},
                }
                for level in self.levels
            ],
            "with_effects": self.with_effects.to_dict(),
            "fits_with_effects": self.fits_with_effects,
        }

    def plot(self, axes: Any = None) -> Any:
        """Draw measured and modelled outputs at every amplitude, as figures 7.2 to 7.5; returns the axes, (2, k)."""
        from idloop import drawing

        with drawing.styled():
            if axes is None:
                _, axes = drawing.new_figure(2, len(self.levels))
            for column, level in enumerate(self.levels):
                for row in (POSITION, VELOCITY):
                    ax, data = axes[row, column], level.data
                    drawing.line(ax, data.time, data.output[:, row], color=drawing.MEASURED, label="measured")
                    text = f"linear fit, FIT {level.fit[row]:.0f} %"
                    drawing.line(ax, data.time, level.modelled[:, row], **drawing.model_look(0), label=text)
                    ax.legend(loc="lower right")
                    ax.set_xlim(0.0, min(12.0, float(data.time[-1])))
                axes[0, column].set_title(f"{level.amplitude:.2f} V")
                axes[1, column].set_xlabel(drawing.label("time", "s"))
            first = self.levels[0].data
            for row in (POSITION, VELOCITY):
                axes[row, 0].set_ylabel(drawing.label(first.output_names[row], first.output_units[row]))
        return axes


def machine(gap: float | None) -> Any:
    """The motor with its dead zone, and the coupling with a gap [rad] where one is given."""
    effects = [f"dead_zone@input(width={lehigh_motor.DEAD_ZONE})"]
    if gap is not None:
        effects.append(f"backlash@position[motor](gap={gap})")
    return lehigh_motor.motor(*lehigh_motor.coupled_plant(), effects)


def reproduce(
    seed: int, progress: Progress, amplitudes: Sequence[float] = tuple(lehigh_motor.WITH_BACKLASH)
) -> DeadZoneAndBacklash:
    """Fit linear models to a motor with dead zone and backlash, and then one with both effects.

    Parameters
    ----------
    seed : int
        Of the measurement noise.
    progress : callable
    amplitudes : sequence of float
        Of the thesis's [V].
    """
    from idloop.estimation import fit
    from idloop.estimation.black_box.sampled import sampled
    from idloop.validation import compare

    progress(0.0, "dead zone")
    width = measured_dead_zone(seed)
    progress(0.1, "gap")
    gap = chosen_gap(seed)
    plant = machine(gap)
    records = [_record(plant, amplitude, seed + 1 + i) for i, amplitude in enumerate(amplitudes)]
    levels = []
    for index, (amplitude, record) in enumerate(zip(amplitudes, records, strict=True)):
        progress(0.3 + 0.1 * index / len(records), f"linear fit, {amplitude:g} V")
        levels.append(_level(amplitude, sampled(record)[0], gap))
    start = lehigh_motor.motor(effects=["dead_zone@input", "backlash@position[motor]"])
    start = start.with_values({"dead_zone@input.width": 0.05, "backlash@position[motor].gap": 0.1})
    fitted = fit(start, records, criterion="simulation", progress=lambda s, text: progress(0.4 + 0.5 * s, text))
    progress(0.9, "free runs")
    fits = np.array([list(compare(fitted.model, record).fit.values()) for record in records])
    return DeadZoneAndBacklash(gap, width, tuple(levels), fitted, fits)


def measured_dead_zone(seed: int) -> float:
    """Dead zone of the motor as the thesis measures it: levels of the command and the speed that each leads to [V]."""
    from idloop.physics import simulate

    plant = machine(None)
    step = lehigh_motor.SAMPLE_TIME
    held = round(HOLD / step)
    command = np.repeat(LEVELS, held)
    time = step * np.arange(command.size)
    noise = np.random.default_rng(seed).normal(size=(time.size, 2)) * np.sqrt(lehigh_motor.VARIANCES)
    velocity = simulate(plant, time, command, time, noise=noise).output[:, VELOCITY].reshape(len(LEVELS), held)
    # The second half of each level is settled: the motor's time constant is a tenth of it.
    settled, level = velocity[:, held // 2 :].mean(axis=1), np.array(LEVELS)
    error = float(np.sqrt(lehigh_motor.VARIANCES[VELOCITY] / (held // 2)))
    moving = np.abs(settled) > 5.0 * error
    regressors = np.column_stack([level[moving], -np.sign(level[moving])])
    gain, product = np.linalg.lstsq(regressors, settled[moving], rcond=None)[0]
    return float(product / gain)


def chosen_gap(seed: int) -> float:
    """Gap that leaves the thesis's variance of the position error at one amplitude [rad]."""
    from scipy.optimize import brentq

    from idloop.estimation.black_box.sampled import sampled

    published = lehigh_motor.WITH_BACKLASH[CHOSEN_AT].position

    def excess(gap: float) -> float:
        model = lehigh_motor.toolbox_fit(sampled(_record(machine(gap), CHOSEN_AT, seed)))
        return float(model.covariance[POSITION, POSITION]) - published

    return float(brentq(excess, *GAPS, xtol=1e-4))


def _record(plant: Any, amplitude: float, seed: int) -> Record:
    return lehigh_motor.square_wave(plant, amplitude, lehigh_motor.samples(), seed)


def _level(amplitude: float, data: SampledData, gap: float) -> Level:
    """Fit one record, and compare the first harmonics of the position."""
    from idloop.estimation.describing_functions import FrictionBacklash
    from idloop.estimation.describing_functions.sine_fit import sine_fit
    from idloop.physics import simulate
    from idloop.validation import fit_percent

    model = lehigh_motor.toolbox_fit([data])
    modelled = model.simulate(data, "zero")
    silent = simulate(machine(gap), data.time, data.input[:, 0], data.time).output
    late = data.time >= SETTLING / lehigh_motor.SQUARE_FREQUENCY
    omega = 2.0 * np.pi * lehigh_motor.SQUARE_FREQUENCY

    def first(signal: Array) -> complex:
        # The harmonics below half the sample rate of ten samples a second go beside it.
        return complex(sine_fit(data.time[late], signal[late], lehigh_motor.SQUARE_FREQUENCY, 9).phasors[0])

    ours, measured = first(modelled[:, POSITION]), first(data.output[:, POSITION])
    turned = first(data.output[:, VELOCITY]) / (1j * omega)
    return Level(
        amplitude=amplitude,
        data=data,
        model=model,
        modelled=modelled,
        fit=fit_percent(data.output, modelled),
        most=fit_percent(data.output, silent),
        ratio=abs(ours / measured),
        late=float(np.degrees(np.angle(ours / measured))),
        moved=abs(turned),
        passed=measured / turned,
        theory=complex(FrictionBacklash(gap).gain(abs(turned))),
    )
