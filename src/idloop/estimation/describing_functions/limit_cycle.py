"""Limit cycles: where the critical locus −1/N(A) of an element meets the frequency response of a linear part."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from idloop.arrays import Array, Complex
from idloop.errors import InputError
from idloop.estimation.black_box.labels import new_axes
from idloop.estimation.describing_functions.describing_function import DescribingFunction, closed_form, drive_by_sine
from idloop.estimation.describing_functions.elements import ClosedForm, Relay, positive_amplitudes
from idloop.estimation.describing_functions.linear_part import LinearPart, linear_part
from idloop.estimation.describing_functions.relay_cycle import RelayCycle, relay_cycles
from idloop.json_values import to_json

# A zero on an edge belongs to both triangles, and a table's own edge to the table, whatever rounding makes of it.
_EDGE = 1e-9
# Amplitudes of the grid: how close to the threshold they begin, how far they reach, how many.
NEAREST, FARTHEST, AMPLITUDES = 1e-4, 1e4, 500
# Two answers that differ by less than this part are one limit cycle.
SAME = 1e-4
# Gain at amplitudes (m,) and frequencies [Hz] (k,), shape (m, k); (m, 1) where it is the same at every frequency.
Gain = Callable[[ArrayLike, ArrayLike], Complex]


@dataclass(frozen=True)
class LimitCycle:
    """One predicted oscillation of the loop."""

    amplitude: float  # of the first harmonic at the element's input
    frequency: float  # Hz
    point: complex  # G(jω) = −1/N there
    growth: float  # rate at which a small relative error of the amplitude grows [1/s]; below 0 it dies out
    stable: bool  # the error dies out, and no other root of the loop with the element's gain grows
    # Estimated rms of the higher harmonics at the element's input over the first: the linear part's answer to the
    # element's. The prediction holds where it is small.
    harmonics: float

    @property
    def gain(self) -> complex:
        """Describing function there."""
        return -1.0 / self.point

    def to_dict(self) -> dict[str, float | bool | None]:
        """Return plain values for JSON."""
        names = ("amplitude", "frequency", "growth", "stable", "harmonics")
        values = {name: getattr(self, name) for name in names}
        return dict(to_json({**values, "point_real": self.point.real, "point_imag": self.point.imag}))

    def plot(self, axes: Any = None) -> Any:
        """Mark the point in the complex plane, full where stable; returns the matplotlib axes."""
        ax = new_axes(axes)
        look = "C3" if self.stable else "none"
        text = f"{'stable' if self.stable else 'unstable'}: A {self.amplitude:.4g}, {self.frequency:.4g} Hz"
        ax.plot(self.point.real, self.point.imag, "o", color="C3", markerfacecolor=look, label=text)
        ax.legend(frameon=False)
        return ax


@dataclass(frozen=True, eq=False)
class LimitCycles:
    """All limit cycles of one loop within a range of amplitudes and a band."""

    name: str  # of the element
    cycles: tuple[LimitCycle, ...]  # by growing amplitude; empty where none is predicted
    amplitude: Array  # shape (m,): searched amplitudes at the element's input
    # shape (m,): −1/N at them; of a gain that depends on the frequency, at the cycle's or else the middle frequency
    locus: Complex
    frequency: Array  # shape (k,): searched frequencies [Hz]
    response: Complex  # shape (k,): g(jω) at them
    unit: str = ""  # of the element's input; empty where not known
    # Of a relay without a dead zone behind a continuous system, without the harmonic assumption (`relay_cycles`)
    exact: tuple[RelayCycle, ...] = ()

    def __repr__(self) -> str:
        """Name the element and its cycles; the curves are what `plot` and `to_dict` are for."""
        unit = f" {self.unit}" if self.unit else ""
        first_harmonic = [
            f"{'stable' if one.stable else 'unstable'}: {one.amplitude:.4g}{unit} at {one.frequency:.4g} Hz"
            for one in self.cycles
        ]
        exact = [
            f"exactly {'stable' if one.stable else 'unstable'}: peak {one.peak:.4g}{unit} at {one.frequency:.4g} Hz"
            for one in self.exact
        ]
        first = first_harmonic or ["none by the first harmonic" if exact else "none"]
        return f"LimitCycles({self.name}: {'; '.join([*first, *exact])})"

    @property
    def stable(self) -> tuple[LimitCycle, ...]:
        """Those that the loop settles on."""
        return tuple(cycle for cycle in self.cycles if cycle.stable)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        values = {name: getattr(self, name) for name in ("name", "unit", "amplitude", "frequency")}
        for name in ("cycles", "exact"):
            values[name] = [cycle.to_dict() for cycle in getattr(self, name)]
        for name in ("locus", "response"):
            curve = getattr(self, name)
            values |= {f"{name}_real": curve.real, f"{name}_imag": curve.imag}
        return dict(to_json(values))

    def plot(self, axes: Any = None) -> Any:
        """Draw G(jω), −1/N(A) and their meetings in the complex plane; returns the matplotlib axes."""
        ax = new_axes(axes)
        ax.plot(self.response.real, self.response.imag, color="C0", label="G(jω)")
        ax.plot(self.locus.real, self.locus.imag, color="C1", label=f"−1/N(A) of {self.name}")
        for cycle in self.cycles:
            cycle.plot(ax)
        for one in self.exact:
            text = f"exact: A {one.amplitude:.4g}, {one.frequency:.4g} Hz"
            ax.plot(one.point.real, one.point.imag, "x", color="C3", label=text)
        points = [cycle.point for cycle in self.cycles] + [one.point for one in self.exact]
        # Both curves are unbounded: show the neighbourhood of the intersections, or else of −1.
        reach = 2.0 * max([abs(point) for point in points], default=1.0)
        ax.set(xlim=(-reach, 0.5 * reach), ylim=(-reach, 0.5 * reach))
        ax.set(xlabel="real part [-]", ylabel="imaginary part [-]")
        ax.axhline(0.0, color="0.6", linewidth=0.6)
        ax.axvline(0.0, color="0.6", linewidth=0.6)
        ax.legend(frameon=False)
        return ax


def limit_cycles(
    system: Any,
    element: ClosedForm | DescribingFunction,
    *,
    delay: float = 0.0,
    amplitude: ArrayLike | None = None,
    frequency: tuple[float | None, float | None] = (None, None),
    unit: str = "",
) -> LimitCycles:
    """Find every meeting of −1/N(A) with G(jω) of a loop with negative feedback.

    The loop is x = −G·y, y = element(x); a limit cycle is a root of 1 + N(A) G(jω) = 0. All cells of a grid
    over amplitude and frequency are searched, and each root found is refined.

    Parameters
    ----------
    system : control.TransferFunction or control.StateSpace
        Everything linear in the loop, continuous or sampled.
    element : ClosedForm or DescribingFunction
        The nonlinear element, or a table of it, computed or measured, that is interpolated.
    delay : float
        Further delay in the loop [s].
    amplitude : array_like, shape (m,), optional
        Amplitudes of the grid; by default from just above the element's threshold to 10⁴ times it, of a
        table its own.
    frequency : (low, high), optional
        Band [Hz]; None leaves a limit to the poles, zeros and delay, of a table over several frequencies to it.
    unit : str
        Of the element's input, for labels.

    Raises
    ------
    InputError
        Something other than such a system or element, bad amplitudes, or an empty band.

    Notes
    -----
    Stability: with an amplitude error δA the loop's root moves to jω + σ + jδω with
    σ = −Im(C'(A) / (dG/dω)) δA, C = −1/N. It dies out where −1/N with growing amplitude leaves to the
    left of G(jω) with growing ω, out of the region that an open-loop stable G encircles (Loeb's criterion;
    Gelb and Vander Velde, Multiple-Input Describing Functions, 1968).

    A first harmonic describes the whole motion only where G attenuates the others. Behind a lag of first order a
    relay with hysteresis oscillates (a thermostat), though −1/N has a negative real part and G none, so that they never
    meet: that is in `LimitCycles.exact`.

    Examples
    --------
    >>> import control
    >>> from idloop.estimation.describing_functions import Relay
    >>> found = limit_cycles(control.tf([1], [1, 2, 1, 0]), Relay(1.0))
    >>> [(round(c.amplitude, 3), round(c.frequency, 4), c.stable) for c in found.cycles]
    [(0.637, 0.1592, True)]
    """
    linear, gain = linear_part(system, delay), _gain(element)
    band = linear.grid(*_band(element, frequency))
    response = linear.response(band)
    known = np.isfinite(response)
    band, response = band[known], response[known]
    sizes = _amplitudes(element, amplitude, response)
    values = gain(sizes, band)
    with np.errstate(divide="ignore", invalid="ignore"):
        grid = response[None, :] + 1.0 / np.where(values == 0.0, np.nan, values)
    cycles: list[LimitCycle] = []
    for row, column in grid_roots(grid):
        a, f = _refined(linear, gain, _between(sizes, row), _between(band, column))
        if not any(abs(a / c.amplitude - 1.0) < SAME and abs(f / c.frequency - 1.0) < SAME for c in cycles):
            cycles.append(_cycle(linear, element, gain, a, f))
    cycles.sort(key=lambda cycle: (cycle.amplitude, cycle.frequency))
    at = cycles[0].frequency if cycles else float(band[band.size // 2])
    locus = np.array([_inverse(value) for value in gain(sizes, at)[:, 0]], dtype=np.complex128)
    label = unit or getattr(element, "input_unit", "")
    exact: tuple[RelayCycle, ...] = ()
    if isinstance(element, Relay) and element.lower == -element.on and linear.held_between:
        exact = relay_cycles(system, element, delay=delay)
    return LimitCycles(element.name, tuple(cycles), sizes, locus, band, response, label, exact)


def grid_roots(value: Complex) -> Array:
    """Fractional rows and columns, shape (r, 2), of the zeros of a function that is linear on each half of every cell.

    `value` (m, k): cells with a value that is not finite hold no zero; one on an edge may appear twice.
    """
    if min(value.shape) < 2:
        return np.zeros((0, 2))
    low, right, up, far = value[:-1, :-1], value[:-1, 1:], value[1:, :-1], value[1:, 1:]
    return np.concatenate([_triangle_roots(low, up, right), 1.0 + _triangle_roots(far, right, up, sign=-1.0)])


def _triangle_roots(corner: Complex, row: Complex, column: Complex, sign: float = 1.0) -> Array:
    """Cells whose triangle holds 0, and how far along the row and the column it lies there."""
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        along, across = row - corner, column - corner
        area = along.real * across.imag - along.imag * across.real
        s = (across.real * corner.imag - across.imag * corner.real) / area
        t = (along.imag * corner.real - along.real * corner.imag) / area
        inside = (s >= -_EDGE) & (t >= -_EDGE) & (s + t <= 1.0 + 2.0 * _EDGE)
    return np.argwhere(inside) + sign * np.column_stack([s[inside], t[inside]])


def _gain(element: ClosedForm | DescribingFunction) -> Gain:
    """Gain of an element in closed form, or interpolated in a table."""
    if isinstance(element, DescribingFunction):
        return _interpolated(element)
    known = closed_form(element)
    if known is None:
        raise InputError(f"{element.name}: no closed form; tabulate it with describing_function first")
    return lambda amplitude, frequency: known.gain(np.atleast_1d(np.asarray(amplitude, dtype=float)))[:, None]


def _interpolated(table: DescribingFunction) -> Gain:
    """Gain on straight lines over log amplitude and log frequency; NaN beyond the table."""
    lines = sorted(table.lines(), key=lambda line: line[0])
    if any(places.size < 2 for _, places in lines):
        raise InputError(f"{table.name}: each frequency needs two amplitudes or more, between which to look")
    frequencies = np.log([frequency for frequency, _ in lines])

    def gain(amplitude: ArrayLike, frequency: ArrayLike) -> Complex:
        where, at = (np.log(np.atleast_1d(np.asarray(one, dtype=float))) for one in (amplitude, frequency))
        rows = np.array([_on_line(where, np.log(table.amplitude[one]), table.gain[one]) for _, one in lines])
        if len(rows) == 1:
            return np.asarray(rows.T, dtype=np.complex128)
        return np.array([_on_line(at, frequencies, column) for column in rows.T], dtype=np.complex128)

    return gain


def _on_line(where: Array, x: Array, value: Complex) -> Complex:
    inside = (where >= x[0] - _EDGE) & (where <= x[-1] + _EDGE)
    return np.where(inside, np.interp(where, x, value), np.nan)


def _at(gain: Gain, amplitude: float, frequency: float) -> complex:
    return complex(gain(amplitude, frequency)[0, 0])


def _inverse(gain: complex) -> complex:
    return -1.0 / gain if gain != 0.0 else complex("nan")


def _between(values: Array, place: float) -> float:
    return float(np.exp(np.interp(place, np.arange(values.size), np.log(values))))


def _band(
    element: ClosedForm | DescribingFunction, frequency: tuple[float | None, float | None]
) -> tuple[float | None, float | None]:
    low, high = frequency
    if isinstance(element, DescribingFunction) and sum(1 for _ in element.lines()) > 1:
        low = float(np.min(element.frequency)) if low is None else low
        high = float(np.max(element.frequency)) if high is None else high
    return low, high


def _amplitudes(element: ClosedForm | DescribingFunction, amplitude: ArrayLike | None, response: Complex) -> Array:
    if amplitude is not None:
        return np.unique(positive_amplitudes(amplitude, element.name))
    if isinstance(element, DescribingFunction):
        low, high = float(element.amplitude.min()), float(element.amplitude.max())
        return np.unique(np.concatenate([element.amplitude, np.geomspace(low, high, AMPLITUDES)]))
    threshold = element.threshold
    if threshold > 0.0:
        return threshold * (1.0 + np.geomspace(NEAREST, FARTHEST, AMPLITUDES))
    # N(A) = N(1)/A: the response itself gives the amplitudes that can meet it.
    sizes = np.abs(element.gain(1.0)) * np.abs(response[response != 0.0])
    return np.geomspace(0.5 * sizes.min(), 2.0 * sizes.max(), AMPLITUDES)


def _refined(linear: LinearPart, gain: Gain, amplitude: float, frequency: float) -> tuple[float, float]:
    """Root of 1 + N G near a point of the grid; the point itself where none is found."""
    from scipy.optimize import root

    def equation(x: Array) -> list[float]:
        # A root far from the cell is another one.
        a, f = np.exp(np.clip(x, -1.0, 1.0)) * (amplitude, frequency)
        left = 1.0 + _at(gain, a, f) * complex(linear.response(f)[0])
        return [left.real, left.imag] if np.isfinite(left) else [1e3, 1e3]

    found = root(equation, [0.0, 0.0], tol=1e-12)
    near = bool(np.all(np.abs(found.x) < 0.2)) and float(np.max(np.abs(found.fun))) < 1e-6
    if not near:
        return amplitude, frequency
    return amplitude * math.exp(found.x[0]), frequency * math.exp(found.x[1])


def _cycle(
    linear: LinearPart, element: ClosedForm | DescribingFunction, gain: Gain, amplitude: float, frequency: float
) -> LimitCycle:
    point, step = complex(linear.response(frequency)[0]), 1e-4
    louder, quieter = (_inverse(_at(gain, amplitude * (1.0 + one), frequency)) for one in (step, -step))
    # N varies with the frequency as well where its table has several.
    faster, slower = (_inverse(_at(gain, amplitude, frequency * (1.0 + one))) for one in (step, -step))
    turn = (faster - slower) / (4.0 * math.pi * step * frequency)
    growth = -((louder - quieter) / (2.0 * step) / (linear.slope(frequency) - turn)).imag
    return LimitCycle(
        amplitude=amplitude,
        frequency=frequency,
        point=point,
        growth=float(growth),
        stable=bool(growth < 0.0 and not _other_growth(linear, _at(gain, amplitude, frequency), frequency)),
        harmonics=_harmonics(linear, element, amplitude, frequency, point),
    )


def _other_growth(linear: LinearPart, gain: complex, frequency: float) -> bool:
    """Whether a root other than the cycle's own pair grows, with the element as a constant gain."""
    roots = linear.closed_roots(gain)
    own = 2j * math.pi * frequency
    # A complex gain holds for positive frequencies only: the other half mirrors it.
    upper = roots[roots.imag >= -1e-9 * abs(own)]
    if upper.size == 0:
        return False
    others = np.delete(upper, np.argmin(np.abs(upper - own)))
    return bool(np.any(others.real > 1e-6 * abs(own)))


def _harmonics(
    linear: LinearPart, element: ClosedForm | DescribingFunction, amplitude: float, frequency: float, point: complex
) -> float:
    if isinstance(element, DescribingFunction):
        share = element.harmonics[np.argmin(np.abs(element.amplitude - amplitude))]
    else:
        share = drive_by_sine(element, amplitude, frequency).harmonics
    passed = np.abs(linear.response(frequency * np.arange(2, share.size + 2))) / abs(point)
    return float(np.sqrt(np.sum((share * passed) ** 2)))
