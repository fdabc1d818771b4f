"""Residual curves of the force balance: curves that the unexplained force follows and no effect explains.

A force over velocity or position is piecewise linear between knots; a coefficient (inertia, friction, drive) over the
position or time is a cubic spline; over the records both have a value in each. All are linear in their heights. A curve
is evaluated like an effect, on samples that its fit has not seen. A force over the command is excluded: it is what the
balance explains.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from idloop.diagnosis.evidence.predictive import Evidence, Scores, deal, others
from idloop.diagnosis.residual_curves.periods import unexplained_period
from idloop.diagnosis.residual_curves.unknown_structure import (
    COEFFICIENT_KNOTS,
    KNOTS,
    MOST_RECORDS,
    RECORD,
    TIME_KNOTS,
    TURNS,
    Curve,
    UnknownStructure,
    coefficient_splines,
    coefficient_units,
)
from idloop.diagnosis.search.step import EvaluatedModel
from idloop.estimation.force_balance.weak_fit import WeakFit
from idloop.estimation.force_balance.weak_form import BLOCKS
from idloop.estimation.statistics.student import log_density, scale_of
from idloop.estimation.statistics.truncated import directions

Array = NDArray[np.float64]

# Directions weaker than this part of the strongest are left out.
_LEAST_WEIGHT = 1e-3


@dataclass(frozen=True)
class ForceCurve(Curve):
    """A curve that the unexplained force of the driven body may follow, with the evidence against none.

    It is a force, or the change of a coefficient.
    """

    fit: WeakFit
    # Slopes of the force in every window by the parameters of the fit, and by the heights at the knots.
    columns: Array
    # Log-densities of the commands over those of the forces, which curves are fitted to.
    scale: Array
    scores: Scores
    evidence: Evidence
    period: float | None = None  # of a force that repeats over the position, where that is no turn

    @property
    def may_confound(self) -> bool:
        """Whether it depends on the position or the record and not on the motion, as waves, springs and loads do.

        Waves are the terms of a force that repeats: they explain it.
        """
        of_the_place = "position" in self.over and (self.of == "inertia" or (self.of == "force" and not self.closed))
        return of_the_place or (self.over == RECORD and self.of == "force")

    def confounds(self, one: EvaluatedModel[WeakFit]) -> bool:
        """Whether nothing significant remains of an effect beside this curve."""
        return self.may_confound and not self.beside(one).evidence.distinguishable

    def beside(self, one: EvaluatedModel[WeakFit]) -> EvaluatedModel[WeakFit]:
        """The evidence of an effect beside the curve, by the change of force that it makes alone."""
        change = one.fit.residual[:, 0] - self.fit.residual[:, 0]
        scores = _scores(self.fit, np.column_stack([self.columns, change]), self.scale)
        return replace(one, scores=scores, evidence=scores.against(self.scores))

    @property
    def text(self) -> str:
        """In words."""
        if self.period is not None:
            return f"a force that repeats every {self.period:.4g} {self.unit}"
        if self.over == RECORD:
            return self.between_records
        what = "a force" if self.of == "force" else f"a change of the {self.of}"
        return f"{what} over the {self.variable}"

    @cached_property
    def improvement(self) -> float:
        """Part by which it reduces the errors on unseen samples, at most that of the drive's force that it explains."""
        residual = self.fit.residual[:, 0]
        left = residual - self.columns @ np.linalg.lstsq(self.columns, residual, rcond=_LEAST_WEIGHT)[0]
        part = 1.0 - float(np.linalg.norm(left) / max(float(np.linalg.norm(residual)), 1e-300))
        return min(self.evidence.improvement, self.fit.relative * part)

    def unknown(self, p_value: float) -> UnknownStructure:
        """As a diagnosis reports it."""
        residual, count = self.fit.residual[:, 0], len(self.knots) - self.closed
        # The heights alone: beside free parameters they would share with them what the fit has taken already, such as a
        # line over the velocity with viscous friction, and the curve would not be that of the fitted model.
        inverse = np.linalg.pinv(self.columns[:, -count:], rcond=_LEAST_WEIGHT)
        value = inverse @ residual
        left = residual - self.columns[:, -count:] @ value
        parts = zip(np.array_split(inverse, BLOCKS, axis=1), np.array_split(left, BLOCKS), strict=True)
        spread = np.sqrt(np.sum(np.array([p @ r for p, r in parts]) ** 2, axis=0))
        if self.coefficient or self.over == RECORD:
            value = value - float(np.mean(self.at_knots(value)))
        share = float(np.clip(1.0 - np.exp(-2.0 * self.evidence.difference / self.evidence.samples), 0.0, 1.0))
        return self.structure("the errors of the force", p_value, value, 1.96 * spread, share, self.period)


def force_curves(fit: WeakFit, base: Scores) -> list[ForceCurve]:
    """Curves that the unexplained force of the driven body may follow, with their evidence, best first.

    `base`: scores of the fit, with which those of the curves are to be compared.
    """
    form, model = fit.form, fit.form.engine.model
    body, units, own = model.bodies[0], model.units, fit.slopes_of_force
    scale = base.log_density - _scores(fit, own, 0.0).log_density
    motion = form.motion
    speed = motion.velocity[:, 0]
    records: Array = form.record_places.astype(np.float64) + 1.0
    signals = {"position": motion.position[:, 0], "velocity": speed, "time": motion.time, RECORD: records}
    turning = units.position == "rad" and float(np.ptp(signals["position"])) > TURNS * 2.0 * np.pi
    unit_of = {"velocity": f"{units.position}/s", "position": units.position, "time": "s", RECORD: "-"}
    # The forces that a relative change of a coefficient scales.
    factors = {
        "viscous friction": -speed,
        "dry friction": -np.sign(speed),
        "drive": form.gain(fit.theta) * form.command(fit.shift),
    }
    found = []

    def add(
        of: str,
        of_unit: str,
        over: str,
        count: int,
        *,
        turn: bool = False,
        period: float | None = None,
    ) -> None:
        values, closed = signals[over], turn or period is not None
        if over == RECORD:
            knots = np.arange(1.0, count + 1.0, dtype=np.float64)
            heights = (values[:, None] == knots).astype(float)
            slopes = np.zeros_like(heights)
        else:
            low, high = (0.0, period or 2.0 * np.pi) if closed else np.percentile(values, (0.5, 99.5))
            knots = np.linspace(low, max(high, low + 1e-12), count)
            if of == "force":
                heights = slopes = _hats(values, knots, closed=closed)
            else:
                splines = coefficient_splines(knots, closed=closed)
                at = values if closed else np.clip(values, low, high)
                heights, slopes = splines(at), splines(at, 1)
        if of == "inertia":
            # Lagrange's equation: an inertia that changes along the way takes a force at constant speed as well.
            columns = form.weak(0.5 * slopes * speed[:, None] ** 2) - form.weak_derivative(heights * speed[:, None])
        else:
            columns = form.weak(heights if of == "force" else heights * factors[of][:, None])
        if of in ("drive", "inertia") or over == RECORD:
            # Its mean is the scale of all forces, which is free, or belongs to an effect.
            columns = columns - np.mean(columns, axis=1, keepdims=True)
        name = over if over in ("time", RECORD) else f"{body}.{over}" + (" within a turn" if turn else "")
        columns = np.hstack([own, columns])
        scores = _scores(fit, columns, scale)
        evidence = scores.against(base)
        if np.isfinite(evidence.difference):
            curve = of, of_unit, name, unit_of[over], knots, closed
            found.append(ForceCurve(*curve, fit, columns, scale, scores, evidence, period))

    add("force", units.force, "velocity", KNOTS)
    add("force", units.force, "position", KNOTS)
    if turning:
        add("force", units.force, "position", KNOTS, turn=True)
    if (repeated := unexplained_period(fit, 0)) is not None:
        add("force", units.force, "position", KNOTS, period=repeated[0])
    count = int(np.max(records))
    compared = 1 < count <= MOST_RECORDS
    if compared:
        add("force", units.force, RECORD, count)
    for of, of_unit in coefficient_units(units).items():
        add(of, of_unit, "position", COEFFICIENT_KNOTS, turn=turning)
        if compared:
            add(of, of_unit, RECORD, count)
        if of != "inertia":
            add(of, of_unit, "time", TIME_KNOTS)
    return sorted(found, key=lambda one: one.evidence.spread - one.evidence.difference)


def _scores(fit: WeakFit, columns: Array, scale: Array | float) -> Scores:
    """Log-densities of the residual beside some columns, by folds that their fit has not seen, plus their scale."""
    residual, found = fit.residual[:, 0], []
    folds, blocks = deal(fit.form.starts)
    columns = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    parts = [columns[fold] for fold in folds]
    grams = [part.T @ part for part in parts]
    moments = [part.T @ residual[fold] for part, fold in zip(parts, folds, strict=True)]
    for index, fold in enumerate(folds):
        vectors, values = directions(np.sum(grams, axis=0) - grams[index], _LEAST_WEIGHT)
        heights = vectors @ ((vectors.T @ (np.sum(moments, axis=0) - moments[index])) / values**2)
        left = residual - columns @ heights
        found.append(log_density(left[fold], scale_of(left[others(folds, index)])))
    return Scores(np.concatenate(found) + scale, blocks)


def _hats(values: Array, knots: Array, *, closed: bool) -> Array:
    """Piecewise linear functions that are 1 at one knot each, shape (n, heights)."""
    count = len(knots) - 1
    place = (values - knots[0]) / float(knots[1] - knots[0])
    place = np.mod(place, count) if closed else np.clip(place, 0.0, count)
    lower = np.minimum(place.astype(np.int64), count - 1)
    hats, rows = np.zeros((len(values), len(knots))), np.arange(len(values))
    hats[rows, lower] = 1.0 - (place - lower)
    hats[rows, lower + 1] = place - lower
    if closed:
        hats[:, 0] += hats[:, -1]
        hats = hats[:, :-1]
    return hats
