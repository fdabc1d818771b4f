"""Which criterion a diagnosis measures its models by."""

from __future__ import annotations

from collections.abc import Sequence

from idloop.diagnose.setting import KINDS
from idloop.errors import IdloopError, InputError
from idloop.estimate.choose import after_fit, before_fit
from idloop.estimate.dataset import prepare
from idloop.estimate.engine import RememberingEngine
from idloop.estimate.force import ForceCriterion, balance_of
from idloop.estimate.solve import solve
from idloop.physics.model import Model
from idloop.records import Record


def choose_kind(model: Model, records: Sequence[Record], criterion: str) -> str:
    """Criterion for a model and records, by the rule of `idloop.estimate.choose`.

    Parameters
    ----------
    model : Model
    records : sequence of Record
    criterion : {"auto", "prediction", "simulation", "force"}

    Returns
    -------
    {"prediction", "simulation", "force"}

    Raises
    ------
    InputError
        Unknown criterion.
    """
    if criterion in KINDS:
        return criterion
    if criterion != "auto":
        raise InputError(f"criterion {criterion!r} is unknown; choose auto, {', '.join(KINDS)}")
    data = prepare(model, records)
    engine = RememberingEngine(model)
    first = [balance_of(engine, d, None) for d in data]
    known = [b for b in first if b is not None]
    if len(known) < len(first):
        return "prediction"
    cutoff = max(b.motion.cutoff for b in known)
    balances = [balance_of(engine, d, r, cutoff) for d, r in zip(data, records, strict=True)]
    if before_fit(balances).criterion != "force" or not model.free:
        return "prediction"
    rule = ForceCriterion(engine, [b for b in balances if b is not None])
    try:
        found = solve(rule, model.theta, *model.bounds)
    except IdloopError:
        return "prediction"
    return after_fit(engine, rule, found.theta, found.nuisance).criterion
