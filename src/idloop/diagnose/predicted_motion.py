"""The first body's motion as a fitted model expects it from one sample to the next.

What is told by regressors along the motion must not know the errors it is to explain: the measured motion, filtered or
not, holds the noise of the very sample whose error is looked at; what was expected of the sample does not.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from idloop.estimate.dataset import Data
from idloop.estimate.engine import RememberingEngine
from idloop.estimate.innovations import InnovationCriterion
from idloop.estimate.likelihood.refit import Refit
from idloop.estimate.simulation import SimulationCriterion
from idloop.physics.model import Model

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PredictedMotion:
    """Motion of the driven body in one record.

    Attributes
    ----------
    time : array, shape (n,)
        Instants [s].
    position, velocity, acceleration : array, shape (n,)
        As expected before each instant's measurement, in SI units.
    drive : array, shape (n,)
        Force of the drive by the command that holds.
    inertia : float
        Of the body, in the model.
    """

    time: Array
    position: Array
    velocity: Array
    acceleration: Array
    drive: Array
    inertia: float


def predicted_motion(fit: Refit) -> list[PredictedMotion] | None:
    """Motion of the driven body in each record, by the prediction or the free run that the model was fitted by.

    Parameters
    ----------
    fit : Refit

    Returns
    -------
    list of PredictedMotion or None
        None for a fit by a force balance, and where the simulation has more bodies than the model: which of the halves
        is meant would be open.
    """
    criterion = fit.criterion
    if not isinstance(criterion, InnovationCriterion | SimulationCriterion):
        return None
    model = fit.model
    engine = RememberingEngine(_with_motion_read(model))
    theta = fit.point[: fit.parameters]
    layout = engine.layout(theta)
    if layout.bodies != len(model.bodies):
        return None
    found = []
    for record, data in enumerate(criterion.data):
        if isinstance(criterion, InnovationCriterion):
            motion = _expected(criterion, engine, theta, fit.nuisance, record)
        else:
            start = criterion.initial.state(fit.nuisance, record, theta)
            read = engine.simulate(
                theta, data.input_time, data.input, data.time, initial_state=start, conditions=data.conditions
            )
            motion = read[:, len(model.outputs) :]
        found.append(_moved(engine, theta, data, motion, layout.axis.inertia))
    return found


def _with_motion_read(model: Model) -> Model:
    """The model with a perfect sensor of position and velocity at every body, after its own outputs."""
    template = model.outputs[0]
    # Under a joint of their own: no effect of a real sensor is theirs.
    perfect = tuple(
        replace(template, joint=f"{body} as predicted", body=body, field=field, scale=1.0, noise=None)
        for field in ("position", "velocity")
        for body in model.bodies
    )
    return replace(model, outputs=(*model.outputs, *perfect))


def _expected(
    criterion: InnovationCriterion, engine: RememberingEngine, theta: Array, nuisance: Array, record: int
) -> Array:
    """Positions and velocities of all bodies before each measurement, shape (n, 2 b)."""
    data, observer = criterion.data[record], criterion.observer(nuisance, record)
    outputs = data.output.shape[1]
    gain = observer.gains.reshape(-1, outputs)
    count = len(engine.model.outputs) - outputs
    # A sensor that nothing is measured by and nothing is corrected by reads off what was expected.
    measured = np.hstack([data.output, np.zeros((len(data.output), count))])
    idle = np.hstack([gain, np.zeros((len(gain), count))])
    state = criterion.initial.state(criterion.initial.values, record, theta)
    decay = criterion.decay(float(nuisance[1]), record)
    innovation = engine.predict(
        theta, data.input_time, data.input, data.time, measured, idle, state, decay, observer.place, data.conditions
    )
    return np.asarray(-innovation[:, outputs:])


def _moved(engine: RememberingEngine, theta: Array, data: Data, motion: Array, inertia: Any) -> PredictedMotion:
    """What the forces of the model make of a motion, shape (n, 2 b)."""
    bodies = motion.shape[1] // 2
    position, velocity = motion[:, :bodies], motion[:, bodies:]
    along = (position, velocity, np.zeros_like(velocity), data.input_time, data.input, data.time)
    balance = engine.equation_error(theta, *along, conditions=data.conditions)
    applied, _ = engine.drive_force(theta, *along, conditions=data.conditions)
    return PredictedMotion(
        data.time, position[:, 0], velocity[:, 0], -balance[:, 0] / float(inertia[0]), applied, float(inertia[0])
    )
