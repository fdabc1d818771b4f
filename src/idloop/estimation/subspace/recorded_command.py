"""Whether a controller is the one that made a recorded command."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from idloop.errors import InputError
from idloop.estimation.black_box.sampled import SampledData

Array = NDArray[np.float64]

_SAME_PERIOD = 1e-3  # of a period
_LIMITED = 1e-3  # of the limit, and of the time
_MADE_IT = 0.05  # of the command's rms: quantised logs and commands held from between two samples stay below


@dataclass(frozen=True)
class CommandMisfit:
    """How far the command of a controller lies from the recorded one.

    `share`: RMS of the difference over that of the recorded command, both about their straight lines; 0: it is the
    controller that ran, 1 and more: its command says nothing of the recorded one.
    """

    share: float
    late: float  # the same when the recorded command answers one sample later


def controller_notes(spec: Mapping[str, Any], data: Sequence[SampledData]) -> list[str]:
    """Say how far the controller that is taken for known is from the one that ran.

    `spec`: ``controller:`` section of a model file; `data`: with every output that it reads. Returns: nothing where it
    made the recorded commands. Raises InputError: its command says nothing of the recorded one.
    """
    period, own = data[0].sample_time, float(spec.get("sample_time", data[0].sample_time))
    if abs(period - own) > _SAME_PERIOD * period:
        note = f"the controller ran every {own:g} s and is only approximated on data every {period:g} s"
        return [f"{note}; identify at its period"]
    misfit = command_misfit(spec, data)
    said = _at_limit(spec, data)
    if misfit is None:
        return [*said, "no reference was recorded: nothing tells whether this is the controller that ran"]
    if misfit.share <= _MADE_IT:
        return said
    text = (
        f"the controller misses the recorded command by {100 * misfit.share:.3g} % of its rms when it answers the"
        " recorded reference and measurements"
    )
    if misfit.late <= _MADE_IT:
        late = f"and by {100 * misfit.late:.2g} % where the command answers one sample later"
        return [*said, f"{text}, {late}: stamp each command as the measurement that it answers"]
    if misfit.share >= 1.0:
        raise InputError(f"vodma: {text}: another one ran; mend gains, signs and units, or use pbsid, which needs none")
    why = "an excitation or a compensation that was not recorded may have added to it"
    return [*said, f"{text}, and the model errs with it; mend its gains, or {why}"]


def _at_limit(spec: Mapping[str, Any], data: Sequence[SampledData]) -> list[str]:
    """Say how often the command is limited."""
    limit = spec.get("limit")
    if limit is None:
        return []
    command = np.abs(np.concatenate([stretch.input[:, 0] for stretch in data]))
    share = float(np.mean(command >= (1.0 - _LIMITED) * limit))
    if share <= _LIMITED:
        return []
    at = f"{limit:g} {data[0].input_units[0]} for {100 * share:.2g} % of the time"
    return [f"the command is at its limit of {at}, and no linear law then; the model errs by it, pbsid does not"]


def command_misfit(spec: Mapping[str, Any], data: Sequence[SampledData]) -> CommandMisfit | None:
    """Let a controller answer the recorded reference and measurements, and hold its command against the recorded one.

    The straight line that both lose stands for what a record does not show: where an integral began, and the trends
    that were taken off the measurements.

    `spec`: ``controller:`` section of a model file, its limits included; `data`: at the controller's own period, with
    every output that it reads. Returns: none where no reference was recorded, or the recorded command never changes.
    """
    squares, total = np.zeros(2), 0.0
    for stretch in data:
        if stretch.reference is None:
            continue
        recorded = stretch.input[:, 0]
        answered = _answer(spec, stretch)
        squares += [_power(recorded - answered), _power(recorded[1:] - answered[:-1])]
        total += _power(recorded)
    if total == 0.0:
        return None
    share, late = np.sqrt(squares / total)
    return CommandMisfit(float(share), float(late))


def _answer(spec: Mapping[str, Any], data: SampledData) -> Array:
    """Command (n,) of the controller, started at rest on the first sample."""
    from idloop.control import step
    from idloop.control.build import build_controller

    kernel = build_controller({**spec, "sample_time": data.sample_time}).kernel
    reference = np.zeros(len(data)) if data.reference is None else data.reference
    velocity = data.reference_velocity
    if velocity is None:
        velocity = np.gradient(reference, data.sample_time)
    feedforward = np.zeros(len(data)) if data.feedforward is None else data.feedforward
    measured = data.output[:, [data.output_names.index(name) for name in kernel.inputs]]
    state = kernel.state.copy()
    return np.array(
        [
            step.controller_step(kernel.kind, kernel.parameters, state, *now)
            for now in zip(reference, velocity, measured, feedforward, strict=True)
        ]
    )


def _power(value: Array) -> float:
    """Sum of squares about the straight line."""
    from scipy.signal import detrend

    return float(np.sum(detrend(value) ** 2))
