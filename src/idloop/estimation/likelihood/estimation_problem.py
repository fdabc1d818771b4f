"""What all models of one diagnosis are measured by: the data, the criterion, the noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from idloop.errors import IdloopError, InputError
from idloop.estimation.criterion import Criterion
from idloop.estimation.dataset import Data, force_scale, output_noise, prepare, recorded
from idloop.estimation.observer.innovations import InnovationCriterion
from idloop.estimation.optimisation.problem import Problem
from idloop.estimation.optimisation.smooth_engine import RememberingEngine
from idloop.estimation.simulation import SimulationCriterion
from idloop.estimation.statistics.whitening import Whitener
from idloop.physics import kernel
from idloop.physics.layout import Layout
from idloop.physics.model import Model
from idloop.records import Record
from idloop.records.inspection.checks import excites

Array = NDArray[np.float64]

# Integration steps per sample, and per second, that a model may take in a diagnosis: what is
# faster than this lies beyond what the samples can show and would only cost time.
_STEPS_PER_SAMPLE, _STEPS_PER_SECOND = 25.0, 5000.0
# Steps per sample for what is not the chain's own, such as bristles that give way at full speed.
_OWN_STEPS = 8.0
# ... or times as many as the chain needs.
_OWN_BY_CHAIN = 2.0

# Motion quicker than this many half-turns per sample is kept stable, not followed: the integration
# takes steps of two radians instead of one.
_UNSEEN, _COARSE = 2.0, 2.0

# Effects are weighed in so many samples or windows at most: what makes errors smaller by 1 % is worth 200 units of
# log-likelihood there, twenty times what a name asks for.
ENOUGH = 20_000
# ... in so many stretches, evenly spread over all records: each as long as the slow parts of a motion take.
_STRETCHES = 4

# Errors below this part of an output's deviation are rounding.
_EXACT = 1e-9


class FrugalEngine(RememberingEngine):
    """Engine that refuses parameter values with dynamics far faster than the samples.

    Its methods raise `IdloopError` for those.

    Parameters
    ----------
    model : Model
    sample_time : float
        Of the records [s].
    speed : float
        Largest speed in the records.

    Attributes
    ----------
    most : float
        Fastest rate of the chain [rad/s].
    """

    def __init__(self, model: Model, sample_time: float, speed: float) -> None:
        super().__init__(model)
        self.most = max(_STEPS_PER_SAMPLE / sample_time, _STEPS_PER_SECOND)
        self._most_own = max(_OWN_STEPS / sample_time, _STEPS_PER_SECOND)
        self._unseen = _UNSEEN * np.pi / sample_time
        self._speed = speed

    def _laid_out(self, theta: Array | None) -> Layout:
        layout = super()._laid_out(theta)
        values = dict(self.model.values)
        if theta is not None:
            values.update(zip(self.free, (float(v) for v in theta), strict=True))
        for active in self.model.effects:
            prefix = f"{active.name}."
            own = {name[len(prefix) :]: value for name, value in values.items() if name.startswith(prefix)}
            if not active.effect.valid(own):
                raise IdloopError(f"these values make no {active.effect.name}")
        along = self._speed * float(np.max(layout.axis.spatial_rate))
        own_rate = float(layout.axis.constants[kernel.BEYOND])
        # Each by itself: beside a chain at its limit there must still be room for an effect, and what is
        # not much quicker than the chain is no dearer than it.
        chain = chain_rate(layout)
        if chain + along > self.most or own_rate + along > max(self._most_own, _OWN_BY_CHAIN * chain):
            raise IdloopError("these values make the model faster than the samples can show")
        own = layout.axis.constants[kernel.RATE]
        layout.axis.constants[kernel.RATE] = max(own / _COARSE, min(own, self._unseen))
        return layout


def chain_rate(layout: Layout) -> float:
    """Fastest rate of a chain of bodies without its effects [rad/s]."""
    return float(layout.axis.constants[kernel.RATE]) - float(layout.axis.constants[kernel.BEYOND])


@dataclass(frozen=True)
class Setting:
    """Data and criterion of a diagnosis.

    Attributes
    ----------
    kind : {"prediction", "simulation"}
        Criterion, see `idloop.estimation.fit`.
    records : tuple of Record
    data : tuple of Data
        The same, laid out for the simulator.
    noise : array, shape (p,)
        Standard deviation of each output's measurement noise.
    force : float
        Typical drive force.
    speed : float
        Largest speed seen.
    spread : array, shape (p,)
        Standard deviation of each output.
    whiteners : tuple of Whitener or None
        One whitening for all models, by group of outputs; each model's own when None.
    """

    kind: str
    records: tuple[Record, ...]
    data: tuple[Data, ...]
    noise: Array
    force: float
    speed: float
    spread: Array
    whiteners: tuple[Whitener, ...] | None = None

    @cached_property
    def conditions(self) -> dict[str, str]:
        """Names and units of the measured conditions that all records hold."""
        return recorded(self.data)

    def thinned(self, most: int) -> Setting:
        """About so many of the samples, in stretches evenly spread over the records; itself where these are less."""
        total = sum(len(one.time) for one in self.data)
        if total <= most:
            return self
        records, data = [], []
        for record, one in zip(self.records, self.data, strict=True):
            for piece in np.array_split(np.arange(len(one.time)), max(round(_STRETCHES * len(one.time) / total), 1)):
                stretch = one.part(int(piece[0]), int(piece[0]) + max(round(len(piece) * most / total), 2))
                data.append(stretch)
                records.append(record.cut(float(stretch.time[0]), float(stretch.time[-1])))
        return replace(self, records=tuple(records), data=tuple(data))

    def problem(self, criterion: Criterion, parameters: int) -> Problem:
        """A criterion of this setting with its noise model.

        Parameters
        ----------
        criterion : Criterion
            Of this setting, or a part of one.
        parameters : int
            Number of model parameters.
        """
        floors = None
        if isinstance(criterion, InnovationCriterion | SimulationCriterion):
            floors = [_EXACT * self.spread[group] for group in criterion.groups]
        return Problem(criterion, parameters, None if self.whiteners is None else list(self.whiteners), floors)

    def criterion(self, model: Model) -> Criterion:
        """The criterion for one model."""
        engine = self.engine(model)
        if self.kind == "simulation":
            return SimulationCriterion(engine, list(self.data))
        return InnovationCriterion(engine, list(self.data), self.noise, self.force)

    def shows(self, model: Model) -> bool:
        """Whether a model's inertia, friction and springs are none of an axis far faster than the samples.

        A feedback from a disturbed motion to the command looks like one in a balance of forces: without inertia.
        """
        engine = self.engine(model)
        return chain_rate(RememberingEngine(model).layout()) <= engine.most

    def engine(self, model: Model) -> FrugalEngine:
        """A model made ready for a search."""
        return FrugalEngine(model, min(d.sample_time for d in self.data), self.speed)


def prepare_setting(model: Model, records: Sequence[Record], kind: str, beside: Sequence[Record] = ()) -> Setting:
    """Lay records out for a diagnosis.

    Parameters
    ----------
    model : Model
    records : sequence of Record
    kind : {"prediction", "simulation"}
    beside : sequence of Record
        Further records that another setting of the same outputs is made of.

    Raises
    ------
    InputError
        Records that do not suit the model, or a command that never changes.
    """
    data = prepare(model, records, beside=beside)
    if not excites(records):
        raise InputError("the command never changes in these records; excite the axis, nothing can be learnt")
    engine = RememberingEngine(model)
    return Setting(
        kind,
        tuple(records),
        tuple(data),
        output_noise(model, data),
        force_scale(engine, data),
        _largest_speed(model, data),
        np.array([_spread(column) for column in np.concatenate([d.output for d in data]).T]),
    )


def _spread(column: Array) -> float:
    known = column[np.isfinite(column)]
    return float(np.std(known)) if known.size else 0.0


def _largest_speed(model: Model, data: list[Data]) -> float:
    """Speed that is exceeded in one sample of a hundred only, of the fastest body."""
    most = 0.0
    for d in data:
        for column, output in enumerate(model.outputs):
            y = d.output[:, column] / output.scale
            known = np.isfinite(y)
            if np.sum(known) < 20:
                continue
            if output.field == "velocity":
                most = max(most, float(np.percentile(np.abs(y[known]), 99.0)))
            else:
                # Over ten samples, so that noise does not pass for speed.
                run, span = y[known], 10
                elapsed = d.time[known][span:] - d.time[known][:-span]
                most = max(most, float(np.percentile(np.abs(run[span:] - run[:-span]) / elapsed, 99.0)))
    return most
