"""The rows of the papers over seeds, and that the papers' machines move as those of this suite's simulators do."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from paper_records import plain_numbers, simulated_by
from paper_rows import jobs, parsed

from papers import ROWS
from papers.hidden_effects import coloured_torque
from papers.motor import drifting_fits
from papers.torsion import torsion_effects
from papers.torsion.torsion_effects import ALL, CASES, reference, torsion


def test_what_is_no_number_becomes_none_in_the_document():
    assert json.loads(json.dumps(plain_numbers({"a": [math.nan, 1.0], "b": np.float64(2.0)}))) == {
        "a": [None, 1.0],
        "b": 2.0,
    }


def test_every_row_runs_with_every_seed():
    todo = jobs(parsed(["--seeds", "1", "2", "--disturbance", "1"]))
    assert [row for row, _ in todo] == ["A6"] * 4 + ["B2"] * 2 * len(CASES) + ["B9"] * 2


def test_the_command_line_knows_the_parts_of_the_rows():
    assert ROWS["A6"].parts == tuple(drifting_fits.FRICTION)
    assert ROWS["B2"].parts == tuple(CASES)


@pytest.mark.parametrize("friction", drifting_fits.FRICTION.values())
def test_two_solutions_of_the_motor_agree(friction):
    motor, recording = drifting_fits.true_motor(friction), drifting_fits.square(0.30)
    one, other = (run(motor, recording, 3) for run in (drifting_fits.simulated, simulated_by("equations")))
    # The suite's simulator stops a body at the end of a step, so stops differ by that step.
    assert np.max(np.abs(one.output - other.output)) < (1e-5 if friction == 0.0 else 2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("names", [(), ("offset",), ("friction",), ("imbalance",), ("slip",), ("saturation",), ALL])
def test_two_solutions_of_the_torsion_system_agree(names):
    machine, quiet = torsion(names), reference("steps", 1.0, 5)
    recording = replace(
        quiet, signal=quiet.signal[:2000], speed=None, torque=coloured_torque(1e-3, len(quiet.signal), 4)[:2000]
    )
    one, other = (run(machine, recording, 3) for run in (torsion_effects.simulated, simulated_by("equations")))
    # What sticks or slips does so at the end of a step; the rest is far below the encoders' noise of 2e-4 rad.
    rough = bool({"friction", "slip"} & set(names))
    assert np.max(np.abs(one.output - other.output)) < (3e-4 if rough else 2e-6)
    assert np.max(np.abs(one.input)) > 1.0
