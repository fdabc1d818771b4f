"""Start values of effects in a screening, from typical sizes in the records."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

# Periods within the travel below which a wave is no more than a curve over the position.
FEWEST_PERIODS = 2.0
# Parameter values of an effect in a screening.
Trial = Mapping[str, float]
# Alternatives; the trials of one alternative are tested together.
Trials = Callable[["Scales"], Sequence[Sequence[Trial]]]
# The same for the full form of an effect that the model has in its plain form, from the values of that.
FurtherTrials = Callable[["Scales", Trial], Sequence[Sequence[Trial]]]


@dataclass(frozen=True)
class Scales:
    """Typical sizes at one site of a model in a set of records."""

    # Root mean square and largest command [input unit]
    command: float
    command_most: float
    limit: float  # command limit that the model has already; infinite without one
    force: float  # root mean square force of the drive
    # Root mean square and largest speed of the body
    speed: float
    speed_most: float
    # Middle and range of the body's positions
    middle: float
    span: float
    # Typical twist of the coupling; typical and largest torque through it
    twist: float
    torque: float
    torque_most: float
    # Of the body or the coupling
    inertia: float
    stiffness: float
    # Root mean square and measurement noise of the output
    output: float
    noise: float
    # Of the records [s]
    sample_time: float
    duration: float
    dry: float  # level of dry friction that the model has already at the body
    angle: bool  # whether positions are angles in radians
    turns: float  # range of the positions in turns; 0 for a linear axis
    # Strongest harmonics of a turn in an unexplained force; empty where none shows or none was looked for
    harmonics: tuple[int, ...] = ()
    # Strongest period over the position in it; empty as above
    periods: tuple[float, ...] = ()
    # Mean of each measured condition at the site, such as ``temperature``
    conditions: Mapping[str, float] = field(default_factory=dict)

    def repeating(self, orders: Iterable[int]) -> list[int]:
        """Those harmonics of a turn that repeat within the travel."""
        return [order for order in orders if order * self.turns >= FEWEST_PERIODS]

    def about(self, condition: str, otherwise: float) -> float:
        """Mean of a measured condition with three digits, as its reference."""
        return float(f"{self.conditions.get(condition, otherwise):.3g}") or otherwise

    def unit(self, template: str) -> float:
        """Typical size of a quantity from its unit, such as ``{force}·s/{position}``."""
        numerator, *denominators = template.split("/")
        sizes = {
            "{force}": self.force,
            "{input}": self.command,
            "{position}": self.span,
            "{output}": self.output,
            "s": self.span / max(self.speed, 1e-12 * self.span, 1e-300),
        }
        size = 1.0
        for sign, part in [(1, numerator), *((-1, text) for text in denominators)]:
            for factor in part.strip("()").split("·"):
                base, power = factor, 1
                for mark, value in (("²", 2), ("³", 3)):
                    if factor.endswith(mark):
                        base, power = factor[:-1], value
                size *= max(sizes.get(base, 1.0), 1e-300) ** (sign * power)
        return size


def alternatives(name: str, values: Sequence[float], **others: float) -> list[list[Trial]]:
    """One alternative for each value of a parameter, with constant others."""
    return [[{name: value, **others}] for value in values]


def waves(amplitude: float, harmonics: Sequence[int] | None = None) -> list[list[Trial]]:
    """Sine and cosine over a turn, or over each of several harmonics of it."""
    if harmonics is None:
        return [_sine_and_cosine(amplitude=amplitude)]
    return [_sine_and_cosine(amplitude=amplitude, harmonic=float(n)) for n in harmonics]


def repetitions(amplitude: float, periods: Sequence[float]) -> list[list[Trial]]:
    """Sine and cosine over the position, of each of several periods."""
    return [_sine_and_cosine(amplitude=amplitude, period=period) for period in periods]


def _sine_and_cosine(**values: float) -> list[Trial]:
    return [{**values, "phase": phase} for phase in (0.0, 1.5707963267948966)]


def time_constants(scales: Scales) -> list[float]:
    """Delays and lags from half a sample to a quarter of a second."""
    found, value = [], 0.5 * scales.sample_time
    while value <= max(0.25, 4.0 * scales.sample_time):
        found.append(value)
        value *= 2.0
    return found


def resonances(scales: Scales) -> list[float]:
    """Candidate frequencies of a resonance [Hz], up to a quarter of the sample rate."""
    highest = 0.25 / scales.sample_time
    found, value = [], max(2.0 / scales.duration, 1e-3 * highest)
    while value <= highest:
        found.append(value)
        value *= 1.8
    return found
