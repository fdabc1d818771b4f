"""A set of rival models: on one scale, with labels, and the expected lead of each over the others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from idloop.diagnosis.design.experiment import Experiment
from idloop.diagnosis.design.force_errors import force_decides, force_errors
from idloop.diagnosis.design.innovation_errors import InnovationErrors
from idloop.diagnosis.design.rival_noise import common_noise
from idloop.diagnosis.design.rivals import Rival, RivalErrors
from idloop.errors import InputError
from idloop.estimation.dataset import Data, prepare
from idloop.estimation.likelihood.parallel import in_parallel
from idloop.estimation.observer.innovations import InnovationCriterion
from idloop.estimation.optimisation.caching_engine import CachingEngine
from idloop.estimation.optimisation.levenberg import difference_jacobian
from idloop.estimation.optimisation.solve import typical_size

if TYPE_CHECKING:
    from idloop.physics import Model
    from idloop.records import Record

Array = NDArray[np.float64]

# Samples that are read of the data so far.
_MOST_SAMPLES = 60_000


def prepare_rivals(models: Sequence[Model], records: Sequence[Record], criterion: str = "auto") -> list[Rival]:
    """Put rival models, fitted to the data so far, on one scale.

    Anything but the force criterion is judged by innovations. An `InputError` for models with different signals, or
    records that do not suit them.
    """
    check_signals(models)
    first = models[0]
    data = _shortened(prepare(first, records))
    views: Sequence[RivalErrors] | None = None
    if criterion == "force" or (criterion == "auto" and force_decides(first, data)):
        views = force_errors(models, data)
    if views is None:
        noise = common_noise(models, data)
        views = [InnovationErrors(model, data, noise) for model in models]
    return [Rival(*own) for own in zip(labels(models), models, views, strict=True)]


def check_signals(models: Sequence[Model]) -> None:
    """Raise an InputError where models have different signals."""
    first = models[0]
    for model in models[1:]:
        if model.output_names != first.output_names or model.input != first.input:
            raise InputError(f"models {first.name} and {model.name} have different signals: they cannot be rivals")


def labels(models: Sequence[Model]) -> list[str]:
    """What distinguishes each model: its effects that not all have, else its name."""
    common = set(models[0].effect_names).intersection(*(model.effect_names for model in models[1:]))
    own = [" + ".join(name for name in model.effect_names if name not in common) for model in models]
    own = [text or "no further effect" for text in own]
    return own if len(set(own)) == len(own) else _unique([model.name for model in models])


def _unique(names: list[str]) -> list[str]:
    return [name if names.count(name) == 1 else f"{name} ({index + 1})" for index, name in enumerate(names)]


def _shortened(data: list[Data]) -> list[Data]:
    """The first samples of every record, so that long recordings cost no more."""
    most = max(_MOST_SAMPLES // len(data), 1000)
    return [
        replace(d, time=d.time[:most], output=d.output[:most], gaps=d.gaps[d.gaps < most]) if len(d.time) > most else d
        for d in data
    ]


def nested(models: Sequence[Model]) -> NDArray[np.bool_]:
    """Entry (i, j): model i is nested in model j, which can explain whatever i does, shape (m, m)."""
    m = len(models)
    return np.array([[i != j and _is_nested(models[i], models[j]) for j in range(m)] for i in range(m)])


def _is_nested(small: Model, large: Model) -> bool:
    covered = set(large.effect_names)
    for active in large.effects:
        covered.update(f"{name}@{active.at}" for name in active.effect.contains)
    return set(small.effect_names) < covered and set(small.effect_names) != set(large.effect_names)


def experiment_gains(
    rivals: Sequence[Rival], experiment: Experiment, *, searched: bool = False, against_first: bool = False
) -> tuple[Array, Array]:
    """Expected log-likelihood by which each rival as the truth (row) leads each other one, refitted (column).

    Two arrays of shape (m, m): with and without the data so far. 0 on the diagonal, where the other rival contains the
    truth, and with `against_first` outside the first row and column. `searched`: see `Rival.expected_loss`.
    """
    gains, alone = np.zeros((2, len(rivals), len(rivals)))
    inside = nested([rival.model for rival in rivals])
    for i, truth in enumerate(rivals):
        wanted = [j for j in range(len(rivals)) if i != j and not inside[i, j] and (j == 0 or not against_first)]
        if not wanted:
            continue
        record = experiment.run(truth.model, engine=truth.engine)
        own = truth.errors(record, experiment.start)
        for j in wanted:
            loss = rivals[j].expected_loss(record, experiment.start, own, searched=searched)
            gains[i, j], alone[i, j] = loss.joint, loss.alone
    # Where a rival cannot be evaluated nothing is expected to show.
    return np.nan_to_num(gains, nan=0.0, posinf=np.inf), np.nan_to_num(alone, nan=0.0, posinf=np.inf)


def log_likelihood_losses(model: Model, others: Sequence[Model], records: Sequence[Record]) -> list[float]:
    """Log-likelihood of the data so far that a model loses with something added to it, of sizes that are not fitted.

    What the models share is refitted. Infinite where another model cannot be simulated along the records.
    """
    data = _shortened(prepare(model, records))
    noise = common_noise([model], data)

    def cost(candidate: Model) -> float:
        criterion = InnovationCriterion(CachingEngine(candidate), data, noise.sensors, noise.force, noise.exponent)
        exponent, theta = np.array([noise.exponent, criterion.memory]), candidate.theta

        def residual(values: Array) -> Array:
            return noise.scaled(criterion.errors(values, exponent))

        base = residual(theta)
        if len(theta) and np.all(np.isfinite(base)):
            scale = typical_size(theta, *candidate.bounds)
            jacobian, _ = difference_jacobian(
                residual, theta, base, *candidate.bounds, 1e-4 * scale, scale, central=False
            )
            if np.all(np.isfinite(jacobian)):
                size = np.maximum(np.linalg.norm(jacobian, axis=0), 1e-300)
                base = base - (jacobian / size) @ np.linalg.lstsq(jacobian / size, base, rcond=1e-8)[0]
        return 0.5 * float(base @ base)

    shared = [other.with_free([name for name in other.free if name in model.values]) for other in others]
    first, *costs = in_parallel(cost, [model, *shared])
    return [one - first if np.isfinite(one - first) else np.inf for one in costs]
