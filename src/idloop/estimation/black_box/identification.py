"""Identification by any black-box method, with its order and delay chosen where that is asked for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import product
from math import isfinite
from typing import TYPE_CHECKING, Any, Literal

from idloop.errors import IdloopError, InputError
from idloop.estimation.black_box.method import Choices, Identified, Method, Trial
from idloop.estimation.black_box.methods import find_method
from idloop.estimation.statistics.information_criteria import Information, comparable, independent_share, of_errors

if TYPE_CHECKING:
    from idloop.estimation.black_box.sampled import SampledData

Progress = Callable[[float, str], None]

_DELAYS = 20  # samples within which "auto" seeks the first effect of the command
_LARGEST_OFFSET = 10.0  # of an output, over its range, that gets no note


def identify(
    data: SampledData | Sequence[SampledData],
    method: str,
    choices: Choices | None = None,
    progress: Progress = lambda fraction, note: None,
) -> Identified:
    """Identify by any method; of several orders and delays the least BIC on these data wins (`Method.selects`).

    `method`: one of `METHODS`; `progress`: called with the share done and what is tried. Raises InputError: no such
    method, a choice that it lacks, or data that it cannot use.
    """
    from idloop.estimation.black_box.sampled import together

    found, chosen = find_method(method), choices or Choices()
    _check_structure(found, chosen)
    experiments = together(data)
    _check_outputs(found, experiments)
    orders, delays = _orders(found, chosen), _delays(found, chosen, experiments)
    tries = list(product(orders, delays))
    if len(tries) == 1:
        return _fitted(found, experiments, chosen, *tries[0])
    models: list[Identified] = []
    trials: list[Trial] = []
    failure: IdloopError | None = None
    for index, (order, delay) in enumerate(tries):
        progress(index / len(tries), f"order {order}, delay {delay}" if "delay" in found.needs else f"order {order}")
        try:
            models.append(_fitted(found, experiments, chosen, order, delay))
        except IdloopError as error:
            failure = failure or error
            trials.append(Trial(order, delay, error=str(error)))
            continue
        trials.append(Trial(order, delay))
    if not models:
        raise failure or IdloopError(f"{method}: nothing to try")
    criteria = _criteria(models, experiments)
    known = iter(criteria)
    trials = [trial if trial.error else replace(trial, bic=next(known)) for trial in trials]
    # A model whose errors overflow never wins over one that has a BIC.
    best = min(range(len(models)), key=lambda place: (not isfinite(criteria[place]), criteria[place], place))
    return replace(models[best], trials=tuple(trials))


def information(found: Identified, data: Sequence[SampledData]) -> Information:
    """Loss and criteria of a model on the data that it was identified from."""
    import numpy as np

    model = found.linear
    if model is not None:
        return model.information
    if not found.predicts:
        raise InputError(f"{found.method.name}: a response has no prediction errors, compare models")
    network: Any = found.model
    errors = [network.innovations(one)[network.first :] for one in data]
    return of_errors(np.concatenate(errors), network.free)


def _check_structure(method: Method, choices: Choices) -> None:
    """Refuse degrees that the method does not have."""
    unknown = [name for name in choices.structure if name not in method.polynomials]
    if unknown:
        own = f"its polynomials are {', '.join(method.polynomials)}" if method.polynomials else "it has no polynomials"
        raise InputError(f"{method.name}: structure names {', '.join(unknown)}; {own}")
    if choices.structure.get("nb") == 0:
        raise InputError(f"{method.name}: with nb = 0 the command has no effect in the model; take 1 or more")


def _check_outputs(method: Method, data: Sequence[SampledData]) -> None:
    """Refuse linearly dependent outputs: the covariance of their errors would be singular."""
    import numpy as np

    from idloop.estimation.statistics.collinear import any_collinear

    if method.kind != "response" and any_collinear(np.vstack([one.output for one in data])):
        raise InputError(
            f"{data[0].name}: the outputs {', '.join(data[0].output_names)} move together at every sample, one is a"
            " combination of the others; identify one of them (--output)"
        )


def _criteria(models: Sequence[Identified], data: Sequence[SampledData]) -> list[float]:
    """Criterion of each that chooses between orders and delays; NaN or infinite where the free run diverges.

    Errors of a free run are as coloured as the disturbance, which no order of the model makes white: only the share of
    them that is independent in the best one counts.
    """
    import numpy as np

    if models[0].method.selects == "prediction":
        return [one.bic for one in comparable([information(one, data) for one in models])]
    found_errors: list[tuple[Information, Any]] = []
    for found in models:
        model: Any = found.model
        with np.errstate(all="ignore"):
            errors = np.concatenate([one.output - model.simulate(one) for one in data])
            found_errors.append((of_errors(errors, model.free), errors))
    finite = [one for one in found_errors if isfinite(one[0].loss)]
    if not finite:
        return [one.bic for one, _ in found_errors]
    share = independent_share(min(finite, key=lambda one: one[0].loss)[1])
    return [replace(one, samples=share * one.samples).bic for one, _ in found_errors]


def _fitted(
    method: Method, data: list[SampledData], choices: Choices, order: int | Literal["auto"], delay: int
) -> Identified:
    from numpy.linalg import LinAlgError

    try:
        found = method.run(data, choices, order, delay)
    except LinAlgError as error:
        # With an order far above the plant's the filters overflow during the estimation.
        size = f" of order {order}" if "order" in method.needs and isinstance(order, int) else ""
        raise InputError(
            f"{data[0].name}: {method.name}{size} overflows on the way to a model; lower the order or excite more"
            " frequencies"
        ) from error
    model, history = found if isinstance(found, tuple) else (found, ())
    if method.kind in ("linear", "recursive"):
        model = replace(model, method=method.name, notes=(*model.notes, *_offset_notes(data)))
    return Identified(method, model, order, delay if "delay" in method.needs else None, history=history)


def _offset_notes(data: list[SampledData]) -> list[str]:
    """One note for each output whose offset is far larger than its motion."""
    import numpy as np

    notes = []
    for column, name in enumerate(data[0].output_names):
        levels = [abs(float(np.mean(one.output[:, column]))) for one in data]
        spans = [float(np.ptp(one.output[:, column])) for one in data]
        if max(levels) > _LARGEST_OFFSET * max(spans):
            notes.append(f"{name} has an offset of {max(levels) / max(spans):.0f} times its range: remove it first")
    return notes


def _orders(method: Method, choices: Choices) -> Sequence[int | Literal["auto"]]:
    if "order" not in method.needs:
        return ("auto",)
    if method.polynomials and set(method.polynomials) <= set(choices.structure):
        # Every degree is given: there is nothing to choose.
        return (1,)
    if isinstance(choices.order, str):
        return method.automatic or ("auto",)
    return (choices.order,) if isinstance(choices.order, int) else choices.order


def _delays(method: Method, choices: Choices, data: list[SampledData]) -> Sequence[int]:
    if "delay" not in method.needs:
        return (1,)
    if not isinstance(choices.delay, str):
        return (choices.delay,) if isinstance(choices.delay, int) else choices.delay
    from idloop.estimation.polynomial import estimate_delay

    columns = range(data[0].output.shape[1])
    found = [estimate_delay([one.outputs([i]) for one in data], longest=_DELAYS) for i in columns]
    # All outputs have one delay: a longer one would cut off part of the fastest response.
    shortest = min(min(one.delay) for one in found)
    if shortest >= _DELAYS:
        raise InputError(
            f"{data[0].name}: the command has no clear effect within {_DELAYS} samples; look at the response with cra,"
            " or give --delay a number"
        )
    return (shortest,)
