"""Closed-loop subspace identification with a known controller (VODMA), and its direct variant."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from idloop.arrays import Array
from idloop.errors import InputError
from idloop.estimation.black_box.sampled import SampledData, together
from idloop.estimation.linear.model import LinearModel
from idloop.estimation.linear.sensitivity import Matrices
from idloop.estimation.subspace import realisation
from idloop.estimation.subspace.compression import halved_windows
from idloop.estimation.subspace.model import assembled
from idloop.estimation.subspace.open_loop import selection
from idloop.estimation.subspace.order import check_order
from idloop.estimation.subspace.realisation import project_future

if TYPE_CHECKING:
    import control

_SAME_PERIOD = 1e-3  # of a period
_LIMITED = 1e-3  # of the limit, and of the time
_LARGEST_MISFIT = 0.05  # of the command's rms: quantised logs and commands held from between two samples stay below
Data = SampledData | Sequence[SampledData]


@dataclass(frozen=True)
class CommandMisfit:
    """How far the command of a controller lies from the recorded one."""

    # RMS of the difference over that of the recorded command, both about their straight lines; 0: it is the controller
    # that ran, 1 and more: its command does not explain the recorded one
    share: float
    late: float  # the same when the recorded command answers one sample later


def controller_notes(spec: Mapping[str, Any], data: Sequence[SampledData]) -> list[str]:
    """Say how far the controller that is taken for known is from the one that ran."""
    period, own = data[0].sample_time, float(spec.get("sample_time", data[0].sample_time))
    if abs(period - own) > _SAME_PERIOD * period:
        note = f"the controller ran every {own:g} s and is only approximated on data every {period:g} s"
        return [f"{note}; identify at its period"]
    misfit = command_misfit(spec, data)
    notes = _limit_notes(spec, data)
    if misfit is None:
        return [*notes, "no reference was recorded: whether this is the controller that ran cannot be checked"]
    if misfit.share <= _LARGEST_MISFIT:
        return notes
    text = (
        f"the controller misses the recorded command by {100 * misfit.share:.3g} % of its rms when it answers the"
        " recorded reference and measurements"
    )
    if misfit.late <= _LARGEST_MISFIT:
        late = f"and by {100 * misfit.late:.2g} % where the command answers one sample later"
        return [*notes, f"{text}, {late}: stamp each command as the measurement that it answers"]
    if misfit.share >= 1.0:
        raise InputError(
            f"vodma: {text}: another controller ran; correct gains, signs and units, or use pbsid, which needs none"
        )
    why = "an excitation or a compensation that was not recorded may have added to it"
    return [*notes, f"{text}, which biases the model; correct its gains, or {why}"]


def _limit_notes(spec: Mapping[str, Any], data: Sequence[SampledData]) -> list[str]:
    """Say how often the command is limited."""
    limit = spec.get("limit")
    if limit is None:
        return []
    command = np.abs(np.concatenate([stretch.input[:, 0] for stretch in data]))
    share = float(np.mean(command >= (1.0 - _LIMITED) * limit))
    if share <= _LIMITED:
        return []
    at = f"{limit:g} {data[0].input_units[0]} for {100 * share:.2g} % of the time"
    effect = "where the controller is not linear; this biases the model, but not that of pbsid"
    return [f"the command is at its limit of {at}, {effect}"]


def command_misfit(spec: Mapping[str, Any], data: Sequence[SampledData]) -> CommandMisfit | None:
    """Let a controller answer the recorded reference and measurements, and hold its command against the recorded one.

    A straight line is removed from both for what a record does not show: where an integral began, and the trends
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
    from idloop.control import build_controller, step

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


def vodma(
    data: Data,
    controller: control.LTI | Mapping[str, control.LTI] | None,
    order: int | Literal["auto"] = "auto",
    *,
    horizon: int | None = None,
    feedthrough: bool = False,
    stable: bool = False,
    integrates: bool = False,
    weighting: realisation.Weighting = "cva",
) -> LinearModel:
    """State-space model of a plant in a loop u = r - controller(y) whose controller is known.

    The first algorithm of Van Overschee and De Moor (Automatica 33, 1997) in its LQ form, section 3.4 of the thesis
    on the torsion system. What the controller makes of the measurements is put back into the command, so that noise
    of the future does not reach the instrument; r need not be recorded, but must not depend on the noise.
    Only a linear controller fits: a command at its limit spoils the relation, `pbsid` does not mind.

    Parameters
    ----------
    data : SampledData or sequence of SampledData
        Experiments in closed loop; offsets removed.
    controller : python-control system, mapping of output name to system, or None
        Discrete, at the data's sample time, from all measured outputs in their order to what is subtracted from
        the commands [input unit per output unit]. The mapping names the outputs that are fed back to one command.
        None for direct identification, as by `vodma_direct`.
    order : int or "auto"
    stable, integrates : bool
        As for `n4sid`; B is fitted before poles are moved.
    weighting : "cva", "moesp" or "n4sid"
        Of the projection that shows the states. The thesis takes the oblique projection as it is ("n4sid"), which
        breaks down when the reference leaves frequencies empty, as band-limited references do.

    Raises
    ------
    InputError
        As for `n4sid`, or a controller of other signals or another sample time.
    """
    experiments = together(data)
    method = "vodma_direct" if controller is None else "vodma"
    known = None if isinstance(order, str) else order
    feedback = None if controller is None else _checked(controller, experiments[0])
    compression = halved_windows(experiments, horizon, known, feedthrough)
    half = compression.length // 2
    check_order(order, half, compression.outputs)
    scale = compression.output_scale / compression.input_scale[:, None]
    markov = None if feedback is None else [block * scale for block in _markov(*feedback, half)]
    future = project_future(compression, markov)
    subspace = realisation.weighted_subspace(future, weighting)
    chosen = selection(method, compression, future, subspace).order if isinstance(order, str) else order
    now = np.zeros((compression.inputs, compression.outputs)) if markov is None else markov[0]
    a, b, c, d, noise = realisation.with_known_feedback(future, subspace.observability(chosen), feedthrough, now)
    a = realisation.constrained(a, stable=stable, integrates=integrates)
    gain, notes = realisation.kalman_gain(noise, a, c)
    return assembled(method, compression, Matrices(a, b, c, d, gain), subspace.values, feedthrough, notes)


def vodma_direct(data: Data, order: int | Literal["auto"] = "auto", **options: Any) -> LinearModel:
    """Algorithm of `vodma` with the controller set to zero: direct identification, the thesis's DI.

    Options, result and errors as for `vodma`. Consistent in open loop only.
    """
    return vodma(data, None, order, **options)


def _checked(
    controller: control.LTI | Mapping[str, control.LTI], data: SampledData
) -> tuple[Array, Array, Array, Array]:
    """State-space matrices of the controller from all outputs to all commands."""
    import control

    systems: Mapping[Any, Any] = controller if isinstance(controller, Mapping) else {None: controller}
    p, m, period = len(data.output_names), len(data.input_names), data.sample_time
    parts = []
    for name, system in systems.items():
        if name is not None and (name not in data.output_names or m != 1):
            raise InputError(
                f'controller of "{name}": give one command and one of the outputs {", ".join(data.output_names)}'
            )
        found = control.ss(system)
        columns = list(range(p)) if name is None else [data.output_names.index(name)]
        if (found.noutputs, found.ninputs) != (m, len(columns)):
            raise InputError(
                f"controller with {found.ninputs} inputs and {found.noutputs} outputs; it must lead from"
                f" {len(columns)} measured outputs to {m} commands"
            )
        if (
            found.dt is None
            or found.dt == 0
            or (found.dt is not True and abs(found.dt - data.sample_time) > _SAME_PERIOD * data.sample_time)
        ):
            raise InputError(
                f"controller with sample time {found.dt}, but {data.name} has {period:g} s;"
                " convert it with idloop.estimation.linear.c2d or d2d"
            )
        spread = np.eye(p)[columns]
        parts.append((found.A, found.B @ spread, found.C, found.D @ spread))
    from scipy.linalg import block_diag

    a, b, c, d = zip(*parts, strict=True)
    return block_diag(*a), np.vstack(b), np.hstack(c), np.sum(d, axis=0)


def _markov(a: Array, b: Array, c: Array, d: Array, count: int) -> list[Array]:
    """First impulse responses D, C B, C A B, ... of a system."""
    response, state = [d], b
    for _ in range(count - 1):
        response.append(c @ state)
        state = a @ state
    return response
