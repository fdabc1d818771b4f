"""Runs contestants in processes of their own and makes rows of what they report."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from numpy.typing import NDArray
from speed.progress import say
from speed.result import Row

Array = NDArray[np.float64]
WORK = Path(__file__).with_name("work")
WORKER = Path(__file__).with_name("worker.py")


@dataclass(frozen=True)
class Contest:
    """How this run measures.

    Attributes
    ----------
    peers : Path or None
        Interpreter of the peers' environment.
    quick : bool
        Smaller work and fewer runs: to see that all of it works.
    long : bool
        Scaling up to 10^7 samples.
    live_seconds : float
        Length of the live run [s].
    processor : bool
        Whether processor time counts instead of the time that passes.
    profiles : Path or None
        Folder for profiles of our own work; None for none.
    """

    peers: Path | None
    quick: bool = False
    long: bool = False
    live_seconds: float = 30.0
    processor: bool = False
    profiles: Path | None = None

    def runs(self, usual: int) -> int:
        """Runs behind a median."""
        return min(usual, 2) if self.quick else usual

    def enter(
        self,
        work: str,
        who: str,
        module: str,
        data: Mapping[str, Array],
        settings: Mapping[str, Any] | None = None,
        *,
        ours: bool = False,
        runs: int = 5,
        timeout: float = 900.0,
    ) -> tuple[Row, dict[str, Array]]:
        """Let a contestant do a piece of work.

        Parameters
        ----------
        work, who : str
            Names for the table.
        module : str
            File of work/, without its ending.
        data : mapping of arrays
        settings : mapping, optional
        ours : bool
            Run by idloop's interpreter.
        runs : int
            Runs behind the median.
        timeout : float
            Seconds after which it is given up.

        Returns
        -------
        Row, dict of arrays
            The answer is empty where the row's note says why.
        """
        python = Path(sys.executable) if ours else self.peers
        row = Row(work, who)
        if python is None:
            row.note = "not installed: no environment for the peers"
            return row, {}
        say(f"{work}: {who}")
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place)
            np.savez(folder / "data.npz", **dict(data))
            ask = {"runs": self.runs(runs), "profile": who == "idloop" and self.profiles is not None}
            (folder / "settings.json").write_text(json.dumps(ask | dict(settings or {})))
            files = [str(folder / name) for name in ("data.npz", "settings.json", "answer.npz")]
            report = run_worker([str(python), str(WORKER), str(WORK / f"{module}.py"), *files], timeout)
            answer: dict[str, Array] = {}
            if "times" in report:
                with np.load(folder / "answer.npz") as file:
                    answer = {key: file[key] for key in file.files}
        if "profile" in report and self.profiles is not None:
            self.profiles.mkdir(parents=True, exist_ok=True)
            (self.profiles / f"{re.sub('[^a-z0-9]+', '_', work.lower())}.txt").write_text(report["profile"])
        return filled(row, report, processor=self.processor), answer


def run_worker(command: list[str], timeout: float) -> dict[str, Any]:
    """Report of a process: the last line that it prints; a failure is a report as well."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=timeout)
    except subprocess.TimeoutExpired:
        return {"failed": f"given up after {timeout:g} s"}
    lines = done.stdout.strip().splitlines()
    if done.returncode or not lines:
        said = (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]
        return {"failed": "killed: out of memory" if done.returncode == -9 else said[:200]}
    return dict(json.loads(lines[-1]))


def filled(row: Row, report: Mapping[str, Any], *, processor: bool = False) -> Row:
    """Row with what a process reported."""
    if "missing" in report:
        row.note = f"not installed: {report['missing']}"
    elif "failed" in report:
        row.note = str(report["failed"])
    else:
        row.passed, row.processor = median(report["times"]), median(report["busy"])
        row.seconds = row.processor if processor else row.passed
        row.runs, row.memory = len(report["times"]), report["memory"]
    if row.note:
        say(f"  {row.note}")
    elif row.seconds is not None:
        say(f"  {row.seconds:.4g} s")
    return row


def octave() -> str | None:
    """GNU Octave with its control package, where both are installed."""
    program = shutil.which("octave-cli")
    if program is None:
        return None
    check = subprocess.run([program, "-q", "--eval", "pkg load control"], capture_output=True, check=False)
    return program if check.returncode == 0 else None
