"""How an executable starts, spins and ends, on every rclpy from 7.1 (Jazzy) on."""

from __future__ import annotations

import contextlib
import faulthandler
import gc
import importlib
import os
import signal
import sys
import tempfile
import threading
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any

from idloop_nodes.middleware import StandstillWatch, use_sockets_only
from idloop_nodes.timing import use_scheduling

WRONG_USE, COULD_NOT, DONE = 2, 1, 0
# Of the linear algebra behind NumPy: a second thread only waits actively for matrices as small as ours.
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
END_LIMIT = 10  # seconds, whole, after which a further signal ends a process that has not ended yet
LEAVE = 10.0  # seconds for the middleware to shut down, before the process ends without it
CHECK_PERIOD = 0.05  # seconds between two checks whether the node is to go on: too expensive for every message


def run(kind: str, arguments: list[str] | None = None) -> int:
    """Run one node until a signal that ends a process (Ctrl-C, SIGTERM, a closed terminal, ...), or its own end.

    `kind`: name of the executable; its node comes from ``idloop_nodes.nodes.<kind>.make``. Where that module has a
    function ``prepare``, it is called before ROS starts. `arguments`: command line, the program's name first; default
    sys.argv. Returns: exit code: 0 done, 1 could not, 2 wrong use or bad input.
    """
    for name in ONE_THREAD:
        os.environ.setdefault(name, "1")
    try:
        from idloop import errors
    except ImportError as error:
        return _complain(kind, f"the library idloop cannot be imported ({error}): pip install it next to rclpy")
    try:
        import rclpy
    except ImportError as error:
        return _complain(kind, f"rclpy cannot be imported ({error}): source ROS 2, or pip install ros-rclpy[fastrtps]")
    ensure_log_directory()
    try:
        use_sockets_only()
        forgotten = _spin(kind, sys.argv if arguments is None else arguments)
    except errors.InputError as error:
        return _complain(kind, str(error))
    except errors.IdloopError as error:
        return _complain(kind, str(error), COULD_NOT)
    except Exception as error:  # noqa: BLE001  (whatever went wrong, users get one line)
        if os.environ.get("IDLOOP_DEBUG"):
            traceback.print_exc()
        return _complain(kind, f"{type(error).__name__}: {error}", COULD_NOT)
    finally:
        rclpy.try_shutdown()
        faulthandler.cancel_dump_traceback_later()
        signal.alarm(0)
        # While the interpreter ends it gives a handler of Python's up, and the signal would kill.
        _answer_signals_by(signal.SIG_IGN)
    if forgotten:
        _restart(kind)
    return DONE


def _restart(kind: str) -> None:
    """Become the same program again, as the same process."""
    _complain(kind, "stood still for so long that the other nodes have forgotten it: starts anew")
    _answer_signals_by(signal.SIG_DFL)
    if hasattr(os, "sched_setscheduler"):
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    os.closerange(3, os.sysconf("SC_OPEN_MAX"))  # the middleware's sockets
    os.execv(sys.executable, sys.orig_argv)  # noqa: S606  (the command line that started this process)


def _answer_signals_by(handler: Callable[[int, FrameType | None], None] | signal.Handlers) -> None:
    from idloop.ending_signals import ending_signals

    for number in ending_signals():
        signal.signal(number, handler)


def _complain(kind: str, text: str, code: int = WRONG_USE) -> int:
    with contextlib.suppress(OSError):  # the terminal may be gone
        sys.stderr.write(f"{kind}: {' '.join(text.split())}\n")
    return code


def ensure_log_directory() -> None:
    """Give rclpy a place for its log where neither HOME nor ROS_LOG_DIR leads to a writable one."""
    if os.environ.get("ROS_LOG_DIR") or os.environ.get("ROS_HOME"):
        return
    home = os.environ.get("HOME")
    if not home or not os.access(home, os.W_OK):
        folder = Path(tempfile.gettempdir()) / f"idloop_ros_log_{os.getuid()}"
        os.environ["ROS_LOG_DIR"] = str(folder)


def parent_watch() -> Callable[[], bool]:
    """Return a test for the end of the process that started this one, where that one asked for it."""
    if os.environ.get("IDLOOP_RUNNER") != str(os.getppid()):
        return lambda: False
    runner = os.getppid()
    return lambda: os.getppid() != runner


def make_executor() -> Any:
    """Return the events executor where rclpy has it: a third of the processor time of the other one."""
    try:
        from rclpy.experimental.events_executor import EventsExecutor
    except ImportError:
        from rclpy.executors import SingleThreadedExecutor

        return SingleThreadedExecutor()
    return EventsExecutor()


def _spin(kind: str, arguments: list[str]) -> bool:
    """Run the node to its end; return whether it has to be started again."""
    import rclpy
    from rclpy.exceptions import ParameterException
    from rclpy.signals import SignalHandlerOptions

    from idloop.errors import InputError

    stop = threading.Event()

    def on_signal(number: int, frame: FrameType | None) -> None:
        # A handler of Python's can be interrupted by its own signal, time and again: what comes next goes nowhere.
        _answer_signals_by(signal.SIG_IGN)
        stop.set()
        signal.alarm(END_LIMIT)

    # rclpy's own handlers end the context at once; a controller must still publish its zero command. They stay to the
    # very end of the process: one Ctrl-C comes from the terminal and once more from `ros2 launch`.
    _answer_signals_by(on_signal)
    signal.signal(signal.SIGALRM, lambda number, frame: _answer_signals_by(signal.SIG_DFL))
    module = importlib.import_module(f"idloop_nodes.nodes.{kind}")
    getattr(module, "prepare", lambda: None)()
    standstill = StandstillWatch(time.monotonic(), time.process_time())
    try:
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    except Exception as error:
        raise InputError(f"{type(error).__name__}: {error}") from error
    node = None
    executor = None
    forgotten = False
    try:
        try:
            node = module.make()
        except ParameterException as error:
            raise InputError(str(error)) from error
        executor = make_executor()
        executor.add_node(node)
        orphaned = parent_watch()
        # What is there now stays: looking through it again and again would hold samples up.
        gc.collect()
        gc.freeze()
        use_scheduling(node.scheduling)
        next_check = 0.0
        while not (stop.is_set() or node.finished or forgotten):
            # `spin` of the events executor in the PyPI wheels calls nothing; `spin_once` does.
            executor.spin_once(timeout_sec=node.poll_period)
            node.poll()
            if node.broken is not None:
                raise node.broken
            now = time.monotonic()
            if now >= next_check:
                next_check = now + CHECK_PERIOD
                if not rclpy.ok() or orphaned():
                    break
                forgotten = standstill.forgotten(now, time.process_time())
    finally:
        if node is not None:
            node.close()
        # All that is ours is done. Fast DDS may wait for itself, with the interpreter locked: no handler would run.
        faulthandler.dump_traceback_later(LEAVE, exit=True, file=os.open(os.devnull, os.O_WRONLY))
        if executor is not None:
            executor.shutdown()
        if node is not None:
            node.destroy_node()
    return forgotten and not stop.is_set()
