"""Describing function between two recorded signals of a stepped-sine experiment."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from idloop.arrays import Array
from idloop.errors import InputError
from idloop.estimation.describing_functions.describing_function import HARMONICS, DescribingFunction, Places
from idloop.estimation.describing_functions.dwell import Dwell, RecordedSignal, find_dwells, recorded_signal
from idloop.estimation.describing_functions.linear_part import linear_part
from idloop.estimation.describing_functions.sine_fit import SineFit, held_sine_fit, sine_fit
from idloop.json_values import to_json
from idloop.records import Record

# Frequencies beside the fundamental at which the noise is read: enough to average, near enough for the same noise.
BESIDE = 8
# Fitted unknowns need more samples than this many times their number.
SAMPLES_PER_UNKNOWN = 2


@dataclass(frozen=True, eq=False, kw_only=True)
class MeasuredDescribingFunction(DescribingFunction):
    """A describing function measured from records, with how sure each point is."""

    record: tuple[str, ...]  # length n: record of each point
    # The two signals
    source: str
    target: str
    # shape (n,): standard error of the complex gain, rms of its distance from the true one; NaN where one period leaves
    # no frequency beside the fundamental to read the noise at
    stderr: Array
    radius: Array  # shape (n,): radius of the circle around the gain that holds the true one with the given probability
    probability: float  # of the circle
    # shape (n,): total harmonic distortion of the source: a describing function asks for a sine
    source_distortion: Array
    periods: Array  # shape (n,): periods fitted

    def without(self, system: Any, delay: float = 0.0) -> MeasuredDescribingFunction:
        """Divide a known linear part out: what is left is the element before it (exactly) or behind it.

        A linear part behind the element passes the first harmonic whatever the others are. One before it
        changes the amplitude at the element as well: measure from the signal between them instead.

        `system`: from the element's output to the target; `delay`: further delay [s]. Returns: its distortion and
        harmonics are unknown (NaN): those of the target passed through the linear part. Raises InputError: not such a
        system, or it passes nothing at a frequency.
        """
        response = linear_part(system, delay).response(self.frequency)
        if not np.all(np.isfinite(response)) or np.any(response == 0.0):
            raise InputError(f"{self.name}: the linear part has a pole or a zero at one of the frequencies")
        size = np.abs(response)
        return replace(
            self,
            gain=self.gain / response,
            stderr=self.stderr / size,
            radius=self.radius / size,
            distortion=np.full_like(self.distortion, np.nan),
            harmonics=np.full_like(self.harmonics, np.nan),
            output_unit="",
        )

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON; numbers that are not finite become None."""
        names = ("source", "target", "record", "stderr", "radius", "probability", "source_distortion")
        measured = {name: getattr(self, name) for name in names}
        return dict(to_json({**super().to_dict(), **measured, "periods": self.periods.astype(int)}))

    def _draw(self, axes: Any, x: Array, places: Places, label: str) -> None:
        super()._draw(axes, x, places, label)
        colour = axes[0].lines[-1].get_color()
        size, radius = np.abs(self.gain[places]), self.radius[places]
        known = np.isfinite(radius)
        axes[0].errorbar(x[known], size[known], radius[known], fmt="none", ecolor=colour, capsize=2)
        # The angle under which the circle is seen; all of them where it holds the origin.
        angle = np.degrees(np.arcsin(np.minimum(radius / np.maximum(size, 1e-300), 1.0)))
        phase = np.degrees(np.angle(self.gain[places]))
        axes[1].errorbar(x[known], phase[known], angle[known], fmt="none", ecolor=colour, capsize=2)


def measure_describing_function(
    records: Record | Sequence[Record],
    source: str | None,
    target: str,
    dwells: Sequence[Dwell] | Sequence[Sequence[Dwell]] | None = None,
    *,
    harmonics: int = HARMONICS,
    trend: bool = True,
    probability: float = 0.95,
) -> MeasuredDescribingFunction:
    """Measure the describing function from one recorded signal to another, step by step.

    Of each step the last whole periods are fitted. Commands, references and excitations are taken as held
    between their stamps, outputs as sampled. The noise is read beside the fundamental, from what the target
    does there that the measured gain does not explain by the source: coloured noise and noise on both count.

    Parameters
    ----------
    records : Record or sequence of Record
        Experiments, such as one for each amplitude.
    source : str or None
        Name of the input signal; None: the command. See `recorded_signal` for the names.
    target : str
        Name of the output signal.
    dwells : sequence of Dwell, optional
        From `dwells_of` (one sequence, or one for each record); by default found in the commands.
    harmonics : int
        Highest harmonic fitted, where the sample rate allows.
    trend : bool
        Let outputs drift along a straight line within a step.
    probability : float
        Of the confidence circle.

    Returns
    -------
    MeasuredDescribingFunction
        Points in the order of records and steps.

    Raises
    ------
    InputError
        No records, no such signal, no steps, a step outside the record, too short or too coarsely sampled,
        or without a source's sine.
    """
    every = [records] if isinstance(records, Record) else list(records)
    if not every:
        raise InputError("describing function: no records; give at least one")
    if not 0.0 < probability < 1.0 or harmonics < 1:
        raise InputError(
            f"describing function: probability {probability:g}, {harmonics} harmonics; take 0 to 1, and 1 or more"
        )
    rows: list[dict[str, Any]] = []
    names: list[str] = []
    units = ("", "")
    for index, record in enumerate(every):
        origin = recorded_signal(record, record.input_name if source is None else source)
        answer = recorded_signal(record, target)
        steps = _dwells_for(record, dwells, index, len(every))
        rows += [_point(record, origin, answer, dwell, harmonics, trend, probability) for dwell in steps]
        names += [record.name] * len(steps)
        units = (origin.unit, answer.unit)
    if not rows:
        raise InputError("describing function: no steps; give at least one dwell")
    source_name = every[0].input_name if source is None else source
    columns: dict[str, Any] = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    return MeasuredDescribingFunction(
        **columns,
        name=f"{source_name} → {target}",
        input_unit=units[0],
        output_unit=units[1],
        record=tuple(names),
        source=source_name,
        target=target,
        probability=probability,
    )


def _dwells_for(
    record: Record, dwells: Sequence[Dwell] | Sequence[Sequence[Dwell]] | None, index: int, count: int
) -> Sequence[Dwell]:
    if dwells is None:
        return find_dwells(record)
    one = [dwell for dwell in dwells if isinstance(dwell, Dwell)]
    several = [each for each in dwells if not isinstance(each, Dwell)]
    if not one and len(several) != count:
        raise InputError(
            f"describing function: dwells of {len(several)} records for {count}; give one sequence for each"
        )
    return one or several[index]


def _point(
    record: Record,
    source: RecordedSignal,
    target: RecordedSignal,
    dwell: Dwell,
    harmonics: int,
    trend: bool,
    probability: float,
) -> dict[str, Any]:
    where = f"{record.name}: step at {dwell.start:g} s, {dwell.frequency:g} Hz"
    periods = math.floor(dwell.periods + 1e-3)
    if not (dwell.frequency > 0.0 and periods >= 1):
        raise InputError(f"{where}: shorter than one period; dwell longer")
    start = dwell.stop - periods / dwell.frequency
    # Frequencies beside the fundamental that fit the stretch and are no harmonic of it.
    order = np.arange(1, periods + 2 * BESIDE + 2)
    order = order[order % periods != 0] if periods > 1 else order[:0]
    nearest = order[np.argsort(np.abs(order - periods), kind="stable")][:BESIDE]
    beside = np.sort(nearest) * dwell.frequency / periods
    fits = [_fit(where, signal, dwell, start, harmonics, trend, beside) for signal in (source, target)]
    (origin, answer), (u, y) = fits, (fits[0].phasors[0], fits[1].phasors[0])
    scale = float(np.max(np.abs(source.value)))
    if abs(u) <= 1e-9 * scale or scale == 0.0:
        raise InputError(f"{where}: no sine of this frequency in {source.name}; check the dwells and the source")
    gain = y / u
    stderr = radius = float("nan")
    if beside.size:
        from scipy.stats import f

        left = answer.beside - gain * origin.beside
        stderr = float(np.sqrt(np.mean(np.abs(left) ** 2))) / abs(u)
        radius = stderr * math.sqrt(float(f.ppf(probability, 2, 2 * beside.size)))
    shares = np.full(harmonics - 1, np.nan)
    found = np.abs(answer.phasors[1:]) / max(abs(y), 1e-300)
    shares[: found.size] = found
    return {
        "amplitude": abs(u),
        "frequency": dwell.frequency,
        "gain": complex(gain),
        "distortion": answer.distortion,
        "harmonics": shares,
        "stderr": stderr,
        "radius": radius,
        "source_distortion": origin.distortion,
        "periods": float(periods),
    }


def _fit(
    where: str, signal: RecordedSignal, dwell: Dwell, start: float, harmonics: int, trend: bool, beside: Array
) -> SineFit:
    """Harmonics of one signal over one step, as many as its samples can resolve."""
    step = float(np.median(np.diff(signal.time)))
    slack = 0.5 * step
    # A held signal is known from its first stamp on for good, a sampled one between its stamps.
    late = not signal.held and signal.time[-1] < dwell.stop - 1.5 * step
    if signal.time[0] > start + slack or late:
        raise InputError(
            f"{where}: {signal.name} was recorded from {signal.time[0]:g} to {signal.time[-1]:g} s; "
            "the step does not lie in it"
        )
    most = min(harmonics, math.ceil(0.5 / (step * dwell.frequency)) - 1)
    if most < 1:
        raise InputError(f"{where}: {signal.name} is sampled every {step:g} s, too coarsely for this frequency")
    if signal.held:
        return held_sine_fit(signal.time, signal.value, start, dwell.stop, dwell.frequency, most, beside=beside)
    inside = (signal.time >= start - 1e-6 * step) & (signal.time < dwell.stop - 1e-6 * step)
    unknowns = 2 * most + 1 + int(trend)
    if int(inside.sum()) < SAMPLES_PER_UNKNOWN * unknowns:
        raise InputError(
            f"{where}: {int(inside.sum())} samples of {signal.name} for {unknowns} unknowns; "
            "dwell longer or ask for fewer harmonics"
        )
    time, value = signal.time[inside], signal.value[inside]
    return sine_fit(time, value, dwell.frequency, most, trend=trend, beside=beside)
