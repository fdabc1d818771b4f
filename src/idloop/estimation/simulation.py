"""Criterion of free-run errors: measured minus simulated outputs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from idloop.arrays import Array, Mask
from idloop.estimation.criterion import Errors, InitialStates
from idloop.estimation.dataset import Data, output_groups

if TYPE_CHECKING:
    from idloop.physics import Engine


class SimulationCriterion:
    """Measured minus freely simulated output; initial states are nuisance parameters.

    `engine`: compiled model.
    `data`: records.
    `groups`: outputs that share a noise model; those measured at the same instants when left out.
    """

    name = "simulation"
    whiten = False

    def __init__(self, engine: Engine, data: list[Data], groups: list[list[int]] | None = None) -> None:
        self.engine, self.data = engine, data
        self.groups = groups or output_groups(data)
        self.initial = InitialStates(engine, data)
        self._known = [[_known(d, group) for d in data] for group in self.groups]
        self._memory: dict[tuple[int, bytes], Array] = {}

    def retune(self, theta: Array) -> None:
        """Nothing to update."""

    def nuisance(self) -> tuple[Array, Array, Array, Array]:
        """Initial states, unbounded."""
        values = self.initial.values
        unbounded = np.full(len(values), np.inf)
        return values, -unbounded, unbounded, self.initial.scale

    def keep(self, nuisance: Array) -> None:
        """Set the initial states."""
        self.initial.values = nuisance.copy()

    def simulated(self, theta: Array, nuisance: Array, record: int) -> Array:
        """Free-run output of one record, shape (n, p)."""
        # Cached: a difference step in one record's initial state does not change the others.
        key = (record, theta.tobytes() + self.initial.part(nuisance, record).tobytes())
        if key not in self._memory:
            if len(self._memory) > 4 * len(self.data):
                self._memory.clear()
            d = self.data[record]
            state = self.initial.state(nuisance, record, theta)
            self._memory[key] = self.engine.simulate(
                theta, d.input_time, d.input, d.time, initial_state=state, conditions=d.conditions
            )
        return self._memory[key]

    def slopes(self, theta: Array, nuisance: Array, change: Array) -> Errors | None:
        """Derivatives of the errors by parameters and nuisance parameters, by sensitivity equations.

        `theta` (k,).
        `nuisance` (q,).
        `change` (k,): small changes of the parameters within their bounds.
        Returns shape (k + q, samples, outputs): by group and record; NaN where the equations do not apply. None where
        they never apply.
        """
        k, width = len(theta), self.initial.width
        found: Errors = [[] for _ in self.groups]
        for r, d in enumerate(self.data):
            state = self.initial.state(nuisance, r, theta)
            run = self.engine.slopes(theta, change, d.input_time, d.input, d.time, state, d.conditions)
            if run is None:
                return None
            for place, (group, known) in enumerate(zip(self.groups, self._known, strict=True)):
                part = run if known[r] is None else run[:, known[r]][:, :, group]
                slopes = np.zeros((k + len(nuisance), *part.shape[1:]))
                slopes[:k] = -part[:k]
                slopes[k + r * width : k + (r + 1) * width] = -part[k:]
                found[place].append(slopes)
        return found

    def errors(self, theta: Array, nuisance: Array) -> Errors:
        """Output errors by group and record."""
        full = [d.output - self.simulated(theta, nuisance, r) for r, d in enumerate(self.data)]
        return [
            [e if k is None else np.ascontiguousarray(e[k][:, group]) for e, k in zip(full, known, strict=True)]
            for group, known in zip(self.groups, self._known, strict=True)
        ]


def _known(data: Data, group: list[int]) -> Mask | None:
    """Rows with measurements of these outputs; None for all rows and outputs."""
    known = np.all(np.isfinite(data.output[:, group]), axis=1)
    return None if np.all(known) and group == list(range(data.output.shape[1])) else known
