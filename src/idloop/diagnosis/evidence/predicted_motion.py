"""The first body's motion as a fitted model predicts it from one sample to the next.

Regressors for prediction errors must be independent of the noise in these errors. The measured motion, filtered or not,
contains the noise of the sample whose error is explained; its prediction does not.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from idloop.estimation.likelihood.refit import Refit
from idloop.estimation.observer.innovations import InnovationCriterion
from idloop.estimation.optimisation.caching_engine import CachingEngine
from idloop.estimation.simulation import SimulationCriterion

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PredictedMotion:
    """Motion of the driven body in one record, predicted before the measurement of each instant, in SI units."""

    time: Array
    position: Array
    velocity: Array
    acceleration: Array
    drive: Array  # force of the drive by the command that holds
    inertia: float  # of the body, in the model


def predicted_motion(fit: Refit) -> list[PredictedMotion] | None:
    """Motion of the driven body in each record, by the prediction or the free run that the model was fitted by.

    None for a fit by a force balance, and where an effect splits a body.
    """
    criterion = fit.criterion
    if not isinstance(criterion, InnovationCriterion | SimulationCriterion):
        return None
    model, theta = fit.model, fit.point[: fit.parameters]
    # Ideal sensors of a joint of their own, without the effects of the real ones.
    perfect = tuple(
        replace(model.outputs[0], joint=f"{body} as predicted", body=body, field=field, scale=1.0, noise=None)
        for field in ("position", "velocity")
        for body in model.bodies
    )
    engine = CachingEngine(replace(model, outputs=(*model.outputs, *perfect)))
    layout, bodies = engine.layout(theta), len(model.bodies)
    if layout.bodies != bodies:
        return None
    inertia = float(layout.axis.inertia[0])
    found = []
    for record, data in enumerate(criterion.data):
        if isinstance(criterion, InnovationCriterion):
            motion = _expected(criterion, engine, theta, fit.nuisance, record)
        else:
            start = criterion.initial.state(fit.nuisance, record, theta)
            motion = engine.simulate(
                theta, data.input_time, data.input, data.time, initial_state=start, conditions=data.conditions
            )
        position, velocity = motion[:, -2 * bodies : -bodies], motion[:, -bodies:]
        along = (position, velocity, np.zeros_like(velocity), data.input_time, data.input, data.time)
        balance = engine.balance(theta, *along, conditions=data.conditions)
        acceleration = -balance.residual[:, 0] / inertia
        found.append(PredictedMotion(data.time, position[:, 0], velocity[:, 0], acceleration, balance.applied, inertia))
    return found


def _expected(
    criterion: InnovationCriterion, engine: CachingEngine, theta: Array, nuisance: Array, record: int
) -> Array:
    """Predictions of all outputs of the engine before each measurement."""
    data, observer = criterion.data[record], criterion.observer(nuisance, record)
    outputs = data.output.shape[1]
    gain = observer.gains.reshape(-1, outputs)
    count = len(engine.model.outputs) - outputs
    # A sensor with a measurement of zero and no gain returns minus its prediction.
    measured = np.hstack([data.output, np.zeros((len(data.output), count))])
    idle = np.hstack([gain, np.zeros((len(gain), count))])
    state = criterion.initial.state(criterion.initial.values, record, theta)
    decay = criterion.decay(float(nuisance[1]), record)
    return -engine.predict(
        theta, data.input_time, data.input, data.time, measured, idle, state, decay, observer.place, data.conditions
    )
