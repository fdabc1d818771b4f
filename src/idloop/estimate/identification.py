"""Identification by any black-box method, with its order and delay chosen where that is asked for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import product
from math import isfinite
from typing import TYPE_CHECKING, Any, Literal

from idloop.errors import IdloopError, InputError
from idloop.estimate.information import Information, of_errors
from idloop.estimate.method import Choices, Identified, Method, Trial
from idloop.estimate.methods import find_method

if TYPE_CHECKING:
    from idloop.estimate.sampled import SampledData

Progress = Callable[[float, str], None]

_DELAYS = 20  # samples that "auto" looks back for the first effect of the command
_FAR = 10.0  # times its motion that an output may lie from 0 before that is noted


def identify(
    data: SampledData | Sequence[SampledData],
    method: str,
    choices: Choices | None = None,
    progress: Progress = lambda fraction, note: None,
) -> Identified:
    """Identify by any method; of several orders and delays the least BIC on these data wins.

    Parameters
    ----------
    data : SampledData or sequence of SampledData
    method : str
        One of `METHODS`.
    choices : Choices, optional
    progress : callable, optional
        Told the share done and what is tried.

    Returns
    -------
    Identified

    Raises
    ------
    InputError
        No such method, a choice that it lacks, or data that it cannot use.
    """
    from idloop.estimate.sampled import together

    found, chosen = find_method(method), choices or Choices()
    experiments = together(data)
    orders, delays = _orders(found, chosen), _delays(found, chosen, experiments)
    tries = list(product(orders, delays))
    if len(tries) == 1:
        return _tried(found, experiments, chosen, *tries[0])
    best: Identified | None = None
    least = float("inf")
    trials: list[Trial] = []
    failure: IdloopError | None = None
    for index, (order, delay) in enumerate(tries):
        progress(index / len(tries), f"order {order}, delay {delay}" if "delay" in found.needs else f"order {order}")
        try:
            one = _tried(found, experiments, chosen, order, delay)
        except IdloopError as error:
            failure = failure or error
            trials.append(Trial(order, delay, error=str(error)))
            continue
        bic = information(one, experiments).bic
        trials.append(Trial(order, delay, bic))
        # Written so that a model whose errors overflow never wins over one that has a BIC.
        if best is None or bic < least or not isfinite(least):
            best, least = one, bic
    if best is None:
        raise failure or IdloopError(f"{method}: nothing to try")
    return replace(best, trials=tuple(trials))


def information(found: Identified, data: Sequence[SampledData]) -> Information:
    """Loss and criteria of a model on the data that it was identified from.

    Raises
    ------
    InputError
        A response, which predicts nothing.
    """
    import numpy as np

    model = found.linear
    if model is not None:
        return model.information
    if not found.predicts:
        raise InputError(f"{found.method.name}: a response has no prediction errors, compare models")
    network: Any = found.model
    errors = [network.innovations(one)[network.first :] for one in data]
    return of_errors(np.concatenate(errors), network.free)


def _tried(
    method: Method, data: list[SampledData], choices: Choices, order: int | Literal["auto"], delay: int
) -> Identified:
    found = method.run(data, choices, order, delay)
    model, history = found if isinstance(found, tuple) else (found, ())
    if method.kind in ("linear", "recursive"):
        model = replace(model, notes=(*model.notes, *_offset_notes(data)))
    return Identified(method, model, order, delay if "delay" in method.needs else None, history=history)


def _offset_notes(data: list[SampledData]) -> list[str]:
    """One note for each output that lies so far from 0 that a linear model spends itself on that."""
    import numpy as np

    notes = []
    for column, name in enumerate(data[0].output_names):
        levels = [abs(float(np.mean(one.output[:, column]))) for one in data]
        spans = [float(np.ptp(one.output[:, column])) for one in data]
        if max(levels) > _FAR * max(spans):
            notes.append(
                f"{name} lies {max(levels) / max(spans):.0f} times its whole motion from 0: take that away first"
            )
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
    from idloop.estimate.polynomial import estimate_delay

    columns = range(data[0].output.shape[1])
    found = [estimate_delay([one.outputs([i]) for one in data], longest=_DELAYS) for i in columns]
    # One delay serves all outputs: a longer one would cut into the response of the quickest.
    shortest = min(min(one.delay) for one in found)
    if shortest >= _DELAYS:
        raise InputError(
            f"{data[0].name}: the command has no clear effect within {_DELAYS} samples; look at the response with cra,"
            " or give --delay a number"
        )
    return (shortest,)
