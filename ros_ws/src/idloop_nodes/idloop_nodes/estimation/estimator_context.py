"""What all parts of the estimator share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from idloop.records.bags.cdr import SECOND
from idloop_nodes.streams.sample_buffer import SampleBuffer

if TYPE_CHECKING:
    from idloop_nodes.estimation.job_queue import Job

SHORTEST = 20  # samples below which a stretch of data is neither fitted nor judged

Publish = Callable[[bytes], None]
Log = Callable[[str], object]


class Values(Protocol):
    """Parameters of the node by name."""

    def __getitem__(self, name: str) -> Any:
        """Return a value."""


class Jobs(Protocol):
    """Where jobs go."""

    @property
    def busy(self) -> bool:
        """Whether a job runs or waits."""

    def submit(self, job: Job) -> None:
        """Take in a job."""


@dataclass
class EstimatorContext:
    """Name, log, parameters, samples and worker of one estimator."""

    name: str  # name of the node
    # Take one line for the log
    info: Log
    warn: Log
    error: Log
    parameters: Values
    buffer: SampleBuffer
    jobs: Jobs
    submitted: int = 0  # number of the newest job

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

    def next_number(self) -> int:
        """Return the number of the next job."""
        self.submitted += 1
        return self.submitted
