"""Is a dominant effect of a realistic machine worth anything? An answer without the diagnosis.

The diagnosis and idloop's physics have no part in it. From the true state at many instants, models without the small
things run freely for a short while under the recorded command: one with all the dominant effects, and one without
the effect in question, both with inertias, viscous friction and coupling fitted anew. The effect is worth the share
of the error of the displacement that it takes away; what the encoders round away counts as error of both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from by_drive import DAMPING, GAP, STIFFNESS, DriveMachine, run_from, tables
from case import Case
from drives import READING
from experiment import sent, simulated, true_model
from machines import MACHINES
from nuisances import Nuisances
from numpy.typing import NDArray
from plain import Plain, plain

Array = NDArray[np.float64]

# Runs per record, and their length as a share of the machine's own time and in samples at least.
RUNS, REACH, FEWEST = 30, 0.3, 6
# Steps of a run [s]; two of the simulator's.
STEP = 4e-5
# An effect that takes away less of the error is too small to ask for.
WORTH = 0.1


@dataclass(frozen=True)
class Motion:
    """True motion of one recording: ticks, commands, states at the ticks."""

    ticks: Array
    commands: Array
    states: Array
    length: int
    starts: Array


def motions(case: Case, suite: int) -> list[Motion]:
    """The training recordings as they really were."""
    truth, found = true_model(case), []
    for i, drive in enumerate(case.training):
        what = f"training{i}"
        record, built, taken = simulated(case, truth, *sent(case, drive, suite, what), suite, what)
        if not isinstance(built, DriveMachine):
            raise TypeError(f"{case.id}: is no realistic case")
        length = max(round(REACH * MACHINES[case.machine].tempo * case.rate), FEWEST)
        count = len(record.input)
        starts = np.unique(np.linspace(0.02 * count, count - length - 1, RUNS).astype(int))
        found.append(Motion(taken, np.asarray(record.input), built.states, length, starts))
    return found


class Runs:
    """Free runs of one structure against the true motion.

    Parameters
    ----------
    structure : Plain
    truth : Plain
        For the gap that the true state lies in.
    nuisances : Nuisances
        Those of the machine; the runs have the reach of its friction only.
    motions : sequence of Motion
    """

    def __init__(self, structure: Plain, truth: Plain, nuisances: Nuisances, motions: Sequence[Motion]) -> None:
        self._structure, self._motions, self._plain_friction = structure, motions, nuisances.left_out()
        self._floor = [np.sqrt(2.0) * READING * count for count in nuisances.counts]
        self._coupling = tables(truth, None)[2]

    @property
    def start(self) -> Array:
        """What is fitted, at its true values: inertia and viscous friction of the bodies, then the coupling."""
        own = self._structure
        return np.array([*own.inertia, *own.viscous, *own.stiffness, *own.damping])

    def errors(self, factors: Array) -> Array:
        """Errors of the displacements, those of all bodies with an encoder, in deviations of its reading."""
        n, values = len(self._structure.inertia), self.start * factors
        own = replace(
            self._structure,
            inertia=values[:n].tolist(),
            viscous=values[n : 2 * n].tolist(),
            stiffness=values[2 * n : 3 * n - 1].tolist(),
            damping=values[3 * n - 1 :].tolist(),
        )
        rows = tables(own, self._plain_friction)
        found = []
        for motion in self._motions:
            for first in motion.starts:
                begin, end = motion.states[first], motion.states[first + motion.length]
                state = self._begun(begin, rows)
                shown = run_from(rows, motion.ticks, motion.commands, int(first), motion.length, state, STEP)
                for body, floor in enumerate(self._floor[:n]):
                    if floor > 0.0:
                        missed = (shown[body] - state[body]) - (end[body] - begin[body])
                        found.append(missed / floor)
        return np.asarray(np.nan_to_num(np.array(found), nan=1e9, posinf=1e9, neginf=-1e9))

    def _begun(self, begin: Array, rows: tuple[Array, Array, Array]) -> Array:
        """The true state; a coupling without its gap is twisted by the torque that it carried."""
        state = begin.copy()
        gap, own = float(self._coupling[GAP]), rows[2]
        if gap > 0.0 and own[GAP] == 0.0:
            twist = begin[0] - begin[1]
            beyond = np.sign(twist) * max(abs(twist) - 0.5 * gap, 0.0)
            state[1] = state[0] - beyond * self._coupling[STIFFNESS] / own[STIFFNESS]
            state[3] = state[2] if beyond == 0.0 and own[DAMPING] > 0.0 else state[3]
        return state

    def fitted(self) -> float:
        """Root mean square error at the best, rounding included."""
        from scipy.optimize import least_squares

        best = least_squares(self.errors, np.ones(len(self.start)), bounds=(0.05, 20.0), diff_step=1e-3, max_nfev=8)
        return float(np.sqrt(np.mean(best.fun**2) + 1.0))


def worth(case: Case, suite: int = 1) -> dict[str, float]:
    """Share of the error that each dominant effect takes away.

    Parameters
    ----------
    case : Case
        A realistic one.
    suite : int
    """
    model, runs = true_model(case), motions(case, suite)
    full = plain(model)
    if case.nuisances is None:
        raise TypeError(f"{case.id}: is no realistic case")
    with_all = Runs(full, full, case.nuisances, runs).fitted()
    found = {}
    for name in case.truth:
        without = plain(model.without_effect(name))
        found[name] = round(1.0 - with_all / Runs(without, full, case.nuisances, runs).fitted(), 3)
    return found
