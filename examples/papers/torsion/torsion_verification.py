"""Row B6: the seven ways on simulated data, table B.1: open loop, closed loop, with noise, with saturation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from papers import Progress
from papers.claim import at_least, near
from papers.reproduction import Cell, Line, Reproduction, Table
from papers.torsion import torsion_methods
from papers.torsion import torsion_thesis as thesis

if TYPE_CHECKING:
    import control
    from idloop.estimation.black_box.sampled import SampledData
    from idloop.physics import Model
    from idloop.records import Record

Array = NDArray[np.float64]

QUANSER = "Quanser model"
COLUMNS = (*thesis.WAYS, QUANSER)
UNKNOWN = "saturation not known"
# The thesis prints two digits.
_ROUNDING = 0.005
_KNOWN_SATURATION = 95.0
# Edges of a limited command lie between samples of 10 ms; here every measured sample is used, of the plant's states.
_SATURATED = torsion_methods.Choices(states=8, feedthrough=False, iterations=1)
# The limit that its search starts at, over the true one.
_LIMIT_START = 1.2


@dataclass(frozen=True, eq=False)
class Verified:
    """One experiment of table B.1.

    Attributes
    ----------
    name : str
    fits : dict of str to float
        FIT on the validation half by column [%]; NaN where there is no model.
    motion : dict of str to float
        The same against the true motion, without the sensors' noise; empty without noise.
    floor : float
        FIT of the true motion [%]: what noise takes from any model of it.
    singular_values : ndarray
        Of VODMA, in open loop of its direct variant.
    command : ndarray
        Of the validation half [A].
    found : dict of str to float
        Parameters that the physical model found, over the true ones.
    """

    name: str
    fits: Mapping[str, float]
    motion: Mapping[str, float]
    floor: float
    singular_values: Array
    command: Array
    found: Mapping[str, float]

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            "name": self.name,
            "fit": dict(self.fits),
            "fit_of_true_motion": dict(self.motion),
            "floor": self.floor,
            "singular_values": self.singular_values,
            "parameters_over_truth": dict(self.found),
        }


@dataclass(frozen=True, eq=False)
class AlgorithmVerification(Reproduction):
    """Table B.1, ours beside the thesis's.

    Attributes
    ----------
    experiments : tuple of Verified
        Those of the table, then the saturated one with the command that the controller asked for.
    """

    experiments: tuple[Verified, ...]

    def rows(self) -> tuple[Line, ...]:
        """Every cell that the thesis has, and what the noise and the limit are."""
        lines = []
        for one in self.experiments:
            published = thesis.TABLE_B_1.get(one.name)
            if published is None:
                continue
            known = one.name == thesis.SATURATION
            label = "saturation, known" if known else one.name
            for column, paper in zip(COLUMNS, published, strict=True):
                if paper is None or column not in one.fits:
                    continue
                least = max(paper - _ROUNDING, _KNOWN_SATURATION) if known else paper - _ROUNDING
                lines.append(Line(f"{label}, {column}: FIT", one.fits[column], paper, "%", "table B.1",
                                  at_least(least)))  # fmt: skip
        by_name = {one.name: one for one in self.experiments}
        noise = by_name[thesis.NOISE]
        lines.append(
            Line("noise: FIT of the true motion", noise.floor, implied_floor(), "%", "from table B.1",
                 near(implied_floor(), 1.0))
        )  # fmt: skip
        saturated = by_name[thesis.SATURATION]
        found = saturated.found["saturation@input.limit"] * thesis.LIMIT
        lines.append(Line("limit that the physical model finds", found, thesis.LIMIT, "A", "section 4.3.2",
                          near(thesis.LIMIT, 0.01 * thesis.LIMIT)))  # fmt: skip
        return tuple(lines)

    def tables(self) -> tuple[Table, ...]:
        """Ours over the thesis's, and the fit of the motion without noise."""
        body: list[tuple[Cell, ...]] = []
        for one in self.experiments:
            body.append((one.name, "ours", *(_shown(one.fits.get(column)) for column in COLUMNS)))
            published = thesis.TABLE_B_1[thesis.SATURATION if one.name == UNKNOWN else one.name]
            body.append(("", "thesis", *published))
        noise = next(one for one in self.experiments if one.name == thesis.NOISE)
        motion = tuple(noise.motion.get(column, None) for column in COLUMNS)
        return (
            Table("Table B.1: FIT [%]; x: below 0", ("experiment", "whose", *COLUMNS), body),
            Table("With noise, against the true motion: FIT [%]", ("whose", *COLUMNS), [("ours", *motion)]),
        )

    def notes(self) -> tuple[str, ...]:
        """Every choice that the thesis leaves open."""
        saturated = next(one for one in self.experiments if one.name == thesis.SATURATION)
        share = float(np.mean(np.abs(saturated.command) >= thesis.LIMIT * (1.0 - 1e-9)))
        return (
            (
                "Plant: the preset torsion, whose viscous friction and damping are ours. RGS of 60° for two deviations"
                " and 10 Hz, held over 50 ms, 80 s at 1 kHz, first half to identify, second to validate; open loop:"
                " 1 A, 20 Hz, 40 s. PD of table 4.1 at the motor's angle at 1 kHz, its derivative behind a low-pass of"
                " 5 ms."
            ),
            (
                "Down-sampled to 100 Hz by taking every tenth sample as it is; nine states, i = 28 and D estimated"
                " (section 4.4.3); poles outside the unit circle reflected. VODMA gets the controller converted with"
                " Tustin's rule, and decomposes the projection without weights, as eq. 3.19 does. PEM after a subspace"
                f" method minimises the errors of the free run, {torsion_methods.ITERATIONS} iterations at most."
            ),
            (
                "PEM alone is the physical model, all 14 parameters, from values that are each wrong by some 20 %; the"
                " thesis starts at the true ones."
            ),
            (
                f"Noise: white below 50 Hz at every sensor, and the controller sees it. ±4° is read as 3.4 deviations:"
                f" what the thesis's own figures leave for noise ({implied_floor():.1f} %) sets it. In the loop a part"
                " of the motor's noise is in the command of the same sample, so a model can explain a little of it: the"
                " second table has the fit of the true motion."
            ),
            (
                "The subspace methods are told that the angles integrate, and put one pole at 1. Left to themselves"
                " they place it by 0.28 s of a window: at 0.9998 on some draws, which costs VODMA DI up to 2 % of FIT"
                " with noise. With it, seeds 0 to 11 reach every cell of the three rows that the thesis has for them."
            ),
            (
                f"Saturation: {100.0 * share:.0f} % of the samples are at the limit. Known as an effect, the subspace"
                " methods get the command that the drive receives, at the 1 ms of the measurement (eight states, no D):"
                " its edges lie between samples of 10 ms. The physical model gets the command that was asked for and"
                " finds the limit itself, from a fifth above it."
            ),
            (
                f"'{UNKNOWN}' is the thesis's way, the command that was asked for at 100 Hz: there the same methods"
                " fail as they did in the thesis."
            ),
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {**super().to_dict(), "experiments": [one.to_dict() for one in self.experiments]}

    def plot(self, axes: Any = None) -> Any:
        """Draw every cell beside the thesis's, singular values, and the limited command; returns the axes."""
        import matplotlib.pyplot as plt

        from idloop import drawing

        place = np.arange(len(COLUMNS))
        with drawing.styled():
            if axes is None:
                _, axes = plt.subplots(3, 2, figsize=(10.0, 8.5), layout="constrained")
                axes = axes.ravel()
            shown = [one for one in self.experiments if one.name in thesis.TABLE_B_1]
            for ax, one in zip(axes[:4], shown, strict=True):
                ours = [one.fits.get(column, np.nan) for column in COLUMNS]
                paper = [np.nan if cell is None else cell for cell in thesis.TABLE_B_1[one.name]]
                ax.plot(place, ours, "o", color=drawing.MODELS[0], label="ours")
                ax.plot(place, paper, "_", color=drawing.MODELS[1], markersize=12, markeredgewidth=2, label="thesis")
                if one.name == thesis.SATURATION:
                    unknown = next((other for other in self.experiments if other.name == UNKNOWN), None)
                    if unknown is not None:
                        values = [max(unknown.fits.get(column, np.nan), 0.0) for column in COLUMNS]
                        ax.plot(place, values, "x", color=drawing.BAND, label="ours, not known (0: fails)")
                ax.set(title=one.name, xticks=place, ylabel=drawing.label("FIT", "%"))
                ax.set_xticklabels(COLUMNS, rotation=30, ha="right", fontsize=7)
                ax.legend()
            for index, one in enumerate(self.experiments[:3]):
                sizes = one.singular_values[:24]
                axes[4].semilogy(np.arange(1, sizes.size + 1), sizes / sizes[0], "o", markersize=3,
                                 color=drawing.MODELS[index], label=one.name)  # fmt: skip
            axes[4].set(xlabel=drawing.label("number", "-"), ylabel=drawing.label("singular value", "-"))
            axes[4].legend()
            command = shown[-1].command[:5000]
            axes[5].plot(np.arange(command.size) * thesis.MEASURED_EVERY, command, color=drawing.COMMAND)
            axes[5].set(title="limited command (figure B.1)", xlabel=drawing.label("time", "s"),
                        ylabel=drawing.label("command", "A"))  # fmt: skip
        return axes


def _shown(fit: float | None) -> Cell:
    """As in the thesis's other tables: a cross below 0."""
    return "x" if fit is not None and not fit >= 0.0 else fit


def implied_floor() -> float:
    """FIT that the thesis's noise leaves a perfect model [%].

    From its Quanser model, which is the true one and fits 92.96 % without noise and 90.36 % with it: errors that do
    not depend on each other add in squares.
    """
    with_noise, without = (100.0 - (thesis.TABLE_B_1[name][-1] or 0.0) for name in (thesis.NOISE, thesis.CLOSED))
    return 100.0 - float(np.sqrt(with_noise**2 - without**2))


def reproduce(seed: int, progress: Progress, length: float = thesis.LENGTH) -> AlgorithmVerification:
    """Simulate the experiments of appendix B and identify each in all ways.

    Parameters
    ----------
    seed : int
        Of excitation, noise and start values.
    progress : callable
    length : float
        Of the benchmark signals [s], 20 or more.
    """
    plant = thesis.quanser()
    section = thesis.controller("pd", current=False)
    wanted = thesis.excitation("rgs", np.radians(thesis.RGS_TWO_DEVIATIONS), thesis.BAND, seed + 1, length)
    law = thesis.sampled_controller("pd", thesis.IDENTIFIED_EVERY)
    found = []

    progress(0.0, thesis.OPEN)
    command = thesis.excitation("rgs", 1.0, 2.0 * thesis.BAND, seed + 1, length)
    found.append(_verified(thesis.OPEN, thesis.open_loop(plant, command), plant, None, seed))
    progress(0.15, thesis.CLOSED)
    found.append(_verified(thesis.CLOSED, thesis.in_loop(plant, section, wanted), plant, law, seed))
    progress(0.3, thesis.NOISE)
    noise = sensor_noise(len(wanted), seed)
    record = thesis.in_loop(plant, section, wanted, noise)
    found.append(_verified(thesis.NOISE, record, plant, law, seed, noise))
    progress(0.5, thesis.SATURATION)
    limited = thesis.in_loop(plant, thesis.controller("pd", current=False, limit=thesis.LIMIT), wanted)
    asked = asked_for(limited, wanted)
    found.append(_saturated(limited, asked, plant, seed))
    progress(0.85, UNKNOWN)
    found.append(_verified(UNKNOWN, replace(limited, input=asked), plant, law, seed, iterations=5))
    return AlgorithmVerification(tuple(found))


def sensor_noise(count: int, seed: int) -> Array:
    """White noise below 50 Hz at every sensor, shape (count, 4) [rad]."""
    from idloop.signals import build_signal

    columns = [
        build_signal(
            name="rgs",
            sample_time=thesis.MEASURED_EVERY,
            duration=count * thesis.MEASURED_EVERY,
            amplitude=float(np.radians(thesis.NOISE_DEVIATION)),
            frequency_max=0.5 / thesis.IDENTIFIED_EVERY,
            seed=1000 + 10 * seed + k,
        ).value[:count]
        for k in range(4)
    ]
    return np.column_stack(columns)


def asked_for(record: Record, wanted: Array) -> Array:
    """What the PD controller asks for before the limit, from its reference [rad] and the motor's angle [A]."""
    from scipy.signal import lfilter

    every, filtered_over = thesis.MEASURED_EVERY, thesis.DERIVATIVE_FILTER
    angle = record.output[:, 0]
    whole = filtered_over + every
    derivative = lfilter([1.0 / whole, -1.0 / whole], [1.0, -filtered_over / whole], angle)
    return np.asarray(thesis.KP * (wanted - angle) - thesis.KD * derivative, dtype=float)


def _verified(
    name: str,
    record: Record,
    plant: Model,
    law: control.LTI | None,
    seed: int,
    noise: Array | None = None,
    iterations: int = torsion_methods.ITERATIONS,
) -> Verified:
    """One experiment at 100 Hz."""
    train, validation = thesis.halves(thesis.thinned(record))
    clean = validation
    if noise is not None:
        _, clean = thesis.halves(thesis.thinned(replace(record, output=record.output - noise)))
    models = torsion_methods.black_box(train, law, torsion_methods.Choices(iterations=iterations, integrates=True))
    fits = {column: torsion_methods.fit_of(model, validation) for column, model in models.items()}
    motion = {} if noise is None else {
        column: _fit_of_motion(model, validation, clean) for column, model in models.items()
    }  # fmt: skip
    first, second = torsion_methods.half_records(record)
    physical = torsion_methods.grey_box(torsion_methods.away_from(plant, seed), first)
    for column, model in ((thesis.PEM, physical), (QUANSER, plant)):
        fits[column] = torsion_methods.physical_fit(model, second)
        if noise is not None:
            _, true = torsion_methods.half_records(replace(record, output=record.output - noise))
            motion[column] = torsion_methods.physical_fit(model, true)
    shown = models[thesis.DIRECT if law is None else thesis.VODMA]
    return Verified(
        name,
        fits,
        motion,
        thesis.average_fit(validation.output, clean.output),
        np.ones(1) if shown is None or shown.singular_values is None else shown.singular_values,
        validation.input[:, 0],
        _over_truth(physical, plant),
    )


def _fit_of_motion(model: Any, validation: SampledData, clean: SampledData) -> float:
    if model is None:
        return float("nan")
    with np.errstate(over="ignore", invalid="ignore"):
        return thesis.average_fit(clean.output, model.simulate(validation))


def _saturated(limited: Record, asked: Array, plant: Model, seed: int) -> Verified:
    """The saturated experiment, the saturation known as an effect."""
    train, validation = thesis.halves(thesis.thinned(limited, thesis.MEASURED_EVERY))
    law = thesis.sampled_controller("pd", thesis.MEASURED_EVERY)
    models = torsion_methods.black_box(train, law, _SATURATED)
    fits = {column: torsion_methods.fit_of(model, validation) for column, model in models.items()}
    first, second = torsion_methods.half_records(limited, asked)
    start = torsion_methods.away_from(plant, seed)
    true = plant.with_effects([f"saturation@input(limit={thesis.LIMIT})"])
    physical = torsion_methods.grey_box(
        start.with_effects([f"saturation@input(limit={_LIMIT_START * thesis.LIMIT})"]), first
    )
    fits[thesis.PEM] = torsion_methods.physical_fit(physical, second)
    fits[QUANSER] = torsion_methods.physical_fit(true, second)
    shown = models[thesis.VODMA]
    return Verified(
        thesis.SATURATION,
        fits,
        {},
        100.0,
        np.ones(1) if shown is None or shown.singular_values is None else shown.singular_values,
        validation.input[:, 0],
        _over_truth(physical, true),
    )


def _over_truth(model: Model, true: Model) -> dict[str, float]:
    return {name: model.values[name] / true.values[name] for name in model.free}
