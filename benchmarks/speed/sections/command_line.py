"""The command line as a user waits for it, and the reading of bags."""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from speed.contest import Contest, filled
from speed.motor import PERIOD, TRUTH, experiment, motor
from speed.progress import say
from speed.result import Claim, Row, Section

COMPARING = "half is the start of Python, NumPy, numba and its compiled code, a fifth the observer, a sixth the bag"
COMMAND = [str(Path(sys.executable).with_name("idloop"))]
HELP, COMPARE, READING = "idloop --help", "idloop compare, bag of {:g} s", "reading a bag of {:g} s at 1 kHz"


def run(contest: Contest) -> Section:
    """Times of whole processes, and of reading alone."""
    from idloop.records import Record, write_bag

    seconds = 10.0 if contest.quick else 60.0
    section = Section("command_line", "Command line and bags")
    data = experiment(seconds)
    stamps = np.arange(len(data["command"])) * PERIOD
    model = motor(TRUTH)
    units = tuple(output.unit for output in model.outputs)
    record = Record(
        "motor", stamps, data["command"], stamps, data["output"], model.input.name, "V", model.output_names, units
    )
    compare, reading = COMPARE.format(seconds), READING.format(seconds)
    with tempfile.TemporaryDirectory() as place:
        bag = write_bag(Path(place) / "bag", record)
        model.save(Path(place) / "motor.yaml")
        verbs = ((HELP, ["--help"]), (compare, ["compare", str(Path(place) / "motor.yaml"), str(bag)]))
        for work, arguments in verbs:
            section.rows.append(whole_process(contest, work, [*COMMAND, *arguments], 9))
        settings = {"bag": str(bag)}
        none = {"nothing": np.zeros(1)}
        own, ours = contest.enter(reading, "idloop", "reading_idloop", none, settings, ours=True, runs=9)
        other, theirs = contest.enter(
            reading, "rosbags AnyReader", "reading_rosbags", none, settings, ours=True, runs=3
        )
        own.agrees = other.agrees = ours.keys() == theirs.keys() and all(
            np.array_equal(ours[key], theirs[key], equal_nan=True) for key in ours
        )
        own.answer["messages"] = other.answer["messages"] = float(sum(len(v) for k, v in ours.items() if "stamp" in k))
        section.rows += [own, other]
    helps, compares = section.find(HELP, "idloop"), section.find(compare, "idloop")
    section.claims = [
        Claim(HELP, 0.3, helps.seconds if helps else None, "s", at_least=False),
        Claim(compare, 2.0, compares.seconds if compares else None, "s", at_least=False, limit=COMPARING),
        Claim("time of message-by-message reading over ours", 5.0, section.ratio(reading, "rosbags AnyReader")),
    ]
    section.remarks.append(
        "Whole processes from start to exit, files in the cache; arrays of the two readers are identical."
    )
    return section


def whole_process(contest: Contest, work: str, command: list[str], runs: int) -> Row:
    """Median time of a process; one run before is not counted."""
    say(f"{work}")
    row, times, busy = Row(work, "idloop"), [], []
    for _ in range(contest.runs(runs) + 1):
        begin, used = time.perf_counter(), _used()
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        times.append(time.perf_counter() - begin)
        busy.append(_used() - used)
        if done.returncode:
            row.note = (done.stderr.strip().splitlines() or ["failed"])[-1]
            return row
    return filled(row, {"times": times[1:], "busy": busy[1:], "memory": None}, processor=contest.processor)


def _used() -> float:
    """Processor time of all processes that were waited for [s]."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime
