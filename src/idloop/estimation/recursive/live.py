"""Recursive estimation on a running stream: stamped samples of several outputs, some of them missing or late."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from idloop.arrays import Array
from idloop.errors import InputError
from idloop.estimation.recursive.methods import orders_of, recursive_estimator

# Samples: after a longer gap in the stream the signals start again instead of being predicted.
_LONGEST_HOLE = 1000


@dataclass(frozen=True)
class Coefficient:
    """One coefficient of the model of one output."""

    # As "motor.position" and "a1"
    output: str
    name: str
    # Present value and standard error; B's have units, output per command
    value: float
    stderr: float


class LiveRecursion:
    """Every output of a running axis as a polynomial model of its command, sample by sample.

    Parameters
    ----------
    method : str
        A key of `idloop.estimation.recursive.RECURSIVE_METHODS`.
    sample_time : float
        Period of the grid [s].
    order, delay : int
        Degree of the polynomials, and lag of the first effect of a command [samples].
    **options
        Of `RecursivePolynomial`, as forgetting or drift.

    Attributes
    ----------
    late, holes : int
        Samples that came with an old stamp and were left out; holes too long to be predicted through.

    Raises
    ------
    InputError
        Unknown method, or numbers out of range.
    """

    def __init__(
        self,
        method: str,
        output_names: Sequence[str],
        *,
        sample_time: float,
        order: int = 2,
        delay: int = 1,
        input_name: str = "input",
        **options: Any,
    ) -> None:
        if not sample_time > 0.0:
            raise InputError(f"sample time {sample_time:g} s; it must be positive")
        orders = orders_of(method, order, delay)
        self.method, self.sample_time, self.output_names = method, float(sample_time), tuple(output_names)
        self.estimators = tuple(
            recursive_estimator(
                method, orders, sample_time=sample_time, input_names=(input_name,), output_name=name, **options
            )
            for name in output_names
        )
        self.late = self.holes = 0
        self._last: float | None = None

    @property
    def coefficients(self) -> tuple[Coefficient, ...]:
        """Present coefficients of all outputs."""
        return tuple(
            Coefficient(one.output_name, name, float(value), float(stderr))
            for one in self.estimators
            for name, value, stderr in zip(one.names, one.coefficients, one.stderr, strict=True)
        )

    @property
    def innovation_std(self) -> dict[str, float]:
        """Standard deviation of the innovations by output [output unit]."""
        return {one.output_name: float(np.sqrt(one.innovation_variance)) for one in self.estimators}

    @property
    def samples(self) -> dict[str, int]:
        """Measurements used, by output."""
        return {one.output_name: one.samples for one in self.estimators}

    def update_block(self, time: ArrayLike, command: ArrayLike, measured: ArrayLike) -> Array:
        """Take some samples.

        A sample that is missing on the grid, and a measurement that is not finite, is predicted and updates nothing; a
        command that is not finite is the one before.

        Parameters
        ----------
        time : array, shape (n,)
            Stamps [s].
        command : array, shape (n,)
            In force at each stamp.
        measured : array, shape (n, p)

        Returns
        -------
        ndarray, shape (n, p)
            Innovations [output units]; NaN where nothing was measured and at late samples.

        Raises
        ------
        InputError
            Shapes that do not belong together.
        """
        stamps, inputs, outputs = (np.asarray(one, dtype=float) for one in (time, command, measured))
        if stamps.ndim != 1 or inputs.shape != stamps.shape or outputs.shape != (len(stamps), len(self.estimators)):
            raise InputError(
                f"time, command and measurement of shapes {stamps.shape}, {inputs.shape} and {outputs.shape};"
                f" give (n,), (n,) and (n, {len(self.estimators)})"
            )
        innovations = np.full(outputs.shape, np.nan)
        for first, last, missing in self._stretches(stamps):
            part = slice(first, last)
            if missing is None:
                for one in self.estimators:
                    one.forget_signals()
            count = missing or 0
            gap = np.full(count, np.nan)
            u = np.concatenate([gap, np.where(np.isfinite(inputs[part]), inputs[part], np.nan)])
            for column, one in enumerate(self.estimators):
                y = np.concatenate([gap, np.where(np.isfinite(outputs[part, column]), outputs[part, column], np.nan)])
                innovations[part, column] = one.update_block(u, y)[count:]
        return innovations

    def _stretches(self, stamps: Array) -> list[tuple[int, int, int | None]]:
        """Rows that follow on the grid without a break, and how many are missing before; None after a long hole."""
        found: list[tuple[int, int, int | None]] = []
        for row, stamp in enumerate(stamps):
            steps = 1 if self._last is None else round((stamp - self._last) / self.sample_time)
            if steps < 1:
                self.late += 1
                continue
            self._last = float(stamp)
            if steps > _LONGEST_HOLE:
                self.holes += 1
                found.append((row, row + 1, None))
            elif found and steps == 1 and found[-1][1] == row:
                found[-1] = (found[-1][0], row + 1, found[-1][2])
            else:
                found.append((row, row + 1, steps - 1))
        return found
