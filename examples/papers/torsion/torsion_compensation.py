"""Row B5: the inverse of the offset model in front of the plant, with and without, beside table 5.1."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from papers import Progress
from papers.claim import above, at_least, below, near
from papers.reproduction import Cell, Line, Reproduction, Table
from papers.torsion import torsion_methods
from papers.torsion import torsion_thesis as thesis

Array = NDArray[np.float64]

WITHOUT, WITH = thesis.TABLE_5_1[0], thesis.TABLE_5_1[1]
_CHOICES = torsion_methods.Choices(iterations=10)
# Commands of the static check [A].
_LEVELS = np.linspace(-1.0, 1.0, 9)


@dataclass(frozen=True, eq=False)
class OffsetCompensation(Reproduction):
    """The same excitation with and without eq. 4.1.

    Attributes
    ----------
    fits : dict of str to dict of str to float
        FIT by setting and way [%].
    gain, offset : float
        Of the machine's current over the control signal [A], by least squares on its acceleration from rest.
    current : ndarray, shape (k,)
        Current for the commands `levels`, behind the compensation [A].
    levels : ndarray, shape (k,)
        [A]
    bare : ndarray, shape (k,)
        The same without the offset's part of the compensation [A].
    turned : dict of str to float
        How far the motor's mean angle is from the reference's [deg].
    """

    fits: Mapping[str, Mapping[str, float]]
    gain: float
    offset: float
    levels: Array
    current: Array
    bare: Array
    turned: Mapping[str, float]

    def rows(self) -> tuple[Line, ...]:
        """The offset's model, every cell of the two rows of table 5.1, and what compensation gains."""
        residue = float(np.max(np.abs(self.current - self.levels)))
        lines = [
            Line("current over control signal: gain", self.gain, thesis.CURRENT_GAIN, "A", "figure 2.3",
                 near(thesis.CURRENT_GAIN, 0.01)),
            Line("current over control signal: offset", self.offset, thesis.CURRENT_OFFSET, "A", "figure 2.3",
                 near(thesis.CURRENT_OFFSET, 0.001)),
            Line("compensated: largest difference of the current from the command", residue, 0.0, "A", "eq. 4.1",
                 below(1e-3)),
        ]  # fmt: skip
        for setting in (WITHOUT, WITH):
            for way, paper in zip(thesis.WAYS, setting.fits, strict=True):
                if way in self.fits[setting.name]:
                    ours = self.fits[setting.name][way]
                    bare = "with" if setting.compensated else "without"
                    lines.append(Line(f"{bare} compensation, {way}: FIT", ours, "x" if paper is None else paper, "%",
                                      "table 5.1"))  # fmt: skip
        for way, before, after in zip(thesis.WAYS, WITHOUT.fits, WITH.fits, strict=True):
            if way not in self.fits[WITH.name]:
                continue
            gained = self.gained(way)
            paper = None if before is None or after is None else after - before
            lines.append(Line(f"{way}: what compensation gains", gained, "from a cross" if paper is None else paper,
                              "%", "table 5.1", above(0.0)))  # fmt: skip
        best = {name: max(_known(f)) for name, f in self.fits.items()}
        published = max(cell for cell in WITH.fits if cell is not None)
        lines.append(Line("best with compensation: FIT", best[WITH.name], published, "%", "table 5.1",
                          at_least(published)))  # fmt: skip
        return tuple(lines)

    def gained(self, way: str) -> float:
        """FIT with less FIT without [%]; a failure without counts as 0."""
        without = self.fits[WITHOUT.name][way]
        return self.fits[WITH.name][way] - (max(without, 0.0) if np.isfinite(without) else 0.0)

    def tables(self) -> tuple[Table, ...]:
        """Ours and the thesis's, with and without."""
        body: list[tuple[Cell, ...]] = []
        for setting in (WITHOUT, WITH):
            fits = self.fits[setting.name]
            label = "with" if setting.compensated else "without"
            body.append((label, "ours", *(fits.get(way) for way in thesis.WAYS)))
            body.append(("", "thesis", *("x" if cell is None else cell for cell in setting.fits)))
        return (Table("RGS 100 %, band 100 %, PID: FIT [%]", ("compensation", "whose", *thesis.WAYS), body),)

    def notes(self) -> tuple[str, ...]:
        """What is compared, and with what machine."""
        return (
            (
                "The machine of row B3 under the same excitation, seed and loop; without compensation the command is"
                " divided by 2.44 but the offset stays. No means are removed, as in the thesis: a linear model has no"
                " place for the offset, and the plant integrates it."
            ),
            (
                "PEM alone starts at the sampled Quanser model with a leak, all entries free. Friction and imbalance"
                " are of our size, so the thesis's cells are a guide; claimed is what it says of the compensation."
                " VODMA decomposes the projection with the weights of CVA: without, friction decides what it finds."
            ),
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            **super().to_dict(),
            "fits": {name: dict(fits) for name, fits in self.fits.items()},
            "levels": self.levels,
            "current": self.current,
            "uncompensated": self.bare,
            "mean_angle_error": dict(self.turned),
        }

    def plot(self, axes: Any = None) -> Any:
        """Draw the currents of figure 2.3 and the cells of table 5.1; returns the two matplotlib axes."""
        import matplotlib.pyplot as plt

        from idloop import drawing

        with drawing.styled():
            if axes is None:
                _, axes = plt.subplots(1, 2, figsize=(10.0, 4.0), layout="constrained")
            axes[0].plot(self.levels, 1000.0 * (self.current - self.levels), "o-", color=drawing.MODELS[0],
                         label="with compensation")  # fmt: skip
            axes[0].plot(self.levels, 1000.0 * (self.bare - self.levels), "s-", color=drawing.MODELS[1],
                         label="without")  # fmt: skip
            axes[0].set(xlabel=drawing.label("command", "A"), ylabel=drawing.label("current less command", "mA"))
            axes[0].legend()
            for index, setting in enumerate((WITHOUT, WITH)):
                ways = [way for way in thesis.WAYS if way in self.fits[setting.name]]
                place = np.arange(len(ways))
                label = "with" if setting.compensated else "without"
                ours = [max(self.fits[setting.name][way], 0.0) for way in ways]
                paper = [0.0 if cell is None else cell for cell in setting.fits[: len(ways)]]
                colour = drawing.MODELS[1 - index]
                axes[1].plot(place, ours, "o", color=colour, label=f"{label}, ours")
                axes[1].plot(place, paper, "_", color=colour, markersize=12, label=f"{label}, thesis")
                axes[1].set_xticks(place, ways, rotation=30, ha="right", fontsize=7)
            axes[1].set_ylabel(drawing.label("FIT (0: fails)", "%"))
            axes[1].legend(fontsize=7)
        return axes


def _known(fits: Mapping[str, float]) -> list[float]:
    return [fit for fit in fits.values() if np.isfinite(fit)]


def currents(levels: Array, *, compensated: bool) -> Array:
    """Motor current for commands of the law, by the torque that the simulated motor feels from rest [A]."""
    from idloop.control import build_controller
    from idloop.physics import Engine

    machine = thesis.machine()
    # Friction would hide what the current is.
    machine = machine.without_effects(name for name in machine.effect_names if not name.startswith("input_offset"))
    section = {key: thesis.controller()[key] for key in ("sample_time", "linearisation")}
    compensation = thesis.offset_compensation(machine) if compensated else None
    alone = build_controller({"type": "none", **section}, compensation=compensation)
    engine = Engine(machine)
    found = []
    # Short against every resonance: the motor alone accelerates.
    time = np.array([0.0, 1e-5])
    for level in levels:
        sent = alone.step(0.0, 0.0, [], float(level))
        rest = engine.initial_state(np.zeros(4), np.zeros(4), None)
        moved = engine.simulate(None, np.zeros(1), np.array([sent]), time, rest, None)[-1, 0]
        acceleration = 2.0 * moved / time[-1] ** 2
        found.append(acceleration * thesis.MOTOR_INERTIA / thesis.TORQUE_CONSTANT)
    return np.array(found)


def reproduce(
    seed: int, progress: Progress, length: float = thesis.LENGTH, ways: tuple[str, ...] = thesis.WAYS
) -> OffsetCompensation:
    """Measure the currents, then identify with and without compensation.

    Parameters
    ----------
    seed : int
        Of the excitation.
    progress : callable
    length : float
        Of the benchmark [s], 20 or more.
    ways : tuple of str
        Of `torsion_thesis.WAYS`.
    """
    progress(0.0, "currents")
    current, bare = (currents(_LEVELS, compensated=flag) for flag in (True, False))
    # Without the offset's part the control signal is the command over the gain.
    gain, offset = np.polyfit(_LEVELS / thesis.CURRENT_GAIN, bare, 1)
    fits, turned = {}, {}
    for index, setting in enumerate((WITHOUT, WITH)):
        progress(0.1 + 0.45 * index, setting.name)
        record = torsion_methods.laboratory(setting, seed + 1, length)
        wanted = thesis.reference(setting, seed + 1, length)
        turned[setting.name] = float(np.degrees(np.mean(record.output[:, 0] - wanted)))
        fits[setting.name] = torsion_methods.laboratory_fits(record, setting, _CHOICES, ways)
    return OffsetCompensation(fits, float(gain), float(offset), _LEVELS, current, bare, turned)
