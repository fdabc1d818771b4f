"""What the verbs do with data that nobody should measure: gaps of years, a million uneven samples, absurd numbers.

Every verb runs as a process of its own with a limit on time and memory. A finding is an exit code other than 0, 1 or 2,
a failure with anything but one line on stderr, no answer in time, or too much memory.

    .venv/bin/python benchmarks/ugly_data.py
    .venv/bin/python benchmarks/ugly_data.py --only "a gap" --verbs diagnose
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from idloop.physics import load_model
from idloop.records import Record, write_bag

Floats = NDArray[np.float64]
MODEL = "dc_motor"
SECONDS, MEMORY = 240, 6 << 30
STEP = 0.002
YEAR = 365.25 * 86_400.0
VERBS = {
    "inspect": ["inspect", "{bag}"],
    "fit": ["fit", MODEL, "{bag}"],
    "compare": ["compare", MODEL, "{bag}"],
    "diagnose": ["diagnose", MODEL, "{bag}"],
    "identify": ["identify", "{bag}", "--model", MODEL, "--method", "arx", "--method", "n4sid"],
}


def motor(command: Floats, step: Floats | float = STEP) -> Floats:
    """Position and velocity of a motor with viscous friction, with noise; a step may be as long as it likes."""
    keep = np.exp(-2.3 * np.broadcast_to(step, command.shape))
    velocity = np.zeros(command.size)
    if np.ptp(keep) == 0.0:
        velocity[1:] = lfilter([1.0 - keep[0]], [1.0, -keep[0]], 3.6 * command[:-1])
    else:
        for k in range(1, command.size):
            velocity[k] = keep[k - 1] * velocity[k - 1] + (1.0 - keep[k - 1]) * 3.6 * command[k - 1]
    position = np.cumsum(np.broadcast_to(step, command.shape) * velocity)
    chance = np.random.default_rng(1)
    noise = chance.standard_normal((command.size, 2)) * [0.0332, 0.0728]
    return np.column_stack([position, velocity]) + noise


def levels(count: int) -> Floats:
    """A command that jumps between many levels, every 0.2 s on an even grid."""
    return np.repeat(np.random.default_rng(2).uniform(-1.0, 1.0, count // 100 + 1), 100)[:count]


def record(time_s: Floats, command: Floats, output: Floats) -> Record:
    """A record of the preset's streams."""
    model = load_model(MODEL)
    return Record(
        "ugly", time_s, command, time_s, output, "motor.effort", "V",
        tuple(one.name for one in model.outputs), tuple(one.unit for one in model.outputs), start_ns=10**18,
    )  # fmt: skip


def _even(count: int = 10_000, change: Callable[[Floats, Floats, Floats], None] | None = None) -> Record:
    time_s, command = STEP * np.arange(count), levels(count)
    output = motor(command)
    if change is not None:
        change(time_s, command, output)
    return record(time_s, command, output)


def _gap(seconds: float) -> Record:
    def change(time_s: Floats, command: Floats, output: Floats) -> None:
        time_s[time_s.size // 2 :] += seconds

    return _even(change=change)


def _uneven(count: int) -> Record:
    steps = np.random.default_rng(3).uniform(0.5, 1.5, count) * STEP
    command = levels(count)
    return record(np.concatenate([[0.0], np.cumsum(steps)[:-1]]), command, motor(command, steps))


def _scaled(factor: float, offset: float = 0.0, column: int | None = None) -> Record:
    def change(time_s: Floats, command: Floats, output: Floats) -> None:
        part = output if column is None else output[:, column : column + 1]
        part *= factor
        part += offset

    return _even(change=change)


def _commanded(command: Floats) -> Record:
    return record(STEP * np.arange(command.size), command, motor(command))


DATA: dict[str, Callable[[], Record]] = {
    "as it should be": _even,
    "a gap of a minute": lambda: _gap(60.0),
    "a gap of an hour": lambda: _gap(3600.0),
    "a gap of ten years": lambda: _gap(10 * YEAR),
    "10^6 even samples": lambda: _even(1_000_000),
    "10^6 uneven samples": lambda: _uneven(1_000_000),
    "values of 1e300": lambda: _scaled(1e300),
    "one output of 1e300": lambda: _scaled(1e300, column=1),
    "values of 1e-310": lambda: _scaled(1e-310),
    "an offset of 1e16": lambda: _scaled(1.0, 1e16),
    "an offset of 1e16 in the position": lambda: _scaled(1.0, 1e16, 0),
    "an offset of 1e9 in the position": lambda: _scaled(1.0, 1e9, 0),
    "commands of 1e300": lambda: _even(change=lambda t, command, y: np.multiply(command, 1e300, out=command)),
    "a command that alternates": lambda: _commanded(np.where(np.arange(10_000) % 2, 1.0, -1.0)),
    "one impulse": lambda: _commanded(np.where(np.arange(10_000) == 5_000, 1.0, 0.0)),
    "a constant command": lambda: _commanded(np.full(10_000, 0.5)),
    "outputs that never move": lambda: _scaled(0.0),
    "two samples": lambda: _even(2),
    "one sample": lambda: _even(1),
}


def run(words: list[str]) -> tuple[int | None, list[str], float, float]:
    """Run a verb; return exit code (None: no answer), lines on stderr, seconds, and memory [GB]."""

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))

    begun = time.monotonic()
    with tempfile.TemporaryFile() as said, tempfile.TemporaryFile() as told:
        process = subprocess.Popen(
            [sys.executable, "-m", "idloop", *words], stdout=told, stderr=said, preexec_fn=limit,  # noqa: PLW1509 (no thread here)
            env=os.environ | {"IDLOOP_CACHE": ""},
        )  # fmt: skip
        while True:
            pid, status, usage = os.wait4(process.pid, os.WNOHANG)
            if pid or time.monotonic() - begun > SECONDS:
                break
            time.sleep(0.05)
        code: int | None = os.waitstatus_to_exitcode(status) if pid else None
        if not pid:
            process.kill()
            _, _, usage = os.wait4(process.pid, 0)
        process.returncode = 0
        said.seek(0)
        lines = [line for line in said.read().decode(errors="replace").splitlines() if line.strip()]
    return code, lines, time.monotonic() - begun, usage.ru_maxrss / 1e6


def wrong(code: int | None, lines: list[str]) -> str:
    """What is wrong with an answer, empty when nothing is."""
    if code is None:
        return f"no answer within {SECONDS} s"
    if code not in (0, 1, 2):
        return f"exit code {code}"
    if any("Traceback" in line or "fault in idloop" in line or "Warning" in line for line in lines):
        return "a traceback, a fault or a warning of a library"
    if code and sum(not line.startswith("note:") for line in lines) != 1:
        return f"{len(lines)} lines"
    return ""


def main() -> int:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", help="data whose name begins so")
    parser.add_argument("--verbs", nargs="+", choices=VERBS, default=list(VERBS), help="some verbs")
    arguments = parser.parse_args()
    findings = 0
    print(f"{'data':34} {'verb':9} {'code':>4} {'time':>7} {'memory':>8}")
    with tempfile.TemporaryDirectory(prefix="idloop_ugly_") as name:
        for number, (data, make) in enumerate(DATA.items()):
            if not data.startswith(arguments.only):
                continue
            bag = Path(name) / str(number)
            write_bag(bag, make())
            for verb in arguments.verbs:
                code, lines, seconds, memory = run([word.format(bag=bag) for word in VERBS[verb]])
                finding = wrong(code, lines)
                findings += bool(finding)
                last = lines[-1][:150].replace(str(bag), "BAG") if lines and code else ""
                print(
                    f"{data:34} {verb:9} {code if code is not None else '-':>4} {seconds:5.1f} s {memory:5.2f} GB"
                    f"  {'FINDING: ' + finding + ' | ' if finding else ''}{last}",
                    flush=True,
                )
    print(f"{findings} findings")
    return int(findings > 0)


if __name__ == "__main__":
    sys.exit(main())
