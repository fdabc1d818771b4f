"""A watch for wear: whether a parameter of a fitted model grows."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

from idloop.api.result import Progress, Result, as_records, ignore_progress
from idloop.reporting.text.blocks import Block
from idloop.reporting.text.monitoring import alarm_rows, monitoring_blocks

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from idloop.monitoring import Baseline, Trace, WatchState
    from idloop.physics import Model
    from idloop.records import Record


class Monitor(Result):
    """A watch on parameters of a fitted model, with a stated rate of false alarms.

    Parameters
    ----------
    baseline : idloop.monitoring.Baseline
        What is normal, and the thresholds that follow; `Monitor.learn` makes one.

    Examples
    --------
    >>> import idloop
    >>> model = idloop.load_model("axis").with_effect("coulomb_friction", "axis", level=0.1)
    >>> signal = idloop.excitation("multisine", sample_time=0.002, duration=60.0)
    >>> healthy = idloop.simulate(model, signal)
    >>> watch = idloop.Monitor.learn(model, healthy, ["coulomb_friction@axis"])
    >>> worn = model.with_values({"coulomb_friction@axis.level": 0.2})
    >>> _ = watch.follow(idloop.simulate(worn, signal, seed=1))
    >>> [state.state for state in watch.states()]
    ['alarm']
    """

    def __init__(self, baseline: Baseline) -> None:
        from idloop.monitoring import Monitor as Sums

        self.baseline = baseline
        self.records: list[Record] = []
        self.traces: list[Trace] = []
        self._sums = Sums(baseline)

    @classmethod
    def learn(
        cls,
        model: Model,
        healthy: Record | Iterable[Record],
        watches: Sequence[str] = (),
        *,
        vary: Sequence[str] = (),
        false_alarms: str = "per 1000 h",
        block: float = 2.0,
        progress: Progress = ignore_progress,
    ) -> Monitor:
        """Learn what is normal from records of the healthy machine.

        Parameters
        ----------
        model : Model
            Fitted to the healthy machine.
        healthy : Record or iterable of Record
        watches : sequence of str
            What is watched: an effect, a parameter, or a parameter with its growth (``motor.inertia+10%``); every
            effect that can wear when empty.
        vary : sequence of str
            Parameters that may change without being wear, beside viscous friction.
        false_alarms : str
            One false alarm of all that is watched in so much time of running.
        block : float
            Length of the blocks that are judged [s].
        progress : callable, optional
            Called with the share done in [0, 1] and a short text.

        Raises
        ------
        InputError
            Nothing that could be watched, or records that do not suit the model.
        """
        from idloop import monitoring

        return cls(
            monitoring.learn(
                model, as_records(healthy), monitoring.choose_watches(model, watches), varying=vary,
                false_alarm_hours=monitoring.parse_false_alarms(false_alarms), block=block, progress=progress,
            )
        )  # fmt: skip

    def follow(self, record: Record) -> Trace:
        """Take in the next record, and return what it made of the sums.

        Raises
        ------
        InputError
            The record does not suit the model or the reference.
        """
        self._sums.begin()
        self.records.append(record)
        self.traces.append(self._sums.follow(record))
        return self.traces[-1]

    def states(self) -> list[WatchState]:
        """State of each watch: "alarm", "quiet" or "cannot_tell", with growth and delay."""
        return self._sums.states()

    @property
    def alarms(self) -> list[dict[str, Any]]:
        """Every alarm: record, parameter, time and onset on the record's clock [s], growth with its interval."""
        return alarm_rows(self.baseline, self.records, self.traces)

    def blocks(self) -> Iterator[Block]:
        """Yield what is promised, the state of every watch, and the alarms."""
        return monitoring_blocks(self.baseline, self.states(), self.records, self.traces)

    def plot(self) -> Figure:
        """Draw each sum against its threshold, and the growth that the data show."""
        from idloop.reporting.plots.wear import plot_wear

        return plot_wear(self.baseline, self.records, self.traces)

    def to_dict(self) -> dict[str, Any]:
        """Return the document of schema ``idloop/monitor/1``."""
        watches = []
        for state, normal in zip(self.states(), self.baseline.normal, strict=True):
            fields = dict(vars(state))
            del fields["alarms"]
            reference = {
                "offset": normal.offset,
                "stderr": normal.offset_stderr,
                "spread": normal.variance_ratio,
                "echo": normal.sensitivity,
            }
            watches.append({**fields, "reference": reference})
        return {
            "schema": "idloop/monitor/1",
            "model": self.baseline.model.name,
            "false_alarm_hours": self.baseline.false_alarm_hours,
            "block": self.baseline.block,
            "reference_duration": self.baseline.duration,
            "may_vary": self.baseline.varying,
            "watches": watches,
            "alarms": self.alarms,
        }
