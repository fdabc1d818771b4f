"""Bank of one-step predictors: one with the current parameters, and one for each parameter moved."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from idloop.arrays import Array
from idloop.estimation.optimisation.levenberg import probed_size
from idloop.estimation.sensors import body_sensors

if TYPE_CHECKING:
    from idloop.physics import Model


_COMMANDS_KEPT = 16384
_ONE_GAIN = np.zeros(1, dtype=np.int64)


class _Waiting:
    """Samples that the main predictor has processed: times, measurements and innovations by row."""

    def __init__(self, outputs: int) -> None:
        self.count = 0
        self._rows = np.empty((64, 1 + 2 * outputs))

    def append(self, t: Array, y: Array, innovation: Array) -> None:
        count = self.count + len(t)
        if count > len(self._rows):
            self._rows = np.concatenate([self._rows[: self.count], np.empty((count, self._rows.shape[1]))])
        part, outputs = self._rows[self.count : count], y.shape[1]
        part[:, 0], part[:, 1 : 1 + outputs], part[:, 1 + outputs :] = t, y, innovation
        self.count = count

    def since(self, first: int) -> tuple[Array, Array, Array]:
        """Contiguous copies of all samples from an index on."""
        rows = self._rows[first : self.count]
        outputs = (rows.shape[1] - 1) // 2
        parts = rows[:, 0], rows[:, 1 : 1 + outputs], rows[:, 1 + outputs :]
        return tuple(np.ascontiguousarray(part) for part in parts)  # type: ignore[return-value]


class PredictorBank:
    """Predictors that keep their state between calls.

    The main predictor runs at once, the moved ones until `slopes` is called: one of them for each sample, so that no
    sample has to wait for all of them.

    Attributes: `gain` (2 b + 1, p): observer gain of the main and the moved predictors.
    """

    def __init__(self, model: Model) -> None:
        from idloop.estimation.optimisation.caching_engine import CachingEngine
        from idloop.physics import kernel as compiled

        self.kernel: Any = compiled
        self.model, self.engine = model, CachingEngine(model)
        layout = self.engine.layout(None)
        self.gain = np.zeros((2 * layout.bodies + 1, len(model.outputs)))
        self._samples = _Waiting(len(model.outputs))
        # Innovations of the moved predictors on the waiting samples, and the index of the next one to run.
        self._moved_innovation: list[list[Array]] = []
        self._turn = 0
        self._steps_known = False
        self._sensors = body_sensors(model)
        self._command_time = np.zeros(_COMMANDS_KEPT)
        self._command = np.zeros(_COMMANDS_KEPT)
        self._commands = 0
        self._theta = model.theta.astype(float)
        self._steps = np.zeros(0)
        self._layouts: list[Any] = [layout]  # None until needed
        self._states: list[Array] = [layout.new_state()]
        self._histories: list[Array] = [layout.new_history()]
        # Main state at the last sample of all moved predictors.
        self._base = self._states[0].copy()
        # Predictors with the current parameters and other gains, to compare disturbance intensities.
        self._rival_gains: list[Array] = []
        self._rival_states: list[Array] = []
        self._rival_histories: list[Array] = []

    @property
    def waiting(self) -> int:
        """Number of samples since the last slopes."""
        return self._samples.count

    @property
    def motion(self) -> Array:
        """State of the main predictor."""
        return self._states[0]

    def start(self, t: float, u: float, y: Array) -> None:
        """Start from a measurement, with the command from there on."""
        position, velocity = np.zeros(len(self._sensors)), np.zeros(len(self._sensors))
        for body, (place, speed) in enumerate(self._sensors):
            # A body without a sensor gets the motion of the previous one.
            if body > 0:
                position[body], velocity[body] = position[body - 1], velocity[body - 1]
            if place is not None and np.isfinite(y[place]):
                position[body] = y[place] / self.model.outputs[place].scale
            if speed is not None and np.isfinite(y[speed]):
                velocity[body] = y[speed] / self.model.outputs[speed].scale
        state = self.engine.initial_state(position, velocity, self._theta)
        state[self.kernel.TIME] = t
        self._commands = 0
        self._restart(state)
        self._append(np.array([t]), np.array([u]))

    def take_over(self, other: PredictorBank) -> None:
        """Take the state of another bank, as far as it has the same bodies."""
        first, bodies = self.kernel.FIRST, (len(self.gain) - 1) // 2
        self._command_time, self._command = other._command_time, other._command
        self._commands = other._commands
        state = self._layouts[0].new_state()
        state[:2] = other.motion[:2]
        if other.gain.shape == self.gain.shape:
            common = slice(self.kernel.DISTURBANCE, first + 3 * bodies)
            state[common] = other.motion[common]
        self._restart(state)

    def _restart(self, state: Array) -> None:
        """Start all predictors from one state."""
        self._states = [state.copy() for _ in self._layouts]
        self._histories = [self._layout(which).new_history() for which in range(len(self._layouts))]
        self.drop()
        self.set_rivals(self._rival_gains)

    def set_rivals(self, gains: list[Array]) -> None:
        """Start predictors with other gains from the main one's state."""
        self._rival_gains = [np.ascontiguousarray(gain) for gain in gains]
        self._rival_states = [self._states[0].copy() for _ in gains]
        self._rival_histories = [self._histories[0].copy() for _ in gains]

    def rivals(self) -> list[Array]:
        """Innovations of the rivals on the waiting samples; call before `slopes`."""
        t, y, _ = self._samples.since(0)
        own = zip(self._rival_gains, self._rival_states, self._rival_histories, strict=True)
        return [self._run(self._layouts[0], gain, state, history, t, y) for gain, state, history in own]

    def drop(self) -> None:
        """Drop the waiting samples."""
        self._samples.count = 0
        self._moved_innovation = [[] for _ in self._steps]
        self._base = self._states[0].copy()

    def advance(self, t: Array, u: Array, y: Array) -> Array:
        """Run the main predictor over samples; returns the innovations, shape (n, p)."""
        self._append(t, u)
        innovation = self._predict(0, t, y)
        self._samples.append(t, y, innovation)
        self._run_next_moved()
        return innovation

    def innovations(self) -> Array:
        """Innovations of the main predictor on the waiting samples, shape (n, p)."""
        return self._samples.since(0)[2]

    def measured(self) -> Array:
        """Measurements of the waiting samples, shape (n, p)."""
        return self._samples.since(0)[1]

    def command_rms(self) -> float:
        """Root mean square of the commands kept."""
        return float(np.sqrt(np.mean(self._command[: max(self._commands, 1)] ** 2)))

    def slopes(self) -> tuple[Array, Array]:
        """Run the moved predictors over the waiting samples.

        Returns `innovation` (n, p); `slope` (n, p, k): derivative of the prediction with respect to every parameter.
        """
        _, y, innovation = self._samples.since(0)
        slope = np.empty((*y.shape, len(self._steps)))
        for index, step in enumerate(self._steps):
            self._catch_up(index)
            slope[:, :, index] = (innovation - np.concatenate(self._moved_innovation[index])) / step
        self._steps_known = True
        self.drop()
        return innovation, slope

    def place(self, theta: Array, steps: Array) -> None:
        """Set the parameters of all predictors; the derivatives of the state keep their value."""
        old = self._steps
        self._theta = theta.copy()
        self._layouts = [self.engine.layout(theta), *([None] * len(steps))]
        if len(self._states) != len(self._layouts):
            self._states = [self._states[0].copy() for _ in self._layouts]
            self._histories = [self._histories[0].copy() for _ in self._layouts]
        else:
            for index, (before, now) in enumerate(zip(old, steps, strict=True)):
                self._rescale(index, before, now)
        self._steps = steps.copy()
        self._moved_innovation = [[] for _ in steps]

    def restep(self, index: int, step: float) -> None:
        """Change the difference step of one parameter before its predictor runs."""
        self._rescale(index, self._steps[index], step)
        self._steps[index] = step
        self._layouts[index + 1] = None

    def probe(self, index: int, deviation: Array, upper: float) -> float:
        """Typical size of a parameter: the power of ten that changes the waiting innovations by a norm of about 10."""
        t, y, base = self._samples.since(0)
        layout, state, history = self._layout(index + 1), self._states[index + 1], self._histories[index + 1]

        def change(step: float) -> float:
            sign = 1.0 if self._theta[index] + step <= upper else -1.0
            self._layouts[index + 1] = self.engine.layout(self._moved(index, sign * step))
            self._states[index + 1], self._histories[index + 1] = state.copy(), history.copy()
            moved = self._predict(index + 1, t, y)
            return float(np.sqrt(np.nansum(((moved - base) / np.maximum(deviation, 1e-300)) ** 2)))

        size = probed_size(change, 1e-3)
        self._layouts[index + 1], self._states[index + 1], self._histories[index + 1] = layout, state, history
        return size

    def _moved(self, index: int, step: float) -> Array:
        theta: Array = self._theta.copy()
        theta[index] += step
        return theta

    def _rescale(self, index: int, before: float, now: float) -> None:
        first, moved = self.kernel.DISTURBANCE, self._states[index + 1]
        ratio = now / before if before != 0.0 else 0.0
        if ratio != 1.0:
            moved[first:] = self._base[first:] + ratio * (moved[first:] - self._base[first:])

    def _run_next_moved(self) -> None:
        """Let the next moved predictor catch up, once steps are known for all parameters."""
        if self._steps_known and len(self._steps):
            self._turn = (self._turn + 1) % len(self._steps)
            self._catch_up(self._turn)

    def _catch_up(self, index: int) -> None:
        done = sum(len(part) for part in self._moved_innovation[index])
        t, y, _ = self._samples.since(done)
        if len(t):
            self._moved_innovation[index].append(self._predict(index + 1, t, y))

    def _layout(self, which: int) -> Any:
        if self._layouts[which] is None:
            self._layouts[which] = self.engine.layout(self._moved(which - 1, self._steps[which - 1]))
        return self._layouts[which]

    def _predict(self, which: int, t: Array, y: Array) -> Array:
        return self._run(self._layout(which), self.gain, self._states[which], self._histories[which], t, y)

    def _run(self, layout: Any, gain: Array, state: Array, history: Array, t: Array, y: Array) -> Array:
        """Innovations of a predictor, whose state and history go on in place, shape (n, p)."""
        innovation = np.empty(y.shape)
        time, value = self._command_time[: self._commands], self._command[: self._commands]
        # The kernel integrates long segments of a stiff chain differently: blocks must not change the result.
        most = self.kernel.LEAST_SAMPLES - 1
        for first in range(0, len(t), most):
            part = slice(first, first + most)
            self.kernel.predict(
                layout.axis, time, value, t[part], y[part], gain, _ONE_GAIN, 1.0, state, history, innovation[part]
            )
        return innovation

    def _append(self, t: Array, u: Array) -> None:
        count = len(t)
        if self._commands + count > _COMMANDS_KEPT:
            half = _COMMANDS_KEPT // 2
            kept = self._commands - half
            self._command_time[:kept] = self._command_time[half : self._commands]
            self._command[:kept] = self._command[half : self._commands]
            self._commands = kept
            index = self.kernel.COMMAND
            for state in (*self._states, *self._rival_states, self._base):
                state[index] = max(state[index] - half, -1.0)
        # A missing command holds the last one.
        known = np.where(np.isfinite(u), u, self._command[self._commands - 1] if self._commands else 0.0)
        self._command_time[self._commands : self._commands + count] = t
        self._command[self._commands : self._commands + count] = known
        self._commands += count
