"""What all parts of the estimator share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from idloop.records.bags.cdr import SECOND

if TYPE_CHECKING:
    from idloop_nodes.codec import Status
    from idloop_nodes.estimation.job_queue import JobQueue
    from idloop_nodes.streams.sample_buffer import SampleBuffer

SHORTEST = 20  # samples below which a stretch of data is neither fitted nor judged


class Values(Protocol):
    """Parameters of the node by name."""

    def __getitem__(self, name: str) -> Any:
        """Return a value."""


@dataclass
class EstimatorContext:
    """Log, parameters, samples, worker and results of one estimator."""

    name: str  # name of the node
    # Take one line for the log
    info: Callable[[str], object]
    warn: Callable[[str], object]
    error: Callable[[str], object]
    parameters: Values
    buffer: SampleBuffer
    jobs: JobQueue
    publish: Callable[[str, int, Sequence[Status]], None]  # publishes a result: name of its topic, stamp [ns], content

    @property
    def period_ns(self) -> int:
        """Sample time [ns]."""
        return self.nanoseconds("sample_time")

    @property
    def lockstep(self) -> bool:
        """Whether time is simulated and waits for the nodes."""
        return bool(self.parameters["mode"] == "lockstep")

    def nanoseconds(self, parameter: str) -> int:
        """Return a parameter in seconds as nanoseconds."""
        return round(float(self.parameters[parameter]) * SECOND)
