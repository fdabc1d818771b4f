"""One step ahead for every sample, as messages: the library's recursive estimator behind the streams."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from idloop.errors import IdloopError
from idloop.estimation.live_estimator import RecursiveEstimator
from idloop.records.bags.cdr import SECOND
from idloop_nodes.estimation.estimator_context import Publish, Values
from idloop_nodes.estimation.sample_input import Sample
from idloop_nodes.streams.joint_layout import OutputPacker

if TYPE_CHECKING:
    from idloop.physics import Model


def update_block_length(sample_time: float) -> int:
    """Return the samples between two updates of the parameters: two fifths of a second, whatever the rate.

    An update takes milliseconds, mostly whatever its length: twice as often, and one sample in fifty would wait for it.
    """
    return min(max(round(0.4 / sample_time), 20), 400)


class Prediction:
    """Predicts measurements, publishes predictions and residuals.

    `values`: ``recursive`` and ``sample_time`` (nominal step; every update uses the measured stamps). Attributes:
    `failure`: why there is no prediction any more; empty when there is.
    """

    def __init__(
        self, values: Values, packer: OutputPacker, publish_prediction: Publish, publish_residual: Publish
    ) -> None:
        self.failure = ""
        self._wanted: bool = values["recursive"]
        self._sample_time: float = values["sample_time"]
        self._packer = packer
        self._publish_prediction = publish_prediction
        self._publish_residual = publish_residual
        self._recursive: RecursiveEstimator | None = None
        self._followed = 0  # samples since it last began or learnt

    def begin(self, model: Model) -> None:
        """Begin again with a model."""
        self.failure = ""
        if self._wanted:
            block = update_block_length(self._sample_time)
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
        """Predict a block of measurements, each with the command that holds at its stamp.

        `origin`: stamp that counts as time 0 [ns].
        """
        while block and self._recursive is not None and not self.failure:
            # With the last sample of its own block it learns, which takes milliseconds: what comes before goes first.
            count = max(self._recursive.block - 1 - self._followed, 0) or len(block)
            self._take(self._recursive, origin, block[:count], commands[:count])
            block, commands = block[count:], commands[count:]

    def _take(
        self,
        recursive: RecursiveEstimator,
        origin: int,
        block: Sequence[Sample],
        commands: Sequence[Sample | None],
    ) -> None:
        time = np.array([stamp - origin for stamp, _ in block]) / SECOND
        command = np.array([0.0 if one is None else one[1][0] for one in commands])
        measured = np.array([row for _, row in block])
        try:
            prediction = recursive.update_block(time, command, measured)
        except (IdloopError, ArithmeticError, np.linalg.LinAlgError) as error:
            self.failure = f"prediction stopped: {error}"
            return
        residual = measured - prediction
        for (stamp, _), expected, rest in zip(block, prediction.tolist(), residual.tolist(), strict=True):
            self._publish_prediction(self._packer.pack(stamp, expected))
            self._publish_residual(self._packer.pack(stamp, rest))
        unpredicted = np.flatnonzero(np.isnan(prediction).all(axis=1))
        follows = len(block) if not len(unpredicted) else len(block) - 1 - int(unpredicted[-1])
        self._followed = (follows if len(unpredicted) else self._followed + follows) % recursive.block
