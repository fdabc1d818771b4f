"""The first body's motion as a fitted model expects it from one sample to the next.

What is told by regressors along the motion must not know the errors it is to explain: the measured motion, filtered or
not, holds the noise of the very sample whose error is looked at; what was expected of the sample does not.
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
    """Motion of the driven body in one record, as expected before each instant's measurement, in SI units."""

    time: Array
    position: Array
    velocity: Array
    acceleration: Array
    drive: Array  # force of the drive by the command that holds
    inertia: float  # of the body, in the model


def predicted_motion(fit: Refit) -> list[PredictedMotion] | None:
    """Motion of the driven body in each record, by the prediction or the free run that the model was fitted by.

    None for a fit by a force balance, and where the simulation has more bodies than the model: which of the halves is
    meant would be open.
    """
    criterion = fit.criterion
    if not isinstance(criterion, InnovationCriterion | SimulationCriterion):
        return None
    model, theta = fit.model, fit.point[: fit.parameters]
    # Perfect sensors, under a joint of their own: no effect of a real sensor is theirs.
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
    """All outputs of the engine before each measurement; of those that are not measured only these are meant."""
    data, observer = criterion.data[record], criterion.observer(nuisance, record)
    outputs = data.output.shape[1]
    gain = observer.gains.reshape(-1, outputs)
    count = len(engine.model.outputs) - outputs
    # A sensor that nothing is measured by and nothing is corrected by reads off what was expected.
    measured = np.hstack([data.output, np.zeros((len(data.output), count))])
    idle = np.hstack([gain, np.zeros((len(gain), count))])
    state = criterion.initial.state(criterion.initial.values, record, theta)
    decay = criterion.decay(float(nuisance[1]), record)
    return -engine.predict(
        theta, data.input_time, data.input, data.time, measured, idle, state, decay, observer.place, data.conditions
    )
