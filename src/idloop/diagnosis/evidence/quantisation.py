"""Quantisation: the resolution of a sensor, read off data that are multiples of a quantum."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from idloop.diagnosis.candidate import Candidate
from idloop.diagnosis.evidence.detection_limit import DetectionLimit
from idloop.estimation.force_balance.weak_fit import WeakFit
from idloop.estimation.force_balance.weak_form import WeakForm
from idloop.estimation.likelihood.estimation_problem import EstimationProblem
from idloop.estimation.observer.sensor_noise import resolution
from idloop.estimation.sensors import body_sensors
from idloop.physics.effect import OUTPUT, Effect, catalogue
from idloop.physics.model import Model, effect_name
from idloop.records import Record

Array = NDArray[np.float64]

# Largest mean second difference of the readings in quanta, so that the quantum exceeds the noise: white noise of unit
# deviation has one of √(12/π).
_MOST_BEND = 1.35
# Why an effect is not named: one of the sensor, and any other that explains no more than that.
WITHIN_QUANTUM = "it changes the reading by less than a quantum"
READINGS_OFF = "readings that are half a quantum off explain as much"


def quantised_outputs(
    model: Model, estimation: EstimationProblem, effects: Sequence[str] | None = None
) -> list[Candidate]:
    """Outputs whose readings are multiples of a quantum coarser than their noise, where the model has none.

    Coarsest first, of some effects only where these are given.
    """
    found = []
    for column, output in enumerate(model.outputs):
        if any(active.at == output.site and active.effect.resolution for active in model.effects):
            continue
        effect = next((one for one in _quantisers(model, output.field) if _asked(one, output.site, effects)), None)
        # A velocity computed from rounded positions has no converter of its own.
        if effect is None or not any(np.any(np.isfinite(d.output[:, column])) for d in estimation.data):
            continue
        step = quantisation_step(estimation.records, column)
        if step <= 0.0:
            continue
        candidate = Candidate(
            effect=effect.name,
            at=output.site,
            testable="yes",
            why=f"the readings are multiples of {step:.6g} {output.unit}, coarser than their noise",
            text=effect.text,
            p_value=1e-300,
            parameters={effect.resolution: {"value": step, "stderr": 0.0, "unit": output.unit}},
            model=model.with_entry(effect.name, output.site, {effect.resolution: step}),
        )
        found.append((step, candidate))
    return [candidate for _, candidate in sorted(found, key=lambda one: -one[0])]


def _asked(effect: Effect, at: str, effects: Sequence[str] | None) -> bool:
    return effects is None or effect.name in effects or effect_name(effect.name, at) in effects


def _quantisers(model: Model, field: str) -> list[Effect]:
    """Effects of the catalogue by which a sensor of a field rounds its readings."""
    known = (effect for several in catalogue(*model.effect_folders).values() for effect in several)
    return [effect for effect in known if effect.site == OUTPUT and effect.resolution and field in effect.outputs]


def resolution_limits(model: Model, estimation: EstimationProblem) -> dict[str, DetectionLimit]:
    """Detection limits of the quantisation of each output, by effect and site."""
    limits = {}
    for output, noise in zip(model.outputs, estimation.noise, strict=True):
        least = math.sqrt(12.0 / math.pi) / _MOST_BEND * float(noise)
        for effect in _quantisers(model, output.field):
            limits[effect_name(effect.name, output.site)] = DetectionLimit(effect.resolution, output.unit, least, least)
    return limits


def readings_half_a_quantum_off(fit: WeakFit, records: Sequence[Record]) -> list[WeakForm]:
    """Windows of a fit with the position of each body half its quantum off, up and down, where that moves a force.

    An encoder that counts down to whole pulses shows a position half a pulse short.
    """
    model, found = fit.model, []
    for body, (column, _) in enumerate(body_sensors(model)):
        if column is None:
            continue
        half = 0.5 * quantisation_step(records, column) / model.outputs[column].scale
        for shift in (half, -half) if half else ():
            form = fit.form.with_shifted_position(body, shift)
            if np.any(form.residual(fit.theta, fit.shift) != fit.residual):
                found.append(form)
    return found


def quantisation_step(records: Sequence[Record], column: int) -> float:
    """Quantum of one output in all records; 0 without one above the noise."""
    steps = []
    for record in records:
        y = record.output[:, column]
        y = y[np.isfinite(y)]
        step = resolution(y)
        if step <= 0.0:
            return 0.0
        step = _least_squares_quantum(y, step)
        counts = y / step
        # One reading in a hundred may be disturbed.
        if np.mean(np.abs(counts - np.round(counts)) < 0.01) < 0.99:
            return 0.0
        # With a noise above the quantum the second difference scatters by several quanta.
        if float(np.mean(np.abs(np.diff(np.round(counts), 2)))) > _MOST_BEND:
            return 0.0
        steps.append(step)
    if not steps or max(steps) > 1.02 * min(steps):
        return 0.0
    return float(np.mean(steps))


def _least_squares_quantum(y: Array, step: float) -> float:
    """Quantum by least squares over all readings, from a first estimate."""
    for _ in range(3):
        counts = np.round(y / step)
        power = float(counts @ counts)
        if power <= 0.0:
            return step
        step = float(counts @ y) / power
    return step
