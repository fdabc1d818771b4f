"""The estimator: predicts every sample, fits a sliding window in a worker, judges it on unseen samples."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from std_srvs.srv import Trigger

from idloop.errors import IdloopError, InputError
from idloop.estimate.recursive import RecursiveEstimator
from idloop.physics import Model, load_model
from idloop.records import Record
from idloop_nodes.base import StreamNode
from idloop_nodes.codec import (
    CdrError,
    FitSummary,
    JointReader,
    Level,
    Status,
    encode_diagnostics,
    fit_to_statuses,
    parameters_to_statuses,
)
from idloop_nodes.fit_jobs import FitAnswer, FitJob, FitWorker
from idloop_nodes.held_stream import HeldStream
from idloop_nodes.joint_layout import OutputPacker, output_columns, output_topic
from idloop_nodes.parameters import Values
from idloop_nodes.progress import DONE
from idloop_nodes.rates import RateCounter
from idloop_nodes.sample_store import SampleStore
from idloop_nodes.tables import ESTIMATOR

SECOND = 1_000_000_000
BLOCK = 500  # samples worked off in one go, so that services stay answered
COMMAND_WAIT = 100  # periods after which a missing command no longer holds a measurement up
SHORTEST = 20  # samples below which a window is not fitted


def update_block_length(sample_time: float) -> int:
    """Return the samples between two updates of the parameters: a fifth of a second, whatever the rate."""
    return min(max(round(0.2 / sample_time), 20), 200)


class EstimatorNode(StreamNode):
    """Pairs measurements with the commands that hold at their stamps and hands both to the library."""

    def __init__(self) -> None:
        super().__init__("estimator", ESTIMATOR)
        values = self.parameters
        self._lockstep = values["mode"] == "lockstep"
        # Work in long bursts costs half the processor time of short ones; lock-step has nobody in a hurry.
        self.poll_period = 0.04 if self._lockstep else 0.01
        self._next_burst = 0.0
        self._period_ns = round(values["sample_time"] * SECOND)
        self._model = self._load(values.values)
        self._recursive = self._make_recursive()
        self._command_reader = JointReader([(self._model.input.joint, self._model.input.field)])
        columns = output_columns(self._model)
        self._output_reader = JointReader(columns)
        self._packer = OutputPacker(columns)
        self._held = HeldStream()
        self._pending: list[tuple[int, tuple[float, ...]]] = []
        self._commands = SampleStore(1)
        self._outputs = SampleStore(len(columns))
        self._command_stream = self.poll_topic(self._model.input.topic)
        self._output_stream = self.poll_topic(output_topic(self._model))
        self.hear_progress()
        self._publish_prediction = self.publisher("estimator/prediction")
        self._publish_residual = self.publisher("estimator/residual")
        self._publish_fit = self.publisher("estimator/fit")
        self._publish_parameters = self.publisher("estimator/parameters")
        self._worker = FitWorker(queue_all=self._lockstep)
        self._jobs = 0
        self._first: int | None = None
        self._last: int | None = None
        self._next_fit: int | None = None
        self._told = -1
        self._done = False
        self._samples = RateCounter()
        self._unreadable = 0
        self._resets = 0
        self._newest_fit: FitSummary | None = None
        self._recursion_failed = ""
        values.check = self._check
        values.apply = self._apply
        self._warm_up(len(columns))
        self.create_service(Trigger, "~/refit", self._on_refit)

    def _warm_up(self, outputs: int) -> None:
        """Compile before the first sample: the loop would wait for it."""
        trial = self._make_recursive()
        if trial is None:
            return
        count = 2 * trial.block + 1
        time = np.arange(count) * self.parameters["sample_time"]
        trial.update_block(time, np.sign(np.sin(time * 50.0)), np.zeros((count, outputs)))

    # parameters

    @staticmethod
    def _load(values: Values) -> Model:
        return load_model(values["model"]).with_effects(values["effects"])

    def _check(self, values: Values) -> None:
        model = self._load(values)
        if output_columns(model) != output_columns(self._model):
            raise InputError("the outputs of another model cannot be taken over by a running estimator")

    def _apply(self, names: set[str]) -> None:
        if names & {"model", "effects"}:
            self._model = self._load(self.parameters.values)
            self._recursive = self._make_recursive()
            self._fit_now()

    def _make_recursive(self) -> RecursiveEstimator | None:
        if not self.parameters["recursive"]:
            return None
        # The nominal step only: every update uses the measured stamps.
        period = self.parameters["sample_time"]
        return RecursiveEstimator(self._model, sample_time=period, block=update_block_length(period))

    # samples

    def poll(self) -> None:
        """Take in what has arrived, predict, fit what is due, publish what the worker has finished."""
        super().poll()
        # An event such as somebody's progress must not cut the burst short.
        now = time.monotonic()
        if now < self._next_burst:
            return
        self._next_burst = now + 0.9 * self.poll_period
        for data, _ in self._command_stream.take():
            self._take_command(data)
        for data, _ in self._output_stream.take():
            self._take_output(data)
        self._predict()
        for answer in self._worker.answers():
            self._publish_answer(answer)
        self._report()

    def _take_command(self, data: bytes) -> None:
        try:
            stamp, row = self._command_reader.read(data)
        except CdrError:
            self._unreadable += 1
            return
        self._held.push(stamp, row)
        self._commands.append(stamp, row)

    def _take_output(self, data: bytes) -> None:
        try:
            stamp, row = self._output_reader.read(data)
        except CdrError:
            self._unreadable += 1
            return
        newest = self._pending[-1][0] if self._pending else self._last
        if newest is not None and stamp <= newest:
            if newest - stamp > SECOND:
                self._restart()
            else:
                return
        self._pending.append((stamp, row))
        self._outputs.append(stamp, row)

    def _restart(self) -> None:
        """Forget everything: the clock was set back, a new run begins."""
        self._resets += 1
        self._pending.clear()
        self._held.clear()
        self._commands.clear()
        self._outputs.clear()
        self._first = self._last = self._next_fit = None
        self._recursive = self._make_recursive()

    def _predict(self) -> None:
        while self._pending:
            count = self._certain(self._pending[:BLOCK])
            if not count:
                return
            block, self._pending = self._pending[:count], self._pending[count:]
            self._process(block)

    def _certain(self, block: list[tuple[int, tuple[float, ...]]]) -> int:
        """Return how many samples from the start have their command, or have waited long enough for it."""
        newest_command = self._held.newest
        patience = block[-1][0] - COMMAND_WAIT * self._period_ns if not self._lockstep else -1
        limit = patience if newest_command is None else max(newest_command, patience)
        return sum(stamp <= limit for stamp, _ in block)

    def _process(self, block: list[tuple[int, tuple[float, ...]]]) -> None:
        if self._first is None:
            self._first = block[0][0]
        self._last = block[-1][0]
        self._samples.count += len(block)
        if self._recursive is not None and not self._recursion_failed:
            self._publish_block(self._recursive, block)
        self._schedule_fits()

    def _publish_block(self, recursive: RecursiveEstimator, block: list[tuple[int, tuple[float, ...]]]) -> None:
        origin = block[0][0] if self._first is None else self._first
        held = [self._held.at(stamp) for stamp, _ in block]
        time = np.array([stamp - origin for stamp, _ in block]) / SECOND
        command = np.array([0.0 if one is None else one[1][0] for one in held])
        measured = np.array([row for _, row in block])
        try:
            prediction = recursive.update_block(time, command, measured)
        except (IdloopError, ArithmeticError, np.linalg.LinAlgError) as error:
            self._recursion_failed = f"prediction stopped: {error}"
            self.get_logger().error(self._recursion_failed)
            return
        residual = measured - prediction
        for (stamp, _), expected, rest in zip(block, prediction.tolist(), residual.tolist(), strict=True):
            self._publish_prediction(self._packer.pack(stamp, expected))
            self._publish_residual(self._packer.pack(stamp, rest))

    # fits

    def _span(self) -> tuple[int, int]:
        return round(self.parameters["window"] * SECOND), round(self.parameters["validation"] * SECOND)

    def _schedule_fits(self) -> None:
        window, validation = self._span()
        period = round(self.parameters["fit_period"] * SECOND)
        if not period or self._first is None or self._last is None:
            return
        if self._next_fit is None:
            self._next_fit = self._first + window + validation
        # A window ends with the sample before its end stamp; half a period keeps rounding out.
        while self._last + self._period_ns // 2 >= self._next_fit - self._period_ns:
            self._submit(self._next_fit - validation - window, self._next_fit - validation, self._next_fit)
            self._next_fit += period
        keep = max(window + validation, period) + 2 * SECOND
        self._commands.forget(self._last - keep)
        self._outputs.forget(self._last - keep)

    def _fit_now(self) -> str:
        """Fit what there is, a third of it kept for the judgement; return what was started."""
        if self._first is None or self._last is None:
            return "no samples yet"
        window, validation = self._span()
        end = self._last + self._period_ns
        have = min(end - self._first, window + validation)
        cut = end - have * validation // (window + validation)
        return self._submit(end - have, cut, end)

    def _submit(self, start: int, cut: int, end: int) -> str:
        fit_record, validation_record = self._record(start, cut), self._record(cut, end)
        if min(fit_record.time.size, validation_record.time.size) < SHORTEST:
            return "too few samples"
        self._jobs += 1
        self._worker.submit(
            FitJob(
                self._jobs,
                self._model,
                self.parameters["criterion"],
                fit_record,
                validation_record,
                (start, cut),
                (cut, end),
            )
        )
        return f"fit {self._jobs} of {(cut - start) / SECOND:.1f} s, judged on {(end - cut) / SECOND:.1f} s"

    def _record(self, start: int, stop: int) -> Record:
        command_stamps, command = self._commands.window(start, stop, before=True)
        stamps, output = self._outputs.window(start, stop)
        model = self._model
        return Record(
            name=f"{(start - (self._first or 0)) / SECOND:g} s",
            input_time=(command_stamps - start) / SECOND,
            input=command[:, 0],
            time=(stamps - start) / SECOND,
            output=output,
            input_name=model.input.name,
            input_unit=model.input.unit,
            output_names=tuple(model.output_names),
            output_units=tuple(output.unit for output in model.outputs),
            start_ns=start,
        )

    def _on_refit(self, request: Any, response: Any) -> Any:
        response.message = self._fit_now()
        response.success = response.message.startswith("fit")
        return response

    def _publish_answer(self, answer: FitAnswer) -> None:
        name, stamp = self.get_name(), answer.summary.validation_window[1] - self._period_ns
        self._newest_fit = answer.summary
        statuses = fit_to_statuses(name, answer.summary)
        self._publish_fit(encode_diagnostics(stamp, statuses))
        if answer.parameters:
            parameters = parameters_to_statuses(name, answer.parameters)
            self._publish_parameters(encode_diagnostics(stamp, parameters))
            self.get_logger().info(
                f"{statuses[0].message}: " + ", ".join(f"{p.hardware_id} = {p.message}" for p in parameters)
            )
        else:
            self.get_logger().warning(f"no fit: {answer.summary.error}")

    # progress and health

    def _report(self) -> None:
        last = self._last
        if last is None:
            return
        if last - self._told >= 100 * self._period_ns:
            self._told = last
            self.tell_progress(last)
        end = self.progress.end
        if end is not None and not self._done and last >= end and not self._worker.busy:
            self._done = True
            self.tell_progress(last, DONE)

    def close(self) -> None:
        """End the worker."""
        self._worker.close()

    def health(self) -> list[Status]:
        """Return rates, what waits, and the newest fit."""
        rate = self._samples.rate()
        values = {
            "samples": str(self._samples.count),
            "rate": f"{rate:.1f}",
            "waiting": str(len(self._pending)),
            "unreadable": str(self._unreadable),
            "restarts": str(self._resets),
        }
        fits = {
            "submitted": str(self._jobs),
            "skipped": str(self._worker.skipped),
            "worker_failures": str(self._worker.failures),
        }
        fit = self._newest_fit
        text = "no fit yet" if fit is None else fit_to_statuses("", fit)[0].message
        level = Level.WARN if self._worker.failures or (fit is not None and fit.error) else Level.OK
        prediction = self._recursion_failed or f"{rate:.0f} samples/s"
        return [
            Status("prediction", prediction, Level.ERROR if self._recursion_failed else Level.OK, values),
            Status("fits", text, level, fits),
        ]


def make() -> EstimatorNode:
    """Build the node."""
    return EstimatorNode()
