"""One contestant in a process of its own: imports, warms up, then works against the clock.

    python worker.py MODULE DATA.npz SETTINGS.json ANSWER.npz

MODULE is a file of work/ with a function ``work(data, settings)`` that returns what is timed: a function without
arguments that returns its answer as named arrays. Neither imports nor compilation are timed: before the clock starts,
the work is done once on ``data`` cut short by ``shorter(data)``, where the module has one, and else in full.
Runs by any interpreter: nothing of idloop and only NumPy is imported here.
"""

from __future__ import annotations

import contextlib
import cProfile
import importlib.util
import io
import json
import os
import pstats
import resource
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

PROFILED = 40  # functions that a profile lists


def _status(key: str) -> float:
    """A number of /proc/self/status [MB]."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith(key + ":"):
            return float(line.split()[1]) / 1024.0
    return float("nan")


def _forget_peak() -> None:
    with contextlib.suppress(OSError):  # where this is refused the peak counts what came before: an upper bound
        Path("/proc/self/clear_refs").write_text("5")


def load(path: str) -> Any:
    """Module of a contestant."""
    spec = importlib.util.spec_from_file_location("contestant", path)
    if spec is None or spec.loader is None:
        raise ImportError(path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def profile(act: Callable[[], Any]) -> str:
    """Where the time of one more run goes, function by function, the ones that take most first."""
    recorder, text = cProfile.Profile(), io.StringIO()
    recorder.runcall(act)
    for order in ("tottime", "cumulative"):
        pstats.Stats(recorder, stream=text).sort_stats(order).print_stats(PROFILED)
    return text.getvalue()


def main() -> int:
    """Do it."""
    module_path, data_path, settings_path, answer_path = sys.argv[1:]
    settings = json.loads(Path(settings_path).read_text())
    if "memory_limit" in settings:
        limit = int(settings["memory_limit"] * 1e9)
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    sys.path.insert(0, str(Path(module_path).parent))
    report: dict[str, Any] = {}
    try:
        module = load(module_path)
        with np.load(data_path) as file:
            data = {key: file[key] for key in file.files}
        if settings.get("warm", True):
            warm = module.shorter(data) if hasattr(module, "shorter") else data
            module.work(warm, settings)()
        act = module.work(data, settings)
        times: list[float] = []
        busy: list[float] = []
        answer: dict[str, Any] = {}
        _forget_peak()
        before = _status("VmRSS")
        spent = 0.0
        while len(times) < settings["runs"] and (not times or spent < settings.get("patience", 60.0)):
            begin, used = time.perf_counter(), time.process_time()
            answer = act()
            times.append(time.perf_counter() - begin)
            busy.append(time.process_time() - used)
            spent += times[-1]
        report = {"times": times, "busy": busy, "memory": max(_status("VmHWM") - before, 0.0)}
        if settings.get("profile"):
            report["profile"] = profile(act)
        np.savez(answer_path, **{key: np.asarray(value) for key, value in answer.items()})
    except ImportError as error:
        report = {"missing": str(error.name or error)}
    except MemoryError as error:
        report = {"failed": f"out of memory: {str(error).splitlines()[0] if str(error) else 'more than there is'}"}
    print("\n" + json.dumps(report))
    return 0


if __name__ == "__main__":
    sys.exit(main())
