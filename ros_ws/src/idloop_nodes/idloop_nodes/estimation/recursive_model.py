"""A black-box model that follows every sample, as messages: the library's live recursion behind the streams."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from idloop.errors import IdloopError
from idloop.records.bags.cdr import SECOND
from idloop_nodes.codec import Level, RecursionSummary, Status, encode_diagnostics, recursion_to_statuses
from idloop_nodes.estimation.estimator_context import EstimatorContext, Publish
from idloop_nodes.estimation.sample_input import Sample
from idloop_nodes.streams.joint_layout import OutputPacker

if TYPE_CHECKING:
    from idloop.estimation.recursive import LiveRecursion
    from idloop.physics import Model


class RecursiveModel:
    """Follows the samples, publishes innovations and coefficients.

    `model`: whose input and outputs are followed. Attributes: `failure`: why it does not follow any more; empty when it
    does.
    """

    def __init__(
        self,
        context: EstimatorContext,
        model: Model,
        packer: OutputPacker,
        publish_innovation: Publish,
        publish_coefficients: Publish,
    ) -> None:
        self.failure = ""
        self._name = context.name
        self._values = context.parameters
        self._input = model.input.name
        self._outputs = {output.name: output.unit for output in model.outputs}
        self._packer = packer
        self._publish_innovation = publish_innovation
        self._publish_coefficients = publish_coefficients
        self._recursion: LiveRecursion | None = None
        self._due: int | None = None
        self.begin()
        self._warm_up()

    @property
    def wanted(self) -> bool:
        """Whether there is a model to follow with."""
        return bool(self._values["recursion"] != "none")

    def begin(self) -> None:
        """Begin again without any knowledge."""
        self.failure, self._due = "", None
        if not self.wanted:
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

    def _warm_up(self) -> None:
        """Compile before the first sample: the loop would wait for it."""
        if self._recursion is not None:
            time = np.arange(3) * self._values["sample_time"]
            self._recursion.update_block(time, np.zeros(3), np.zeros((3, len(self._outputs))))
            self.begin()

    def take(self, origin: int, block: Sequence[Sample], commands: Sequence[Sample | None]) -> None:
        """Follow a block of measurements, each with the command that holds at its stamp.

        `origin`: stamp that counts as time 0 [ns].
        """
        if self._recursion is None or self.failure:
            return
        period = round(self._values["recursion_period"] * SECOND)
        while block:
            # Coefficients are published at instants of the data's time: equal data give equal messages.
            if self._due is None:
                self._due = block[0][0] + period
            count = sum(stamp < self._due for stamp, _ in block)
            now, held = block[: count + 1], commands[: count + 1]
            if not self._follow(origin, now, held):
                return
            if now[-1][0] >= self._due:
                self.publish_coefficients(now[-1][0])
                self._due += period * (1 + (now[-1][0] - self._due) // period)
            block, commands = block[len(now) :], commands[len(now) :]

    def _follow(self, origin: int, block: Sequence[Sample], commands: Sequence[Sample | None]) -> bool:
        assert self._recursion is not None  # noqa: S101 - the caller has checked
        time = np.array([stamp - origin for stamp, _ in block]) / SECOND
        command = np.array([np.nan if one is None else one[1][0] for one in commands])
        measured = np.array([row for _, row in block])
        try:
            innovations = self._recursion.update_block(time, command, measured)
        except (IdloopError, ArithmeticError, np.linalg.LinAlgError) as error:
            self.failure = f"recursion stopped: {error}"
            return False
        for (stamp, _), row in zip(block, innovations.tolist(), strict=True):
            self._publish_innovation(self._packer.pack(stamp, row))
        return True

    def publish_coefficients(self, stamp: int) -> None:
        """Publish the present coefficients under a stamp [ns]."""
        if self._recursion is not None and not self.failure:
            statuses = recursion_to_statuses(self._name, self.summaries())
            self._publish_coefficients(encode_diagnostics(stamp, statuses))

    def summaries(self) -> list[RecursionSummary]:
        """What it knows of each output."""
        recursion = self._recursion
        if recursion is None:
            return []
        found = recursion.coefficients
        return [
            RecursionSummary(
                output=name,
                unit=unit,
                method=recursion.method,
                samples=recursion.samples[name],
                innovation_std=recursion.innovation_std[name],
                coefficients={one.name: (one.value, one.stderr) for one in found if one.output == name},
            )
            for name, unit in self._outputs.items()
        ]

    def health(self) -> list[Status]:
        """Return what it has learnt from; nothing when it is not wanted."""
        recursion = self._recursion
        if recursion is None:
            return []
        values = {"late": str(recursion.late), "holes": str(recursion.holes)}
        values |= {f"samples/{name}": str(count) for name, count in recursion.samples.items()}
        text = self.failure or f"{recursion.method} follows {', '.join(self._outputs)}"
        return [Status("recursion", text, Level.ERROR if self.failure else Level.OK, values)]
