"""The seven ways of the torsion thesis to identify a model (section 4.4), on one record."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from idloop.errors import IdloopError
from papers.torsion import torsion_thesis as thesis

if TYPE_CHECKING:
    import control
    from idloop.estimation.black_box.sampled import SampledData
    from idloop.estimation.linear import LinearModel
    from idloop.estimation.subspace.realisation import Weighting
    from idloop.physics import Model
    from idloop.records import Record

Array = NDArray[np.float64]

ITERATIONS = 20
_LEAK = 0.01
_GRAIN = 1e-7  # [rad]


@dataclass(frozen=True)
class Choices:
    """What the user of a subspace method sets.

    Attributes
    ----------
    states : int
    horizon : int
        The thesis's i.
    feedthrough : bool
        Estimate D, as the thesis's models of VODMA have it.
    iterations : int
        Of the prediction error method that follows.
    integrates : bool
        The angles are known to integrate, as they do without dry friction: one pole is put at 1.
    vodma_weighting : "n4sid", "cva" or "moesp"
        Of the projection that VODMA decomposes; the thesis's eq. 3.19 has none.
    """

    states: int = thesis.STATES
    horizon: int = thesis.HORIZON
    feedthrough: bool = True
    iterations: int = ITERATIONS
    integrates: bool = False
    vodma_weighting: Weighting = "n4sid"


def black_box(
    train: SampledData,
    law: control.LTI | None,
    choices: Choices,
    ways: Sequence[str] = thesis.WAYS,
) -> dict[str, LinearModel | None]:
    """Models of the subspace methods, and each refined by prediction errors.

    Parameters
    ----------
    train : SampledData
    law : python-control system or None
        From the motor's angle to what is subtracted from the command, at the data's sample time; None in open loop,
        where VODMA is its direct variant.
    choices : Choices
    ways : sequence of str
        Of `torsion_thesis.WAYS`; "PEM" alone is not a black box and is passed over.

    Returns
    -------
    dict of str to LinearModel or None
        None where a method finds no model.
    """
    from idloop.estimation.subspace import n4sid, vodma, vodma_direct

    # Poles outside the unit circle are reflected: the plant integrates, and an estimate of 1 may fall on either side.
    common: dict[str, Any] = {
        "horizon": choices.horizon,
        "feedthrough": choices.feedthrough,
        "stable": True,
        "integrates": choices.integrates,
    }
    makers: dict[str, tuple[str, Callable[[], LinearModel]]] = {
        thesis.DIRECT: (thesis.DIRECT_PEM, lambda: vodma_direct(train, choices.states, weighting="n4sid", **common)),
        thesis.N4SID: (thesis.N4SID_PEM, lambda: n4sid(train, choices.states, focus="simulation", **common)),
    }
    if law is not None:
        makers[thesis.VODMA] = (
            thesis.VODMA_PEM,
            lambda: vodma(
                train, {train.output_names[0]: law}, choices.states, weighting=choices.vodma_weighting, **common
            ),
        )
    found: dict[str, LinearModel | None] = {}
    for name, (refined, make) in makers.items():
        if name not in ways and refined not in ways:
            continue
        start = _tried(make)
        found[name] = start
        if refined in ways:
            found[refined] = _tried(partial(_refined, train, start, choices.iterations))
    return found


def _refined(train: SampledData, start: LinearModel | None, iterations: int) -> LinearModel | None:
    from idloop.estimation.linear import prediction_error

    return None if start is None else prediction_error(train, start, focus="simulation", max_iterations=iterations)


def _tried(make: Callable[[], LinearModel | None]) -> LinearModel | None:
    try:
        return make()
    except IdloopError:
        return None


def black_box_fits(
    train: SampledData,
    validation: SampledData,
    law: control.LTI | None,
    choices: Choices,
    ways: Sequence[str] = thesis.WAYS,
) -> dict[str, float]:
    """FIT of the free run on the validation data of `black_box`'s models [%]; NaN where there is none."""
    return {name: fit_of(model, validation) for name, model in black_box(train, law, choices, ways).items()}


def fit_of(model: LinearModel | None, validation: SampledData) -> float:
    """FIT of a model's free run [%]; NaN without a model."""
    if model is None:
        return float("nan")
    with np.errstate(over="ignore", invalid="ignore"):
        return thesis.average_fit(validation.output, model.simulate(validation))


def laboratory(setting: thesis.Setting, seed: int, length: float = thesis.LENGTH) -> Record:
    """An experiment of table 5.1 on the simulated machine; its input is the law, in amperes.

    The compensated law is the motor's current, limited; without compensation the current has the offset as well.
    """
    section = thesis.controller(setting.controller, limit=thesis.LIMIT)
    wanted = thesis.reference(setting, seed, length)
    record = thesis.in_loop(thesis.machine(), section, wanted, compensated=setting.compensated)
    offset = thesis.CURRENT_OFFSET if setting.compensated else 0.0
    return replace(record, input=thesis.CURRENT_GAIN * record.input + offset, input_unit="A")


def laboratory_fits(
    record: Record,
    setting: thesis.Setting,
    choices: Choices,
    ways: Sequence[str] = thesis.WAYS,
    sample_time: float = thesis.IDENTIFIED_EVERY,
) -> dict[str, float]:
    """FIT on the validation half of a laboratory experiment, by way [%]; NaN where there is no model.

    Parameters
    ----------
    record : Record
        From `laboratory`.
    setting : Setting
    choices : Choices
    ways : sequence of str
    sample_time : float
        [s]
    """
    train, validation = thesis.halves(thesis.thinned(record, sample_time, filtered=True))
    # Dry friction is no noise of a linear loop: without weights VODMA's states come and go with the draw.
    choices = replace(choices, vodma_weighting="cva")
    law = thesis.sampled_controller(setting.controller, sample_time)
    fits = black_box_fits(train, validation, law, choices, ways)
    if thesis.PEM in ways:
        fits[thesis.PEM] = fit_of(_tried(lambda: from_quanser(train, choices.iterations)), validation)
    return {way: fits[way] for way in ways if way in fits}


def from_quanser(train: SampledData, iterations: int) -> LinearModel:
    """PEM from the Quanser model, sampled, every entry free but D: errors of the free run.

    The start forgets 1 % a sample: the integrator's own free run is far off before the search begins.
    """
    import control
    from idloop.estimation.linear import LinearModel, prediction_error
    from idloop.physics import Engine

    linear = Engine(thesis.quanser()).linearise(None)
    plant = control.ss(linear.A, linear.B[:, None], linear.C, np.zeros((4, 1)))
    held = control.c2d(plant, train.sample_time)
    start = LinearModel(
        method="quanser", a=(1.0 - _LEAK) * held.A, b=held.B, c=held.C, d=held.D, gain=np.zeros((8, 4)),
        covariance=np.eye(4), samples=len(train), free=0, **train.labels,
    )  # fmt: skip
    return prediction_error(train, start, focus="simulation", max_iterations=iterations)


# -- the physical model ---------------------------------------------------------------------


def half_records(record: Record, command: Array | None = None) -> tuple[Record, Record]:
    """The two halves of a record for a physical model: every command, outputs down-sampled.

    Parameters
    ----------
    record : Record
        At 1 kHz.
    command : ndarray, optional
        Other commands than the record's.
    """
    step = round(thesis.IDENTIFIED_EVERY / thesis.MEASURED_EVERY)
    first = round(thesis.DROPPED / thesis.MEASURED_EVERY)
    last = len(record.time) - first
    middle = first + (last - first) // (2 * step) * step
    sent = record.input if command is None else command
    whole = replace(record, input=sent, reference=None, reference_time=None)
    parts = []
    for a, b in ((first, middle), (middle, last)):
        parts.append(
            replace(whole, input_time=record.input_time[a:b], input=sent[a:b], time=record.time[a:b:step],
                    output=record.output[a:b:step])
        )  # fmt: skip
    return parts[0], parts[1]


def away_from(model: Model, seed: int, spread: float = 0.2) -> Model:
    """The model with all its free parameters wrong, each by a factor of this deviation."""
    random = np.random.default_rng(seed)
    return model.with_values(
        {n: model.values[n] * float(np.exp(spread * random.standard_normal())) for n in model.free}
    )


def grey_box(start: Model, train: Record) -> Model:
    """PEM on the physical model: every free parameter, errors of the free run."""
    from idloop.estimation import fit

    # Exact data leave no covariance to weigh the outputs by: a ten-thousandth of a count of the encoders mends that.
    grain = _GRAIN * np.random.default_rng(0).standard_normal(train.output.shape)
    return fit(start, [replace(train, output=train.output + grain)], criterion="simulation").model


def physical_fit(model: Model, validation: Record) -> float:
    """FIT of a physical model's free run from its best first state [%]."""
    from idloop.estimation.dataset import prepare
    from idloop.physics import Engine
    from idloop.validation.free_run import free_run

    try:
        (data,) = prepare(model, [validation])
        return thesis.average_fit(data.output, free_run(Engine(model), data))
    except IdloopError:
        return float("nan")
