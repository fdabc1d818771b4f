"""Nonlinear ARX model with a neural network of one hidden layer."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from idloop.arrays import Array
from idloop.errors import InputError
from idloop.estimation.black_box.sampled import SampledData
from idloop.estimation.networks.model import NarxModel
from idloop.estimation.networks.network import SIGMOID, Network
from idloop.estimation.networks.training import TrainingHistory, TrainingRules, mean_squares, train
from idloop.estimation.networks.training_data import Division, Form, Preparation, TappedDelays, by_range, prepare


def narx_neural(
    data: SampledData | Sequence[SampledData],
    delays: TappedDelays | None = None,
    *,
    hidden: int = 10,
    division: Division | None = None,
    rules: TrainingRules | None = None,
    form: Form = "series-parallel",
    restarts: int = 1,
    seed: int = 0,
) -> NarxModel:
    """Tapped delays, tanh units and a linear output, trained by Levenberg-Marquardt with early stopping.

    The defaults are those of the usual NARX network: two delays, 10 hidden neurons, regressors scaled to −1..1,
    70/15/15 % of the samples for training, validation and test drawn at random, the start after Nguyen and Widrow
    (Proc. IJCNN 1990). A network is trained in series-parallel form first; the parallel form carries on from there
    and fits the free run.

    `delays`: two past outputs and inputs by default; `hidden`: units; `form`: "series-parallel", "parallel";
    `restarts`: starts of which the one with the least validation error is kept; `seed`: of the division and the starts:
    equal seeds give equal models. Raises InputError: too little data for the network, or numbers out of range.
    """
    delays, rules = delays or TappedDelays(), rules or TrainingRules()
    division = division or Division()
    if hidden < 1 or restarts < 1:
        raise InputError(f"{hidden} hidden units, {restarts} starts; give at least one of each")
    if form not in {"series-parallel", "parallel"}:
        raise InputError(f"form {form!r}; take 'series-parallel' or 'parallel'")
    random = np.random.default_rng(seed)
    prepared = prepare(data, delays, division, random, lambda r, p: hidden * (r + 1) + p * (hidden + 1))
    found: tuple[float, Network, TrainingHistory] | None = None
    for _ in range(restarts):
        network, history = train(_start(prepared, hidden, random), prepared.data, rules)
        if form == "parallel":
            network, history = train(network, prepared.data, rules, parallel=True)
        error = mean_squares(network, prepared.data, form == "parallel")
        score = float(error[1] if np.isfinite(error[1]) else error[0])
        if found is None or score < found[0]:
            found = score, network, history
    assert found is not None  # noqa: S101 - at least one start
    return NarxModel.of("narx-neural", prepared, found[1], found[2], form)


def nguyen_widrow(hidden: int, inputs: int, random: np.random.Generator) -> tuple[Array, Array]:
    """Weights and biases whose active regions share out the cube from −1 to 1 (Nguyen and Widrow 1990)."""
    size = 2.0 * 0.7 * hidden ** (1.0 / inputs)
    weight = random.uniform(-1.0, 1.0, (hidden, inputs))
    weight *= size / np.linalg.norm(weight, axis=1, keepdims=True)
    bias = size * (np.linspace(-1.0, 1.0, hidden) if hidden > 1 else np.zeros(1)) * np.sign(weight[:, 0])
    return weight, bias


def _start(prepared: Preparation, hidden: int, random: np.random.Generator) -> Network:
    center, width = by_range(prepared.train)
    direction, scale = nguyen_widrow(hidden, center.size, random)
    weight = random.uniform(-1.0, 1.0, (prepared.output_center.size, hidden)) / np.sqrt(hidden)
    kind = np.full(hidden, SIGMOID, dtype=np.int64)
    return prepared.network(center, width, kind, np.ascontiguousarray(direction), np.ascontiguousarray(scale), weight)
