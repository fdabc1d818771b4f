"""Unknown structure in a force balance: curves that the unexplained force follows and no effect of the catalogue is.

A force over velocity or position, or a coefficient (inertia, friction, drive) over the position or time, is
piecewise linear between knots, and so linear in its heights: a row of the balance's residual each. A curve is judged as
an effect is, on samples that its fit has not seen. A force over the command is none of them: it is what the balance
explains.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from idloop.diagnose.predictive import FOLDS, Evidence, Scores, deal
from idloop.diagnose.step import Weighed
from idloop.diagnose.unknown import DRIVE_CURVES, UnknownStructure, curve_sentence
from idloop.estimate.student import log_density, scale_of
from idloop.estimate.weak_fit import WeakFit
from idloop.estimate.weak_form import BLOCKS

Array = NDArray[np.float64]

# Knots of a force, and of a coefficient over position and over time.
_OF_A_FORCE, _OF_A_COEFFICIENT, _OF_TIME = 17, 13, 5
# Turns from which on a curve is one over the turn, not over the travel.
_TURNS = 1.5
# Directions weaker than this part of the strongest are left out.
_LEAST_WEIGHT = 1e-3


@dataclass(frozen=True)
class Curve:
    """A curve that the unexplained force may follow.

    Attributes
    ----------
    of, of_unit : str
        What it gives: a force, or the change of a coefficient.
    over, unit : str
        Variable, and its unit.
    knots : array, shape (k,)
    columns : array, shape (rows, heights)
        Force in every window by the heights at the knots.
    closed : bool
        Over a turn: the last knot is the first again.
    """

    of: str
    of_unit: str
    over: str
    unit: str
    knots: Array
    columns: Array
    closed: bool

    @property
    def text(self) -> str:
        """In words."""
        what = "a force" if self.of == "force" else f"a change of the {self.of}"
        return f"{what} over the {self.over.partition('.')[2] or self.over}"


@dataclass(frozen=True)
class ForceCurve:
    """A curve of an unexplained force, with the evidence for it.

    Attributes
    ----------
    curve : Curve
    fit : WeakFit
        Of the model that it is beside.
    scores : Scores
    evidence : Evidence
        Against that model without a curve.
    """

    curve: Curve
    fit: WeakFit
    scores: Scores
    evidence: Evidence

    @property
    def imitated(self) -> bool:
        """Whether waves and springs may stand in for it: what depends on where the axis is, and not on how it moves."""
        return self.curve.of in ("force", "inertia") and "position" in self.curve.over

    def imitated_by(self, one: Weighed[WeakFit]) -> bool:
        """Whether an effect may stand in for it."""
        return self.imitated and not self.beside(one).evidence.told

    def beside(self, one: Weighed[WeakFit]) -> Weighed[WeakFit]:
        """An effect as it is weighed beside the curve, by the change of force that it makes alone."""
        columns = np.column_stack([_beside(self.fit, self.curve), one.fit.residual[:, 0] - self.fit.residual[:, 0]])
        folds, blocks = deal(self.fit.form.starts)
        scores = Scores(_scores(self.fit, columns, folds), blocks)
        return replace(one, scores=scores, evidence=scores.against(self.scores))

    @property
    def of_the_drive(self) -> bool:
        """Whether it is about how the command becomes a force."""
        return self.curve.of in DRIVE_CURVES

    @property
    def text(self) -> str:
        """In words."""
        return self.curve.text

    @property
    def worth(self) -> float:
        """Part by which it makes errors on unseen samples smaller, and of the drive's force that it explains."""
        return min(self.evidence.improvement, self._explains)

    @cached_property
    def _explains(self) -> float:
        columns, residual = _beside(self.fit, self.curve), self.fit.residual[:, 0]
        left = residual - columns @ np.linalg.lstsq(columns, residual, rcond=_LEAST_WEIGHT)[0]
        return self.fit.relative * (1.0 - float(np.linalg.norm(left) / max(float(np.linalg.norm(residual)), 1e-300)))

    @cached_property
    def heights(self) -> tuple[Array, Array]:
        """Heights at the knots and their standard errors, the parameters of the model free beside them."""
        columns, count = _beside(self.fit, self.curve), self.curve.columns.shape[1]
        residual = self.fit.residual[:, 0]
        inverse = np.linalg.pinv(columns, rcond=_LEAST_WEIGHT)
        left = residual - columns @ (inverse @ residual)
        sums = np.array([p @ r for p, r in zip(
            np.array_split(inverse, BLOCKS, axis=1), np.array_split(left, BLOCKS), strict=True
        )])  # fmt: skip
        spread = np.sqrt(np.sum(sums**2, axis=0))
        return (inverse @ residual)[-count:], spread[-count:]

    def unknown(self, p_value: float) -> UnknownStructure:
        """As a diagnosis reports it."""
        value, spread = self.heights
        curve = self.curve
        if curve.closed:
            value, spread = np.append(value, value[0]), np.append(spread, spread[0])
        if curve.of != "force":
            value = value - float(np.mean(value))
        return UnknownStructure(
            variable=curve.over,
            unit=curve.unit,
            force_unit=curve.of_unit,
            at=curve.knots,
            force=value,
            band=1.96 * spread,
            share=float(np.clip(1.0 - np.exp(-2.0 * self.evidence.difference / self.evidence.samples), 0.0, 1.0)),
            text=curve_sentence("the errors of the force", curve.of, curve.of_unit, curve.over, p_value, value),
            of=curve.of,
        )


def structures(fit: WeakFit) -> list[ForceCurve]:
    """Curves that the unexplained force of the driven body may follow, with their evidence, best first.

    Parameters
    ----------
    fit : WeakFit

    Returns
    -------
    list of ForceCurve
    """
    folds, blocks = deal(fit.form.starts)
    curves = _curves(fit)
    own = fit.slopes_of_force
    base = _scores(fit, own, folds)
    found = []
    for curve in curves:
        scores = Scores(_scores(fit, np.hstack([own, curve.columns]), folds), blocks)
        evidence = scores.against(Scores(base, blocks))
        if np.isfinite(evidence.difference):
            found.append(ForceCurve(curve, fit, scores, evidence))
    return sorted(found, key=lambda one: one.evidence.spread - one.evidence.difference)


def _beside(fit: WeakFit, curve: Curve) -> Array:
    return np.hstack([fit.slopes_of_force, curve.columns])


def _scores(fit: WeakFit, columns: Array, folds: list[NDArray[np.int64]]) -> Array:
    """Log-densities of the residual beside some columns, by folds that their fit has not seen."""
    residual, found = fit.residual[:, 0], []
    columns = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    for index in range(FOLDS):
        others = np.sort(np.concatenate([fold for place, fold in enumerate(folds) if place != index]))
        heights = np.linalg.lstsq(columns[others], residual[others], rcond=_LEAST_WEIGHT)[0]
        scale = scale_of(residual[others] - columns[others] @ heights)
        found.append(log_density(residual[folds[index]] - columns[folds[index]] @ heights, scale))
    return np.concatenate(found)


def _hats(values: Array, knots: Array, *, closed: bool) -> Array:
    """Piecewise linear functions that are 1 at one knot each, shape (n, heights)."""
    width = float(knots[1] - knots[0])
    place = (values - knots[0]) / width
    count = len(knots) - 1
    place = np.mod(place, count) if closed else np.clip(place, 0.0, count)
    lower = np.minimum(place.astype(np.int64), count - 1)
    hats = np.zeros((len(values), len(knots)))
    hats[np.arange(len(values)), lower] = 1.0 - (place - lower)
    hats[np.arange(len(values)), lower + 1] = place - lower
    if closed:
        hats[:, 0] += hats[:, -1]
        hats = hats[:, :-1]
    return hats


def _curves(fit: WeakFit) -> list[Curve]:
    form, model = fit.form, fit.form.engine.model
    body, units = model.bodies[0], model.units
    signals = {name: form.along(name) for name in ("position", "velocity", "command", "time")}
    span = float(np.ptp(signals["position"]))
    turning = units.position == "rad" and span > _TURNS * 2.0 * np.pi
    found = []

    def laid(of: str, of_unit: str, over: str, unit: str, count: int, factor: Array | None, *, turn: bool) -> Curve:
        values = signals[over]
        low, high = (0.0, 2.0 * np.pi) if turn else np.percentile(values, (0.5, 99.5))
        knots = np.linspace(low, max(high, low + 1e-12), count)
        hats = _hats(values, knots, closed=turn)
        name = over if over in ("command", "time") else f"{body}.{over}" + (" within a turn" if turn else "")
        columns = hats if factor is None else hats * factor[:, None]
        if of == "inertia":
            # What stores kinetic energy takes a force at constant speed, too, where it changes (Lagrange's equation).
            ahead = _hats(values + 1e-3 * (knots[1] - knots[0]), knots, closed=turn)
            slope = (ahead - hats) / (1e-3 * (knots[1] - knots[0]))
            columns = columns - 0.5 * slope * signals["velocity"][:, None] ** 2
        if of in ("drive", "inertia"):
            # Its mean is that of all other forces: a machine without drive and inertia explains everything.
            columns = columns - np.mean(columns, axis=1, keepdims=True)
        return Curve(of, of_unit, name, unit, knots, columns, turn)

    found.append(laid("force", units.force, "velocity", f"{units.position}/s", _OF_A_FORCE, None, turn=False))
    found.append(laid("force", units.force, "position", units.position, _OF_A_FORCE, None, turn=False))
    if turning:
        found.append(laid("force", units.force, "position", units.position, _OF_A_FORCE, None, turn=True))
    speed = signals["velocity"]
    factors = {
        "inertia": (units.inertia, -form.inertial[:, 0]),
        "viscous friction": (units.fill("{force}·s/{position}"), -speed),
        "dry friction": (units.force, -np.sign(speed)),
        "drive": ("-", form.drive(fit.theta, fit.shift)),
    }
    for of, (unit, factor) in factors.items():
        found.append(laid(of, unit, "position", units.position, _OF_A_COEFFICIENT, factor, turn=turning))
        if of != "inertia":
            found.append(laid(of, unit, "time", "s", _OF_TIME, factor, turn=False))
    return found
