"""The contestant that is no Python: SLICOT through GNU Octave's control package."""

from __future__ import annotations

import os
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from speed.contest import WORK, Contest, filled, octave
from speed.progress import say
from speed.result import Row

Array = NDArray[np.float64]
NAME = "SLICOT (Octave control)"


def n4sid_by_slicot(
    contest: Contest, work: str, data: Mapping[str, Array], order: int, horizon: int, runs: int
) -> tuple[Row, dict[str, Array]]:
    """Let SLICOT identify; the same clock and the same measure of memory as for the others."""
    from scipy.io import loadmat, savemat

    row, program = Row(work, NAME), octave()
    if program is None:
        row.note = "not installed: apt install octave octave-control"
        return row, {}
    say(f"{work}: {NAME}")
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        savemat(folder / "data.mat", dict(data))
        numbers = [str(order), str(horizon), str(contest.runs(runs))]
        command = [
            program,
            "-q",
            str(WORK / "n4sid_slicot.m"),
            str(folder / "data.mat"),
            *numbers,
            str(folder / "answer.mat"),
        ]
        single = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
        done = subprocess.run(command, capture_output=True, text=True, check=False, env=single, cwd=folder)
        if not (folder / "answer.mat").exists():
            said = (done.stderr.strip().splitlines() or ["no answer"])[-1]
            return filled(row, {"failed": said[:200]}), {}
        found = loadmat(folder / "answer.mat")
    report = {key: found[key].ravel().tolist() for key in ("times", "busy")} | {"memory": found["memory"].item()}
    return filled(row, report, processor=contest.processor), {key: found[key] for key in "abcd"}
