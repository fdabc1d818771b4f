"""The library's recursive estimators behind the streams: one step ahead for every sample, and a black-box model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from idloop.errors import IdloopError
from idloop.estimation.live_estimator import RecursiveEstimator
from idloop.records.bags.cdr import SECOND
from idloop_nodes.codec import Level, Status
from idloop_nodes.codec.key_values import plus_minus
from idloop_nodes.estimation.estimator_context import EstimatorContext, Values
from idloop_nodes.estimation.sample_input import Sample

if TYPE_CHECKING:
    from idloop.estimation.recursive import LiveRecursion
    from idloop.physics import Model

Array = NDArray[np.float64]
PublishRow = Callable[[int, Sequence[float]], None]  # stamp [ns], one value for each output


class Follower:
    """What follows the samples block by block. Attributes: `failure`: why it does not any more; else empty."""

    failure = ""

    def _update(
        self,
        model: RecursiveEstimator | LiveRecursion,
        origin: int,
        block: Sequence[Sample],
        commands: Sequence[Sample | None],
    ) -> tuple[Array, Array] | None:
        """Return measurements and what the model makes of them, (n, outputs) each; None where it fails."""
        recursive = isinstance(model, RecursiveEstimator)
        unknown = 0.0 if recursive else np.nan
        time = np.array([stamp - origin for stamp, _ in block]) / SECOND
        command = np.array([unknown if one is None else one[1][0] for one in commands])
        measured = np.array([row for _, row in block])
        try:
            return measured, model.update_block(time, command, measured)
        except (IdloopError, ArithmeticError, np.linalg.LinAlgError) as error:
            self.failure = f"{'prediction' if recursive else 'recursion'} stopped: {error}"
            return None


class Prediction(Follower):
    """Predicts measurements, publishes predictions and residuals."""

    def __init__(self, values: Values, publish_prediction: PublishRow, publish_residual: PublishRow) -> None:
        self._wanted: bool = values["recursive"]
        self._sample_time: float = values["sample_time"]
        self._publish_prediction = publish_prediction
        self._publish_residual = publish_residual
        self._recursive: RecursiveEstimator | None = None
        self._followed = 0  # samples since it last began or learnt

    def begin(self, model: Model) -> None:
        """Begin again with a model."""
        self.failure = ""
        if self._wanted:
            # Updates of the parameters two fifths of a second apart, whatever the rate: one takes milliseconds, mostly
            # whatever its length; twice as often, and one sample in fifty would wait for it.
            block = min(max(round(0.4 / self._sample_time), 20), 400)
            self._recursive = RecursiveEstimator(model, sample_time=self._sample_time, block=block)
            self._followed = 0

    def go_on(self, model: Model) -> None:
        """Continue with another model from the present state of motion."""
        if self._recursive is not None and not self.failure:
            self._recursive.set_model(model)
        else:
            self.begin(model)

    def warm_up(self, model: Model) -> None:
        """Compile before the first sample: the loop would wait for it."""
        self.begin(model)
        if self._recursive is not None:
            count = 2 * self._recursive.block + 1
            time = np.arange(count) * self._sample_time
            self._recursive.update_block(time, np.sign(np.sin(time * 50.0)), np.zeros((count, len(model.outputs))))
        self.begin(model)

    def take(self, origin: int, block: Sequence[Sample], commands: Sequence[Sample | None]) -> None:
        """Predict a block of measurements with the commands that hold at their stamps; time begins at `origin` [ns]."""
        while block and self._recursive is not None and not self.failure:
            # With the last sample of its own block it learns, which takes milliseconds: what comes before goes first.
            count = max(self._recursive.block - 1 - self._followed, 0) or len(block)
            self._take(self._recursive, origin, block[:count], commands[:count])
            block, commands = block[count:], commands[count:]

    def _take(
        self, recursive: RecursiveEstimator, origin: int, block: Sequence[Sample], commands: Sequence[Sample | None]
    ) -> None:
        updated = self._update(recursive, origin, block, commands)
        if updated is None:
            return
        measured, prediction = updated
        residual = measured - prediction
        for (stamp, _), expected, rest in zip(block, prediction.tolist(), residual.tolist(), strict=True):
            self._publish_prediction(stamp, expected)
            self._publish_residual(stamp, rest)
        unpredicted = np.flatnonzero(np.isnan(prediction).all(axis=1))
        follows = len(block) if not len(unpredicted) else len(block) - 1 - int(unpredicted[-1])
        self._followed = (follows if len(unpredicted) else self._followed + follows) % recursive.block


class RecursiveModel(Follower):
    """A black-box model that follows every sample; publishes innovations and coefficients."""

    def __init__(self, context: EstimatorContext, model: Model, publish_innovation: PublishRow) -> None:
        self._context = context
        self._values = context.parameters
        self._input = model.input.name
        self._outputs = {output.name: output.unit for output in model.outputs}
        self._publish_innovation = publish_innovation
        self._recursion: LiveRecursion | None = None
        self.begin()
        self._warm_up()

    def _warm_up(self) -> None:
        """Compile before the first sample: the loop would wait for it."""
        if self._recursion is not None:
            time = np.arange(3) * self._values["sample_time"]
            self._recursion.update_block(time, np.zeros(3), np.zeros((3, len(self._outputs))))
            self.begin()

    def begin(self) -> None:
        """Begin again without any knowledge."""
        self.failure = ""
        self._due: int | None = None
        if self._values["recursion"] == "none":
            return
        from idloop.estimation.recursive import LiveRecursion

        values, period = self._values, self._values["sample_time"]
        memory = values["recursion_memory"]
        self._recursion = LiveRecursion(
            values["recursion"],
            tuple(self._outputs),
            sample_time=period,
            order=values["recursion_order"],
            delay=values["recursion_delay"],
            input_name=self._input,
            forgetting=1.0 if memory == 0.0 else float(np.exp(-period / memory)),
        )

    def take(self, origin: int, block: Sequence[Sample], commands: Sequence[Sample | None]) -> None:
        """Follow a block of measurements, as `Prediction.take`."""
        period = round(self._values["recursion_period"] * SECOND)
        while block and self._recursion is not None and not self.failure:
            # Coefficients are published at instants of the data's time: equal data give equal messages.
            if self._due is None:
                self._due = block[0][0] + period
            count = 1 + sum(stamp < self._due for stamp, _ in block)
            now, held, block, commands = block[:count], commands[:count], block[count:], commands[count:]
            updated = self._update(self._recursion, origin, now, held)
            if updated is None:
                return
            for (stamp, _), row in zip(now, updated[1].tolist(), strict=True):
                self._publish_innovation(stamp, row)
            last = now[-1][0]
            if last >= self._due:
                self.publish_coefficients(last)
                self._due += period * (1 + (last - self._due) // period)

    def publish_coefficients(self, stamp: int) -> None:
        """Publish the present coefficients under a stamp [ns]."""
        recursion = self._recursion
        if recursion is None or self.failure:
            return
        statuses = []
        for output, unit in self._outputs.items():
            samples, found = recursion.samples[output], [one for one in recursion.coefficients if one.output == output]
            values = {"output": output, "unit": unit, "method": recursion.method, "samples": str(samples)}
            values["innovation_std"] = str(recursion.innovation_std[output])
            for one in found:
                values |= {f"value/{one.name}": str(one.value), f"stderr/{one.name}": str(one.stderr)}
            text = ", ".join(f"{one.name} = {one.value:.4g}{plus_minus(one.stderr, 1)}" for one in found)
            message = f"{recursion.method} after {samples} samples: {text}"
            statuses.append(Status(f"{self._context.name}: {output}", message, values=values, hardware_id=output))
        self._context.publish("coefficients", stamp, statuses)

    def health(self) -> list[Status]:
        """Return what it has learnt from; nothing when it is not wanted."""
        recursion = self._recursion
        if recursion is None:
            return []
        values = {"late": str(recursion.late), "holes": str(recursion.holes)}
        values |= {f"samples/{name}": str(count) for name, count in recursion.samples.items()}
        text = self.failure or f"{recursion.method} follows {', '.join(self._outputs)}"
        return [Status("recursion", text, Level.ERROR if self.failure else Level.OK, values)]
