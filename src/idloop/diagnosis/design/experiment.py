"""An experiment: its signal, the loop that the signal is added to, and the simulation of both."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from idloop.diagnosis.design.designs import Design
from idloop.diagnosis.design.limits import Limits
from idloop.errors import InputError

if TYPE_CHECKING:
    from idloop.control import Controller
    from idloop.physics import Engine, Model
    from idloop.records import Record
    from idloop.signals import Signal

Array = NDArray[np.float64]

COMMAND, REFERENCE = "command", "reference"
# Instants of two grids that lie closer than this coincide [s].
_SAME_TIME = 1e-9


@dataclass(frozen=True)
class Experiment:
    """A signal and the loop that it is sent into.

    Attributes
    ----------
    signal : mapping
        For ``build_signal(**signal)``: its ``name``, ``sample_time``, ``duration`` and the rest.
    adds_to : {"command", "reference"}
        The command of the drive, or what the controller follows.
    controller : mapping, optional
        ``controller:`` section of a model file; without one the loop is open.
    start : float
        Position at which the axis rests before, and at which the reference is held [position unit].
    sample_time : float, optional
        Of the measurements [s]; that of the signal by default.

    Raises
    ------
    InputError
        When the parts contradict each other, or the signal cannot be built.
    """

    signal: Mapping[str, Any]
    adds_to: str = COMMAND
    controller: Mapping[str, Any] | None = None
    start: float = 0.0
    sample_time: float | None = None

    def __post_init__(self) -> None:
        if self.adds_to not in {COMMAND, REFERENCE}:
            raise InputError(f"experiment: adds_to {self.adds_to!r}; use {COMMAND} or {REFERENCE}")
        if self.adds_to == REFERENCE and self.controller is None:
            raise InputError("experiment: only a controller follows a reference; give its section, or use the command")

    @cached_property
    def built(self) -> Signal:
        """The signal."""
        from idloop.signals import build_signal

        return build_signal(**self.signal)

    @property
    def duration(self) -> float:
        """Length [s]."""
        return self.built.duration

    @cached_property
    def time(self) -> Array:
        """Instants of the measurements [s], shape (n,)."""
        step = self.built.sample_time if self.sample_time is None else self.sample_time
        return np.arange(round(self.duration / step) + 1, dtype=np.float64) * step

    def run(
        self,
        model: Model,
        *,
        noise: bool = False,
        disturbance: float = 0.0,
        seed: int = 0,
        theta: Array | None = None,
        engine: Engine | None = None,
        name: str = "experiment",
    ) -> Record:
        """Simulate the experiment from rest.

        Parameters
        ----------
        model : Model
            The machine.
        noise : bool
            Add the measurement noise that the model's outputs state.
        disturbance : float
            Intensity of a random walk of the force on body 0 [force unit / √s], as a fit states it.
        seed : int
            Of noise and disturbance; equal seeds give equal records.
        theta : ndarray (k,), optional
            Values of the free parameters; those of the model by default.
        engine : Engine, optional
            Of this model, where there is one already.
        name : str
            Of the record.

        Returns
        -------
        Record
            As if it had been recorded.

        Raises
        ------
        InputError
            The controller reads an output that the model does not have.
        """
        from idloop.physics import Engine as Compiled
        from idloop.records import Record as Recorded

        engine = engine or Compiled(model)
        random = np.random.default_rng(seed)
        bodies = len(model.bodies)
        state = engine.initial_state(np.full(bodies, self.start), np.zeros(bodies), theta)
        std = np.array([(output.noise or 0.0) if noise else 0.0 for output in model.outputs])
        signal = self.built
        if self.controller is None and disturbance == 0.0:
            command_time, command = signal.time, signal.value
            errors = std * random.standard_normal((len(self.time), len(std))) if noise else None
            output = engine.simulate(theta, command_time, command, self.time, state, errors)
        else:
            command_time, command, output = self._in_loop(engine, theta, state, std, disturbance, random)
        held = np.zeros((len(signal.time), 2))
        reference = excitation = None
        if self.adds_to == REFERENCE:
            reference = self._reference(model, signal.time)
        else:
            excitation = held + np.nan
            excitation[:, 1] = signal.value
        return Recorded(
            name,
            command_time,
            command,
            self.time,
            output,
            model.input.name,
            model.input.unit,
            model.output_names,
            tuple(o.unit for o in model.outputs),
            reference_time=None if reference is None else signal.time,
            reference=reference,
            excitation_time=None if excitation is None else signal.time,
            excitation=excitation,
        )

    def check_controller(self, model: Model) -> None:
        """Raise an InputError where the controller reads what the model does not measure."""
        if self.controller is None:
            return
        regulator = self._regulator
        missing = [name for name in regulator.kernel.inputs if name not in model.output_names]
        if missing:
            raise InputError(
                f"controller {regulator.kind} reads {missing[0]}, which model {model.name} does not measure; "
                f"it measures {', '.join(model.output_names)}"
            )

    @cached_property
    def _regulator(self) -> Controller:
        from idloop.control import build_controller

        return build_controller(self.controller or {"type": "none", "sample_time": self.built.sample_time})

    def _in_loop(
        self,
        engine: Engine,
        theta: Array | None,
        state: Array,
        std: Array,
        disturbance: float,
        random: np.random.Generator,
    ) -> tuple[Array, Array, Array]:
        """Stamps and values of the command, and the outputs at the instants of the measurements."""
        from idloop.diagnosis.design.experiment_loop import simulate_closed_loop

        regulator, model = self._regulator, engine.model
        kernel = regulator.kernel
        self.check_controller(model)
        count = round(self.duration / regulator.sample_time) + 1
        grid: Array = np.arange(count, dtype=np.float64) * regulator.sample_time
        instants = np.unique(np.round(np.concatenate([grid, self.time]) / _SAME_TIME)) * _SAME_TIME
        ticks, reads = _nearest(instants, grid), _nearest(instants, self.time)
        step = np.diff(instants, append=instants[-1])
        walk = disturbance * np.cumsum(np.sqrt(step) * random.standard_normal(len(instants)))
        index = np.searchsorted(self.built.time, instants + _SAME_TIME, side="right") - 1
        known = np.clip(index, 0, None)
        value = self.built.value[known]
        adds = self.adds_to == REFERENCE
        reference = self._reference(model, self.built.time)[known] if adds else self._held(model, len(instants))
        acting = np.zeros(len(instants), dtype=bool)
        acting[ticks] = True
        output, command = simulate_closed_loop(
            engine,
            theta,
            kernel,
            np.array([model.output_names.index(name) for name in kernel.inputs], dtype=np.int64),
            instants,
            acting,
            reference,
            np.zeros(len(instants)) if adds else value,
            state,
            std * random.standard_normal((len(instants), len(std))),
            walk if disturbance else np.zeros(len(instants)),
        )
        return instants[ticks], command[ticks], np.ascontiguousarray(output[reads])

    def _held(self, model: Model, count: int) -> Array:
        """Reference that stays at the start, position and velocity."""
        scale = 1.0
        if self.controller is not None:
            followed = [o for o in model.outputs if o.name in self._regulator.inputs and o.field == "position"]
            scale = followed[0].scale if followed else 1.0
        return np.column_stack([np.full(count, self.start * scale), np.zeros(count)])

    def _reference(self, model: Model, time: Array) -> Array:
        """Reference at the signal's own stamps, shape (n, 2)."""
        reference = self._held(model, len(time))
        reference[:, 0] += self.built.value
        if self.built.rate is not None:
            reference[:, 1] = self.built.rate
        return reference


def _nearest(instants: Array, wanted: Array) -> NDArray[np.int64]:
    """Places of `wanted` among the sorted `instants`, which hold them up to rounding."""
    return np.asarray(np.searchsorted(instants, wanted - 2.0 * _SAME_TIME), dtype=np.int64)


@dataclass(frozen=True)
class Setup:
    """Where an experiment is to be run."""

    adds_to: str  # command or reference
    controller: dict[str, object] | None
    start: float  # position at rest before it [position unit]
    signal_time: float  # sample time of the signal [s]
    sample_time: float  # of the measurements [s]
    limits: Limits  # completed
    pace: float | None  # largest rate of change of a reference, where the user has limited the velocity
    seed: int

    @property
    def room(self) -> tuple[float, float]:
        """Middle about which the signal acts, and its largest peak."""
        if self.adds_to == COMMAND:
            return 0.0, float(self.limits.command or 1.0)
        if self.limits.position is None:
            return 0.0, 1.0
        low, high = self.limits.position
        middle, half = 0.5 * (low + high) - self.start, 0.5 * (high - low)
        if abs(middle) < 0.3 * half:
            return 0.0, half - abs(middle)
        return middle, half

    def experiment(self, design: Design, level: float, duration: float) -> Experiment:
        """A design at a share of the largest peak."""
        about, peak = self.room
        ramp = 0.0 if self.adds_to == COMMAND else 0.05 * duration
        signal = design.signal(level * peak, self.signal_time, duration, ramp, about)
        signal["seed"] = int(signal["seed"]) + 100 * self.seed
        return Experiment(signal, self.adds_to, self.controller, self.start, self.sample_time)
