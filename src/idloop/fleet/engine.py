"""The work on Dask: local worker processes or a cluster, few batches in flight, a lost worker costs a repetition."""

from __future__ import annotations

import contextlib
import gc
import logging
import signal
from collections.abc import Callable, Iterator, Sequence
from multiprocessing import resource_tracker
from typing import Any, TypeVar

from idloop.errors import InputError
from idloop.fleet.libraries import library

T = TypeVar("T")
R = TypeVar("R")

_AHEAD = 2  # batches in flight for each worker: the one that it works on, and one that waits there
_UNCOLLECTED = 3  # items after which a worker gives memory back
_PATIENCE = "30s"  # for an answer of a cluster
_NEVER = "1000 days"
_STARTS = 3  # of a worker that has done nothing yet
_LOOK = "500ms"


class Workers:
    """Processes that do the work, started when there is some, ended with the block.

    `count`: processes on this machine, one for each core where left out; 0: this one. They need no server. `memory`:
    limit of each, as "2GB"; one that exceeds it is replaced by a new one. `cluster`: address of the scheduler of a
    cluster, as "tcp://host:8786", in place of processes here.
    """

    def __init__(self, count: int | None = None, memory: str = "2GB", cluster: str | None = None) -> None:
        self._given, self._memory, self._cluster = count, memory, cluster
        self._open = contextlib.ExitStack()
        self._client: Any = None

    def __enter__(self) -> Workers:  # noqa: PYI034 - Self needs Python 3.11
        return self

    def __exit__(self, *_: object) -> None:
        self._open.close()

    @property
    def client(self) -> Any:
        """Client of Dask; None where the work is done in this process.

        Raises InputError: Dask is not installed, no cluster answers, or the limit of memory is too small for any work.
        """
        if self._client is None and (self._cluster is not None or self._given != 0):
            distributed = library("distributed")
            logging.getLogger("distributed").setLevel(logging.CRITICAL)  # a lost worker is ours to report
            address = self._cluster or self._local()
            try:
                self._client = self._open.enter_context(distributed.Client(address, timeout=_PATIENCE))
            except (OSError, ValueError) as error:
                raise InputError(f"--cluster {self._cluster}: no scheduler of Dask answers there ({error})") from error
            self._load(address)
        return self._client

    def _load(self, cluster: Any) -> None:
        """Let a worker import its libraries; processes here may end at their limit of memory before they can say so."""
        distributed = library("distributed")
        nannies = {} if isinstance(cluster, str) else cluster.workers
        loaded = self._client.submit(load_engine, pure=False)
        started: set[int] = set()
        while len(started) <= _STARTS * len(nannies):
            started |= {one.pid for one in nannies.values()} - {None}
            with contextlib.suppress(distributed.TimeoutError):
                try:
                    loaded.result(timeout=_LOOK)
                    return
                except distributed.scheduler.KilledWorker:
                    break
        text = f"--memory {self._memory}: a worker ends before it has read anything; give more, such as 2GB"
        raise InputError(text)

    def _local(self) -> Any:
        """Processes on this machine."""
        import dask

        # A batch that loses two workers is suspect, and its items are done alone. Nobody looks at the profiles of
        # workers. One that paused near its limit would wait for ever: what it holds are libraries. One that is away
        # for longer than a time limit, as on a busy machine, would not be replaced.
        settings = {
            "distributed.deploy.lost-worker-timeout": _NEVER,
            "distributed.scheduler.allowed-failures": 1, "distributed.worker.profile.enabled": False,
            **{f"distributed.worker.memory.{way}": False for way in ("target", "spill", "pause")},
        }  # fmt: skip
        distributed = library("distributed")
        runner = distributed.utils.LoopRunner(asynchronous=False)
        resource_tracker.ensure_running()  # the thread that starts it gets Ctrl-C again
        with _without_ctrl_c():
            runner.start()  # its thread starts the workers, also those that replace others
        self._open.callback(runner.stop)
        self._open.enter_context(dask.config.set(settings))
        return self._open.enter_context(
            distributed.LocalCluster(
                loop=runner.loop, n_workers=self._given, threads_per_worker=1, processes=True,
                memory_limit=self._memory, host="127.0.0.1", dashboard_address=None, silence_logs=logging.CRITICAL,
                # Also without a dashboard it listens: at a port of its own, as there may be several fleets here.
                scheduler_kwargs={"dashboard_address": "127.0.0.1:0"},
            )
        )  # fmt: skip

    @property
    def count(self) -> int:
        """Workers that there are."""
        return 1 if self.client is None else max(len(self.client.nthreads()), 1)

    def map(
        self, function: Callable[..., R], items: Sequence[T], *shared: Any, size: int, lost: Callable[[T], R]
    ) -> Iterator[tuple[Sequence[T], list[R]]]:
        """Yield batches of items with what a function made of each, as they end.

        `function`: called with an item and the shared arguments, which travel with each batch: what is kept at a worker
        is lost with it. `size`: items in a batch. `lost`: Result of an item under which worker after worker ended. A
        batch that loses its workers is repeated by others, and at the end item by item, each alone.
        """
        waiting = [items[first : first + size] for first in range(0, len(items), size)][::-1]
        client = self.client
        if client is None:
            yield from ((batch, each(function, batch, *shared)) for batch in reversed(waiting))
            return
        distributed = library("distributed")
        flying: dict[Any, Sequence[T]] = {}
        suspects: list[T] = []
        while waiting or flying:
            # No more than the workers need: what is not done waits here, and results do not pile up.
            while waiting and len(flying) < _AHEAD * self.count:
                batch = waiting.pop()
                flying[client.submit(each, function, batch, *shared, pure=False)] = batch
            for future in distributed.wait(list(flying), return_when="FIRST_COMPLETED").done:
                batch = flying.pop(future)
                if isinstance(future.exception(), distributed.scheduler.KilledWorker):
                    suspects += batch
                else:
                    yield batch, future.result()
        # One after another: what waits at a worker that ends is blamed as well.
        for one in suspects:
            future = client.submit(each, function, [one], *shared, pure=False)
            killed = isinstance(future.exception(), distributed.scheduler.KilledWorker)
            yield [one], [lost(one)] if killed else future.result()


@contextlib.contextmanager
def _without_ctrl_c() -> Iterator[None]:
    """Threads that are started here, and the processes that they start, get no Ctrl-C: who uses them ends them."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def load_engine() -> None:
    """Import what a worker needs for any recording."""
    import idloop.estimation  # noqa: F401


def each(function: Callable[..., R], batch: Sequence[T], *shared: Any) -> list[R]:
    """Results of a batch."""
    found = []
    for number, one in enumerate(batch, start=1):
        found.append(function(one, *shared))
        if number % _UNCOLLECTED == 0 or number == len(batch):
            # A fit leaves large arrays in cycles, too few objects for the collector to begin by itself.
            gc.collect()
    return found
