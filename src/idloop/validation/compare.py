"""Comparison of a model with a record: measures, error analysis and residual tests."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from idloop.arrays import Array
from idloop.errors import IdloopError, InputError
from idloop.estimation.feedback import exogenous_signals, feedback_possible
from idloop.estimation.sensors import body_sensors
from idloop.physics import Model
from idloop.records import Record
from idloop.validation.error_choice import MEASURES, choose_basis
from idloop.validation.measures import fit_percent, measures, nrmse, rmse
from idloop.validation.operating_state import error_share, motion_regions, smooth_velocity
from idloop.validation.residual import ResidualTest, residual_tests
from idloop.validation.runs import Runs
from idloop.validation.where import Where, where


@dataclass(frozen=True)
class Comparison(Runs):
    """Runs of a model on one record with their measures; costly parts are computed at first use.

    `wanted`: by output the error to break down, as `idloop.validation.where` takes it.
    """

    wanted: dict[str, str] = field(default_factory=dict, compare=False, repr=False)

    # -- measures -----------------------------------------------------------------------

    @property
    def fit(self) -> dict[str, float]:
        """FIT of the free run in percent, by output."""
        return self._named(fit_percent(self.measured, self.simulated))

    @property
    def nrmse(self) -> dict[str, float]:
        """Error of the free run over the spread of the measurement, by output."""
        return self._named(nrmse(self.measured, self.simulated))

    @property
    def rmse(self) -> dict[str, float]:
        """Root mean square error of the free run, by output."""
        return self._named(rmse(self.measured, self.simulated))

    @property
    def fit_ahead(self) -> dict[str, float]:
        """FIT of the prediction `steps` ahead in percent, by output."""
        return self._named(fit_percent(self.measured, self.ahead))

    @cached_property
    def share(self) -> dict[str, dict[str, dict[str, float]]]:
        """Share of the squared free-run error by region of motion: ``share[output][region]``."""
        velocity = self._velocity()
        if velocity is None:
            return {}
        error = self.measured - self.simulated
        if not np.any(np.isfinite(error)):
            return {}
        regions = motion_regions(self.time, velocity)
        return {name: error_share(error[:, i], regions) for i, name in enumerate(self.names)}

    @cached_property
    def where(self) -> Where:
        """Error analysis: share of every error by time, frequency, velocity, position, command, ..."""
        return where(self, self.wanted)

    @cached_property
    def _tested(self) -> dict[int, list[ResidualTest]]:
        return {}

    def residual_tests(self, lags: int = 25) -> list[ResidualTest]:
        """Whiteness of the one-step prediction errors, and their independence of the input.

        In a closed loop they are tested against the exogenous signals that were recorded.

        `lags`: largest lag in samples. Returns empty when the model has no observer.
        """
        if self._observer is None:
            return []
        if lags not in self._tested:
            fed_back = feedback_possible(self.record)
            outside = exogenous_signals(self.record, self.time) if fed_back else ()
            self._tested[lags] = residual_tests(
                self.innovation, self.data.held_input(), self.names, lags, outside=outside, fed_back=fed_back
            )
        return list(self._tested[lags])

    def compute(self) -> None:
        """Compute the costly parts now: predictions, error analysis and residual tests."""
        _ = self.ahead, self.where, self.residual_tests()

    def to_dict(self) -> dict[str, Any]:
        """Return all measures as plain numbers for JSON."""
        force, tested = self.force, len(self.time) >= 100
        error = None if force is None else {
            "relative_error": force.relative, "band_hz": force.band, "cutoff_hz": force.cutoff,
            "noise_share": force.noise_share, "noise": force.noise,
        }  # fmt: skip
        return {
            "model": self.model.name,
            "record": self.record.name,
            "free_run": measures(self.names, self.measured, self.simulated),
            "one_step": measures(self.names, self.measured, self.predicted),
            "ahead": {"steps": self.steps, **measures(self.names, self.measured, self.ahead)},
            "force": error,
            "share": self.share,
            "where": self.where.to_dict(),
            "residual": [test.to_dict() for test in self.residual_tests()] if tested else [],
        }

    def _named(self, values: Array) -> dict[str, float]:
        return dict(zip(self.names, (float(v) for v in values), strict=True))

    def _velocity(self) -> Array | None:
        place, speed = body_sensors(self.model)[0]
        if speed is not None and np.any(np.isfinite(self.measured[:, speed])):
            return self.measured[:, speed]
        if place is not None and np.sum(np.isfinite(self.measured[:, place])) > 50:
            return smooth_velocity(self.time, self.measured[:, place])
        return None


def share_measures(comparisons: Sequence[Comparison]) -> None:
    """Let models be compared by one error of each output: where the free run of one drifts, by a prediction of all.

    To be asked before the error analysis of any of them.
    """
    for column, name in enumerate(comparisons[0].names if len(comparisons) > 1 else ()):
        suit = {choose_basis(one, column, one.wanted.get(name, "")).name for one in comparisons}
        if len(suit) > 1:
            for one in comparisons:
                one.wanted[name] = max(suit, key=MEASURES.index)


def compare(
    model: Model,
    record: Record,
    steps: int = 10,
    cutoff: float | None = None,
    measures: Mapping[str, str] | None = None,
) -> Comparison:
    """Compare a model with a record: outputs in free run and some steps ahead, drive force, residuals.

    `model`: with the parameter values to use; only the initial state is fitted. `steps`: prediction horizon in samples.
    `cutoff`: cut-off of the differentiating filter on the drive side [Hz]; that of the training record
    (``Comparison.force.cutoff``) to compare records in one band. `measures`: by output the error to break down:
    ``free_run``, ``ahead`` or ``one_step``; that of another comparison (``Comparison.where.measures``) to compare
    models. Without it a prediction where the free run drifts. Raises InputError: the record does not match the model.
    Raises IdloopError: neither free run nor prediction stays finite, and no drive force can be compared.
    """
    if steps < 1:
        raise InputError(f"steps = {steps} is no prediction horizon; choose at least 1")
    comparison = Comparison(model, record, steps, cutoff, dict(measures or {}))
    # Simulated now, so that unsuitable data fails here and not in a later plot.
    runs = bool(np.any(np.isfinite(comparison.simulated)) or np.any(np.isfinite(comparison.innovation)))
    if not runs and comparison.force is None:
        raise IdloopError(f"neither free run nor prediction of model {model.name!r} stays finite")
    return comparison
