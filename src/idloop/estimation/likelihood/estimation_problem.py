"""Estimation problem: data, criterion and noise that all models of a diagnosis share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from idloop.arrays import Array
from idloop.errors import IdloopError, InputError
from idloop.estimation.criterion import Criterion
from idloop.estimation.dataset import Data, common_conditions, force_scale, output_groups, output_noise, prepare
from idloop.estimation.observer.innovations import InnovationCriterion
from idloop.estimation.optimisation.caching_engine import CachingEngine
from idloop.estimation.optimisation.least_squares import LeastSquaresProblem
from idloop.estimation.simulation import SimulationCriterion
from idloop.estimation.statistics.whitening import Whitener
from idloop.physics import kernel
from idloop.physics.layout import Layout
from idloop.physics.model import Model
from idloop.records import Record
from idloop.records.inspection.checks import excites

# Most integration steps per sample, or per second, of a model: faster dynamics do not show in the samples.
_STEPS_PER_SAMPLE, _STEPS_PER_SECOND = 25.0, 5000.0
# Most steps per sample for effects, such as bristles at full speed, or as a multiple of those of the chain of bodies.
_EFFECT_STEPS_PER_SAMPLE, _EFFECT_STEPS_PER_CHAIN_STEP = 8.0, 2.0
# Dynamics of more than so many half-turns per sample are integrated stably, but not accurately: with steps of two
# radians instead of one.
_UNRESOLVED, _COARSE = 2.0, 2.0
# Most samples or windows in which effects are compared: there an error smaller by 1 % is worth 200 units of
# log-likelihood, twenty times what an effect must gain.
ENOUGH = 20_000
# Samples that predictions look at first: there an error smaller by 1 % is worth 50 units, five times that.
FEW = 5_000
# Segments of all records that make a subsample, each as long as the slow parts of a motion.
_SEGMENTS = 4
# Errors below this part of an output's deviation are rounding.
_EXACT = 1e-9


class BoundedRateEngine(CachingEngine):
    """Engine whose methods raise `IdloopError` for parameter values with dynamics far faster than the samples.

    `sample_time`: of the records [s].
    `speed`: largest speed in the records.

    Attributes
    ----------
    most : float
        Fastest rate of the chain [rad/s].
    """

    def __init__(self, model: Model, sample_time: float, speed: float) -> None:
        super().__init__(model)
        self.most = max(_STEPS_PER_SAMPLE / sample_time, _STEPS_PER_SECOND)
        self._most_effect = max(_EFFECT_STEPS_PER_SAMPLE / sample_time, _STEPS_PER_SECOND)
        self._unresolved = _UNRESOLVED * np.pi / sample_time
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
        along = max(kernel.rate_along.py_func(rates, self._speed) for rates in layout.axis.spatial_rate)
        own_rate = float(layout.axis.constants[kernel.BEYOND])
        # Separate limits: a chain at its limit must leave room for an effect.
        chain = chain_rate(layout)
        if chain + along > self.most or own_rate + along > max(self._most_effect, _EFFECT_STEPS_PER_CHAIN_STEP * chain):
            raise IdloopError("these values make the model faster than the samples can show")
        own = layout.axis.constants[kernel.RATE]
        layout.axis.constants[kernel.RATE] = max(own / _COARSE, min(own, self._unresolved))
        return layout


def chain_rate(layout: Layout) -> float:
    """Fastest rate of the chain of bodies without effects [rad/s]."""
    return float(layout.axis.constants[kernel.RATE]) - float(layout.axis.constants[kernel.BEYOND])


@dataclass(frozen=True)
class EstimationProblem:
    """Data, criterion and noise for the estimation of one model or several."""

    kind: str  # one of `prediction`, `simulation`: criterion, see `idloop.estimation.fit`
    records: tuple[Record, ...]
    data: tuple[Data, ...]  # the records as arrays for the simulator
    noise: Array  # shape (p,): standard deviation of each output's measurement noise
    force: float  # typical drive force
    speed: float  # largest measured speed
    deviation: Array  # shape (p,): standard deviation of each output
    # Outputs that are measured at the same instants, as of `output_groups`, in these records and their companions
    groups: list[list[int]]
    # Common whitening of all models, by group of outputs; each model's own when None
    whiteners: tuple[Whitener, ...] | None = None

    @cached_property
    def conditions(self) -> dict[str, str]:
        """Names and units of the measured conditions that all records hold."""
        return common_conditions(self.data)

    def subsampled(self, most: int) -> EstimationProblem:
        """The problem on about so many samples, in segments spread evenly over the records."""
        total = sum(len(one.time) for one in self.data)
        if total <= most:
            return self
        records, data = [], []
        for record, one in zip(self.records, self.data, strict=True):
            for piece in np.array_split(np.arange(len(one.time)), max(round(_SEGMENTS * len(one.time) / total), 1)):
                stretch = one.part(int(piece[0]), int(piece[0]) + max(round(len(piece) * most / total), 2))
                data.append(stretch)
                records.append(record.cut(float(stretch.time[0]), float(stretch.time[-1])))
        return replace(self, records=tuple(records), data=tuple(data))

    def with_later_command(self, shift: float) -> EstimationProblem:
        """The problem with a command that acts later than its stamps by ``shift`` [s]; earlier if negative."""
        return replace(self, data=tuple(replace(one, input_time=one.input_time + shift) for one in self.data))

    def problem(self, criterion: Criterion, parameters: int) -> LeastSquaresProblem:
        """Least-squares problem of a criterion of this estimation, for a number of model parameters."""
        floors = None
        if isinstance(criterion, InnovationCriterion | SimulationCriterion):
            floors = [_EXACT * self.deviation[group] for group in criterion.groups]
        return LeastSquaresProblem(
            criterion, parameters, None if self.whiteners is None else list(self.whiteners), floors
        )

    def criterion(self, model: Model) -> Criterion:
        """The criterion for one model."""
        engine = self.engine(model)
        if self.kind == "simulation":
            return SimulationCriterion(engine, list(self.data), groups=self.groups)
        return InnovationCriterion(engine, list(self.data), self.noise, self.force, groups=self.groups)

    def resolves(self, model: Model) -> bool:
        """Whether the samples resolve the rate of a model's chain of bodies.

        A feedback from a disturbed motion to the command looks like a machine without inertia in a force balance.
        """
        engine = self.engine(model)
        return chain_rate(CachingEngine(model).layout()) <= engine.most

    def evaluates(self, model: Model) -> bool:
        """Whether the samples resolve all rates of a model, with those of its effects."""
        try:
            self.engine(model).layout()
        except IdloopError:
            return False
        return True

    def resolvable(self, model: Model) -> Model:
        """The model as a start of a search: with free inertias raised until the samples resolve the rate of its chain.

        The same model where that does not help: what is known stays.
        """
        raised, names = model, {f"{body}.inertia" for body in model.bodies}
        most = dict(zip(model.free, model.bounds[1].tolist(), strict=True))
        while not self.resolves(raised):
            inertias = {name: min(2.0 * raised.values[name], most[name]) for name in names & most.keys()}
            if not any(value > raised.values[name] for name, value in inertias.items()):
                return model
            raised = raised.with_values(inertias)
        return raised

    def engine(self, model: Model) -> BoundedRateEngine:
        """Engine of one model for a search."""
        return BoundedRateEngine(model, min(d.sample_time for d in self.data), self.speed)


def prepare_estimation(
    model: Model, records: Sequence[Record], kind: str, companions: Sequence[Record] = ()
) -> EstimationProblem:
    """Check records and prepare them for estimation.

    `kind`: one of "prediction", "simulation".
    `companions`: further records of the same outputs, for another problem with noise models of the same groups.
    Raises InputError: the records do not match the model, or the command never changes.
    """
    together = prepare(model, [*records, *companions] if records else [])
    data = together[: len(records)]
    if not excites(records):
        raise InputError("the command never changes in these records; excite the axis, nothing can be identified")
    engine = CachingEngine(model)
    return EstimationProblem(
        kind,
        tuple(records),
        tuple(data),
        output_noise(model, data),
        force_scale(engine, data),
        _largest_speed(model, data),
        np.array([_deviation(column) for column in np.concatenate([d.output for d in data]).T]),
        output_groups(together),
    )


def _deviation(column: Array) -> float:
    known = column[np.isfinite(column)]
    return float(np.std(known)) if known.size else 0.0


def _largest_speed(model: Model, data: list[Data]) -> float:
    """99th percentile of the speed of the fastest body."""
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
                # Differences over ten samples suppress the noise.
                run, span = y[known], 10
                elapsed = d.time[known][span:] - d.time[known][:-span]
                most = max(most, float(np.percentile(np.abs(run[span:] - run[:-span]) / elapsed, 99.0)))
    return most
