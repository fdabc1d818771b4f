"""The compiled closed loop: any model under any controller, one call for a whole experiment."""

from __future__ import annotations

import zlib
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from idloop.control import step
from idloop.physics import kernel

if TYPE_CHECKING:
    from idloop.control import Kernel
    from idloop.physics import Engine

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


def simulate_closed_loop(
    engine: Engine,
    theta: Array | None,
    controller: Kernel,
    inputs: NDArray[np.int64],
    instants: Array,
    ticks: Flags,
    reference: Array,
    feedforward: Array,
    initial_state: Array,
    noise: Array,
    disturbance: Array,
) -> tuple[Array, Array]:
    """Simulate a machine under its controller.

    The controller, as after a reset, reads the outputs in the columns `inputs` at the `instants` (n,) [s] that `ticks`
    (n,) marks; its command holds from there on. It follows `reference` (n, 2), position and velocity; `feedforward`
    (n,) is added to its law, `noise` (n, p) to the readings, and `disturbance` (n,) is a force on body 0, held from
    each instant on. Returns the readings (n, p) and the command after each instant (n,).
    """
    layout = engine.layout(theta)
    state = engine._start(layout, initial_state, instants[:0], instants)  # noqa: SLF001
    output = np.empty((len(instants), len(engine.model.outputs)))
    command = np.zeros(len(instants))
    _loop(_stamp())(
        layout.axis,
        controller.kind,
        controller.parameters,
        controller.state.copy(),
        inputs,
        np.ascontiguousarray(instants, dtype=float),
        np.ascontiguousarray(ticks, dtype=np.bool_),
        np.ascontiguousarray(reference, dtype=float),
        np.ascontiguousarray(feedforward, dtype=float),
        np.ascontiguousarray(noise, dtype=float),
        np.ascontiguousarray(disturbance, dtype=float),
        state,
        layout.new_history(),
        output,
        command,
    )
    return output, command


@lru_cache(maxsize=1)
def _stamp() -> int:
    """Number that changes with the sources that are compiled into the loop."""
    check = 1
    for module in (kernel, step):
        check = zlib.crc32(Path(str(module.__file__)).read_bytes(), check)
    return check


@lru_cache(maxsize=1)
def _loop(stamp: int) -> Any:
    """Compile the loop.

    Numba's cache looks at this file only, but at the values of a closure as well: through ``stamp`` it
    notices a change of the simulator or of the controllers.
    """

    @njit(cache=True, error_model="numpy", nogil=True)
    def loop(
        axis: Any, kind: Any, parameters: Any, memory: Any, inputs: Any, instants: Any, ticks: Any, reference: Any,
        feedforward: Any, noise: Any, disturbance: Any, state: Any, history: Any, output: Any, command: Any,
    ) -> int:  # fmt: skip
        seen = np.zeros(inputs.shape[0])
        sent_time = np.zeros(instants.shape[0])
        sent = np.zeros(instants.shape[0])
        work = np.zeros((9, axis.inertia.shape[0]))
        flow = kernel.chain_flow(axis, instants[:1], instants)
        machine, model = kernel.view_of_machine(axis, state, history, work, flow), kernel.view_of(axis)
        count = 0
        for k in range(instants.shape[0]):
            kernel.run_to(model, sent_time[:count], sent[:count], instants[k], state, history, work, flow, machine)
            kernel.measure(model, state, history, noise[k], output[k])
            state[kernel.DISTURBANCE] = disturbance[k]
            if ticks[k]:
                for i in range(inputs.shape[0]):
                    seen[i] = output[k, inputs[i]]
                sent_time[count] = instants[k]
                sent[count] = step.controller_step(
                    kind, parameters, memory, reference[k, 0], reference[k, 1], seen, feedforward[k]
                )
                count += 1
            command[k] = sent[count - 1] if count > 0 else 0.0
        return int(stamp)

    return loop
