"""Best linear approximation of a nonlinear plant, with noise and nonlinear distortion separated.

The response of a plant to random-phase multisines is that of a linear system, its best linear approximation,
plus a stochastic nonlinear distortion that changes with the phases but not from period to period. Noise changes
from period to period (Pintelon and Schoukens, System Identification: A Frequency Domain Approach, 2nd ed.,
sections 3.4 and 4.3).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from idloop.arrays import Array, Complex, Integers, Mask
from idloop.errors import InputError
from idloop.estimation.black_box.sampled import SampledData
from idloop.estimation.nonparametric.distortion import Distortion, LineLevels, combined_p_value
from idloop.estimation.nonparametric.frequency_response import FrequencyResponse
from idloop.estimation.nonparametric.periodic import PeriodicSpectra, by_period
from idloop.signals.base import LineGrid

_CLEAR = 25.0  # least power of an input at a line over that of its noise, for a division by it
_NEIGHBOURS = 6  # empty lines that are averaged for the distortion at an excited one


def robust_best_linear_approximation(
    data: Sequence[SampledData],
    period: int,
    *,
    lines: LineGrid | Sequence[LineGrid] | None = None,
    skip: int = 1,
    by_reference: bool = False,
    drift: bool = True,
) -> FrequencyResponse:
    """Average over realisations and periods (robust method, Pintelon and Schoukens, 2nd ed., section 4.3.1).

    The scatter over the periods of an experiment is noise; the scatter over the experiments is noise and
    stochastic nonlinear distortion together.

    Parameters
    ----------
    data : sequence of SampledData
        Two or more experiments of the same amplitude and band with independent random phases, two or more
        periods each after the transient. The empty lines need not be the same.
    period : int
        Of the excitation [samples].
    lines : LineGrid, or one for each experiment, optional
        What was excited; read off the excitation's spectrum by default.
    skip : int
        Periods at the start that are left to the transient.
    by_reference : bool
        Feedback around the plant: the spectra are taken relative to the reference's, and the response is that of
        the outputs over that of the input (section 3.8).
    drift : bool
        Take off the straight line by which the signals move from period to period.

    Returns
    -------
    FrequencyResponse
        `stderr` holds noise and distortion, `distortion` each of them.

    Raises
    ------
    InputError
        Fewer than two experiments or periods, or an excitation that does not fit.
    """
    spectra = by_period(data, period, lines=lines, skip=skip, by_reference=by_reference, drift=drift)
    if len(spectra.data) < 2:
        raise InputError(
            f"{spectra.data[0].name}: one realisation; record two or more with other random phases, or use the fast"
            " method on an odd_random grid"
        )
    count = np.sum(spectra.excited, axis=0)
    kept = np.flatnonzero(count >= 2)
    if kept.size == 0:
        raise InputError(f"{spectra.data[0].name}: no line is excited by two realisations; excite one band in all")
    response, own, noise = _relative(spectra, kept)
    excited, count = spectra.excited[:, kept, None], count[kept, None]
    scatter = np.sum(np.abs(own) ** 2, axis=0, where=excited)
    total = scatter / (count - 1) / count
    from_noise = np.sum(noise, axis=0, where=excited) / count**2
    periods = np.array([len(one) for one in spectra.output])
    excess = count * (total - from_noise)
    notes = _noise_notes(spectra, kept)
    left_out = int(np.sum(np.sum(spectra.excited, axis=0) == 1))
    if left_out:
        notes = (*notes, f"{left_out} lines are excited by one realisation only and are left out")
    return _result(
        "robust",
        spectra,
        kept,
        response,
        2.0 * (count[:, 0] - 1.0),
        notes,
        noise=np.sqrt(from_noise),
        total=np.sqrt(total),
        stochastic=np.sqrt(np.maximum(excess, 0.0)),
        single_noise=np.sqrt(count * from_noise),
        excess=excess,
        p_values=combined_p_value(
            count * total,
            count * from_noise,
            2.0 * (count - 1.0),
            2.0 * np.sum(spectra.excited[:, kept] * (periods - 1)[:, None], axis=0)[:, None],
            np.abs(response),
        ),
    )


def fast_best_linear_approximation(
    data: SampledData | Sequence[SampledData], period: int, **options: Any
) -> FrequencyResponse:
    """One experiment on an odd random harmonic grid (fast method, Pintelon and Schoukens, 2nd ed., section 4.3.2).

    What the outputs show at odd lines that nothing excites is odd distortion and noise, and at even lines even
    distortion and noise; noise is the scatter over the periods. Power of the input at those lines, which feedback
    or the drive puts there, is accounted for by the response interpolated between the excited lines. The odd
    distortion of the empty lines next to an excited one is taken for its own.

    `data`, `period`, `**options`: as for the robust method; one experiment is enough, more are averaged. Returns:
    `stderr` holds noise and odd distortion, `distortion` each of them and the levels at the empty lines. Raises
    InputError: an excitation that leaves no odd line empty or excites even ones, or fewer than two periods.
    """
    spectra = by_period(data, period, **options)
    first = spectra.data[0]
    any_excited = np.flatnonzero(np.any(spectra.excited, axis=0))
    harmonic = np.arange(1, spectra.frequency.size + 1)
    if np.any(spectra.excited[:, harmonic % 2 == 0]):
        turns = int(np.gcd.reduce(harmonic[any_excited]))
        if turns > 1 and period % turns == 0:
            raise InputError(
                f"{first.name}: the excitation repeats after {period // turns} samples already,"
                f" {turns} times in a period of {period}: give a period of {period // turns * first.sample_time:.6g} s"
            )
        power = np.abs(spectra.driver) ** 2
        share = 100.0 * float(np.sum(power[:, harmonic % 2 == 0]) / np.sum(power))
        raise InputError(
            f"{first.name}: even harmonics are excited, by {share:.2g} % of the power; the fast method needs the grid"
            " odd_random, and a command without noise"
        )
    inside = (harmonic >= harmonic[any_excited[0]]) & (harmonic <= harmonic[any_excited[-1]])
    empty = inside & ~spectra.excited
    if not np.any(empty[:, harmonic % 2 == 1]):
        raise InputError(f"{first.name}: no odd harmonic is left empty; the fast method needs the grid odd_random")
    response, _, noise = _relative(spectra, any_excited)
    excited = spectra.excited[:, any_excited, None]
    count = np.sum(excited, axis=0)
    from_noise = np.sum(noise, axis=0, where=excited) / count**2
    levels, scatter = _squares(_unexplained(spectra, any_excited, response))
    odd = _levels(spectra, empty & (harmonic % 2 == 1), levels, scatter)
    even = _levels(spectra, empty & (harmonic % 2 == 0), levels, scatter)
    command = np.array([np.abs(np.mean(one[:, any_excited], axis=0)) for one in spectra.input])
    through = np.sqrt(np.sum(command**2, axis=0, where=excited[:, :, 0]) / count[:, 0])
    nearby, averaged = _nearby(odd.frequency, odd.level**2, spectra.frequency[any_excited])
    above, _ = _nearby(odd.frequency, odd.level**2 - odd.noise**2, spectra.frequency[any_excited])
    single = np.sqrt(nearby) / through[:, None]
    total = np.maximum(single / np.sqrt(count), np.sqrt(from_noise))
    stochastic = np.sqrt(np.maximum(total**2 - from_noise, 0.0) * count)
    seen = _levels(spectra, spectra.excited, *_squares(spectra.output))
    return _result(
        "fast",
        spectra,
        any_excited,
        response,
        np.full(any_excited.size, 2.0 * averaged),
        _noise_notes(spectra, any_excited),
        noise=np.sqrt(from_noise),
        total=total,
        stochastic=stochastic,
        single_noise=np.sqrt(count * from_noise),
        excess=above / through[:, None] ** 2,
        p_values=odd.p_values,
        excited=seen,
        odd=odd,
        even=even,
    )


def _relative(spectra: PeriodicSpectra, kept: Integers) -> tuple[Complex, Complex, Array]:
    """Response over all realisations, each one's deviation from it and its noise variance.

    Returns `response` (f, p); `own` (experiments, f, p): deviation of each realisation, in units of the response;
    `noise` (experiments, f, p): variance of the mean over the periods of each realisation, in the same units.
    """
    excited = spectra.excited[:, kept]
    driver = np.where(excited, spectra.driver[:, kept], 1.0)[:, :, None]
    output = np.array([np.mean(one[:, kept], axis=0) for one in spectra.output]) / driver
    command = np.array([np.mean(one[:, kept], axis=0) for one in spectra.input])[:, :, None] / driver
    count = np.sum(excited, axis=0)[:, None]
    mean_command = np.sum(command, axis=0, where=excited[:, :, None]) / count
    response = np.sum(output, axis=0, where=excited[:, :, None]) / count / mean_command
    own = (output - response * command) / mean_command
    noise = np.empty(own.shape)
    for row, one, other, scale in zip(noise, spectra.output, spectra.input, driver, strict=True):
        left = one[:, kept] - response * other[:, kept, None]
        # The scatter of a difference, not a difference of scatters: input noise and feedback are in it.
        row[:] = _variance_of_mean(left) / np.abs(scale * mean_command) ** 2
    return response, own, noise


def _variance_of_mean(periods: Complex) -> Array:
    """Variance of the mean over the periods, from their scatter, shape (f, p)."""
    count = len(periods)
    return np.asarray(np.sum(np.abs(periods - np.mean(periods, axis=0)) ** 2, axis=0) / (count - 1) / count)


def _noise_notes(spectra: PeriodicSpectra, kept: Integers) -> tuple[str, ...]:
    """A note where the input is too noisy to divide by: the error of a ratio is normal only while it is small."""
    excited = spectra.excited[:, kept]
    driver = np.where(excited, spectra.driver[:, kept], 1.0)
    count = np.sum(excited, axis=0)
    through = np.array([np.mean(one[:, kept], axis=0) for one in spectra.input]) / driver
    noise = np.array([_variance_of_mean(one[:, kept]) for one in spectra.input]) / np.abs(driver) ** 2
    mean = np.abs(np.sum(through, axis=0, where=excited) / count) ** 2
    lines = int(np.sum(mean < _CLEAR * np.sum(noise, axis=0, where=excited) / count**2))
    if not lines:
        return ()
    what = "the input does not exceed its noise clearly; excite stronger or average more periods"
    return (f"at {lines} of {kept.size} lines {what}",)


def _unexplained(spectra: PeriodicSpectra, kept: Integers, response: Complex) -> list[Complex]:
    """What the input does not explain of the outputs of each realisation, shape (periods, k, p)."""
    line = np.arange(spectra.frequency.size)
    between = np.stack([np.interp(line, kept, column) for column in response.T], axis=1)
    return [one - between * other[:, :, None] for one, other in zip(spectra.output, spectra.input, strict=True)]


def _squares(realisations: Sequence[Complex]) -> tuple[Array, Array]:
    """Squared amplitude of the mean over the periods and its noise variance, shapes (experiments, k, p)."""
    level = np.array([np.abs(np.mean(one, axis=0)) ** 2 for one in realisations])
    return level, np.array([_variance_of_mean(one) for one in realisations])


def _levels(spectra: PeriodicSpectra, lines: Mask, level: Array, noise: Array) -> LineLevels:
    """Root mean squares at some lines over the realisations in which they are of this kind."""
    count = np.sum(lines, axis=0)
    where = np.flatnonzero(count)
    weight = lines[:, where, None]
    power, left = (np.sum(value[:, where], axis=0, where=weight) / count[where, None] for value in (level, noise))
    periods = np.array([len(one) for one in spectra.output])
    degrees = 2.0 * np.sum(lines[:, where] * (periods - 1)[:, None], axis=0)[:, None]
    size = np.sqrt(np.max([np.mean(np.abs(one) ** 2, axis=0) for one in spectra.output], axis=(0, 1)))
    p_values = combined_p_value(power, left, 2.0 * count[where, None], degrees, size[None, :])
    return LineLevels(spectra.frequency[where], np.sqrt(power), np.sqrt(left), p_values)


def _nearby(lines: Array, power: Array, frequency: Array) -> tuple[Array, int]:
    """Mean of the lines nearest to each frequency, shape (f, p), and how many they are."""
    count = min(_NEIGHBOURS, lines.size)
    middle = np.searchsorted(lines, frequency)
    start = np.clip(middle - count // 2, 0, lines.size - count)
    index = start[:, None] + np.arange(count)
    return np.asarray(np.mean(power[index], axis=1)), count


def _result(
    method: str,
    spectra: PeriodicSpectra,
    kept: Integers,
    response: Complex,
    degrees: Array,
    notes: tuple[str, ...],
    **distortion: Any,
) -> FrequencyResponse:
    first, frequency = spectra.data[0], spectra.frequency[kept]
    found = Distortion(
        frequency=frequency,
        realisations=len(spectra.data),
        periods=spectra.periods,
        output_names=first.output_names,
        output_units=first.output_units,
        **distortion,
    )
    return FrequencyResponse(
        method=f"best linear approximation ({method})",
        frequency=frequency,
        response=response[:, :, None],
        stderr=found.total[:, :, None],
        degrees=degrees,
        samples=spectra.samples,
        distortion=found,
        notes=notes,
        **first.labels,
    )
