"""Errors of a model on a set of records, as a ladder reports them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from idloop.errors import IdloopError
from idloop.estimation.dataset import prepare
from idloop.estimation.force_balance.weak_fit import LEAST_UNEXPLAINED
from idloop.estimation.optimisation.caching_engine import CachingEngine
from idloop.physics.model import Model
from idloop.records import Record
from idloop.validation.drive import ForceError, force_error
from idloop.validation.free_run import free_run
from idloop.validation.measures import fit_percent, nrmse, rmse

# Other parameters compensate for an effect that was not missing: the unexplained force grows by a tenth or more.
_WORSE, _FAR_WORSE = 1.1, 1.5
# Of the force balance, over all outputs.
_FORCE = ("force", "force_noise")
# A free run with a larger error, as a part of the signal's deviation, does not follow it.
_FOLLOWS = 0.9
# Fifths of a record, kept for as long as the record: every model is run on them.
_FIFTHS: WeakKeyDictionary[Record, list[Record]] = WeakKeyDictionary()


def model_errors(model: Model, records: Sequence[Record]) -> dict[str, Any]:
    """Free-run errors ``nrmse``, ``fit`` [%], ``rmse`` and ``anew`` by output over all records, and by ``records``.

    ``anew`` is nrmse of a run that is started anew at every fifth of a record, ``force`` the relative force error, None
    where it is unknown, and ``force_noise`` the part that sensor noise alone makes. Empty without records.
    """
    if not records:
        return {}
    by_record = {record.name: _errors(model, record) for record in records}
    return {**_mean(list(by_record.values()), ("nrmse", "fit", "rmse", "anew", *_FORCE)), "records": by_record}


def explains_less(before: Model, after: Model, records: Sequence[Record]) -> bool:
    """Whether a model leaves more of the drive's force unexplained than another one.

    Where an effect splits a body, the force balance along its measured motion is void, and elsewhere noise may hide it:
    there the free run decides.
    """
    if after.inner_couplings:
        # Where it is started anew, the motion of the part that nobody measures is not known.
        was, now = (model_errors(one, records) for one in (before, after))
        return _grow(was, now, _WORSE) and _grow(was, now, _WORSE, of="nrmse")
    first, then = ([_force_error(one, record) for record in records] for one in (before, after))
    if not all(one is not None and one.trusted for one in first):
        # Without a balance a free run also gathers what a disturbance leaves.
        return _grow(_restarted(before, records), _restarted(after, records), _FAR_WORSE)
    # With a larger inertia sensor noise is a larger force: with that noise the error must be no larger.
    relative, typical = ([_force_sizes(several, of) for several in (first, then)] for of in ("relative", "typical"))
    # Below its own error a force balance separates no models. At a few steps of the command a moved timing shows.
    return all(leaves > _WORSE * max(left, LEAST_UNEXPLAINED) for left, leaves in (relative, typical))


def runs_worse(before: Model, after: Model, records: Sequence[Record]) -> bool:
    """Whether the free run of some output, started anew at every fifth, has errors that grow by a tenth or more.

    What did not follow the motion before shows nothing: an arm that a loop holds falls with the right model, and stands
    still with one that describes nothing.
    """
    was = _restarted(before, records)["anew"]
    followed = {name: error for name, error in was.items() if error < _FOLLOWS}
    return bool(followed) and _grow({"anew": followed}, _restarted(after, records), _WORSE)


def _grow(was: dict[str, Any], now: dict[str, Any], most: float, of: str = "anew") -> bool:
    """Whether errors of a free run, restarted where nothing else is asked for, grow by more than a factor."""
    return any(error > most * was[of].get(name, np.inf) for name, error in now[of].items())


def _errors(model: Model, record: Record) -> dict[str, Any]:
    names = [o.name for o in model.outputs]
    data = prepare(model, [record])[0]
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            simulated = free_run(CachingEngine(model), data)
    except IdloopError:
        simulated = np.full(data.output.shape, np.nan)
    found: dict[str, Any] = {"anew": _anew(model, record), **_force(model, record)}
    for label, measure in (("nrmse", nrmse), ("fit", fit_percent), ("rmse", rmse)):
        values = measure(record.output, simulated)
        found[label] = {name: float(value) for name, value in zip(names, values, strict=True) if np.isfinite(value)}
    return found


def _force(model: Model, record: Record) -> dict[str, float | None]:
    """Relative force error, and the part that sensor noise alone makes; None where they are not known."""
    force = _force_error(model, record)
    if force is None:
        return dict.fromkeys(_FORCE)
    return {"force": force.relative if force.trusted else None, "force_noise": force.noise}


def _force_sizes(errors: Sequence[ForceError | None], of: str) -> float:
    """One of the relative force errors over all records."""
    return _rms([math.inf if one is None else float(getattr(one, of)) for one in errors])


def _force_error(model: Model, record: Record) -> ForceError | None:
    try:
        return force_error(model, record)
    except IdloopError:
        return None


def _restarted(model: Model, records: Sequence[Record]) -> dict[str, Any]:
    """Errors of the free run that is restarted at every fifth, over all records."""
    return _mean([{"anew": _anew(model, record)} for record in records], ("anew",))


def _anew(model: Model, record: Record) -> dict[str, float]:
    """Error of the free run by output, started anew at every fifth, over which a disturbance adds up less.

    Empty where a fifth is too short to be run.
    """
    powers = []
    try:
        if record not in _FIFTHS:
            ends = np.linspace(record.time[0], record.time[-1], 6)
            _FIFTHS[record] = [record.cut(float(start), float(end)) for start, end in pairwise(ends)]
        for part in _FIFTHS[record]:
            with np.errstate(over="ignore", invalid="ignore"):
                simulated = free_run(CachingEngine(model), prepare(model, [part])[0])
                powers.append(np.nanmean((part.output - simulated) ** 2, axis=0))
    except IdloopError:
        return {}
    spread = np.nanstd(record.output, axis=0)
    errors = np.sqrt(np.mean(powers, axis=0)) / np.where(spread > 0.0, spread, np.nan)
    return {o.name: float(error) for o, error in zip(model.outputs, errors, strict=True) if np.isfinite(error)}


def _mean(several: list[dict[str, Any]], labels: Sequence[str]) -> dict[str, Any]:
    """Root mean square over the records of all but FIT, which is averaged."""
    mean: dict[str, Any] = {}
    for label in labels:
        if label in _FORCE:
            known = [one[label] for one in several]
            mean[label] = None if None in known else _rms(known)
            continue
        mean[label] = {}
        for name in dict.fromkeys(name for one in several for name in one[label]):
            values = [one[label][name] for one in several if name in one[label]]
            mean[label][name] = float(np.mean(values)) if label == "fit" else _rms(values)
    return mean


def _rms(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
