"""One experiment as arrays: what was sent in, what came out, and when."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from idloop.arrays import Array, Integers
from idloop.errors import InputError
from idloop.physics.conditions import Condition
from idloop.records.filtering import held_mean, resample_held, resample_linear, zero_phase
from idloop.records.finding import Finding
from idloop.records.unwrapping import unwrap
from idloop.spelling import check_known, did_you_mean

if TYPE_CHECKING:
    from idloop.physics.model import Model


_LONGEST_HOLE = 5.0  # median intervals that interpolation may bridge


@dataclass(frozen=True, eq=False)
class Record:
    """Input and outputs of one experiment on one time axis.

    Parameters
    ----------
    name : str
        Name for tables and plots.
    input_time, input : ndarray, shape (m,)
        Command [s, `input_unit`]; held from its stamp until the next one.
    time : ndarray, shape (n,)
        Stamps of the measurements [s], strictly increasing.
    output : ndarray, shape (n, p)
        Measurements; NaN = not measured at that stamp.
    input_name, input_unit : str
        ``"motor.effort"``, ``"V"``.
    output_names, output_units : tuple of str
        ``("motor.position", ...)`` and their units.
    reference_time, reference : ndarray, shape (r,) and (r, 2), or None
        What the controller follows: position, velocity; NaN = not given.
    excitation_time, excitation : ndarray, shape (e,) and (e, 2), or None
        What the excitation added: to the position reference, to the command; NaN = not given.
    conditions : tuple of Condition
        What was measured beside the axis, such as a temperature or the supply; on the same time axis.
    start_ns : int
        Absolute stamp of time 0 [ns].
    findings : tuple of Finding
        What was noticed while reading and processing.

    Notes
    -----
    Time is kept by all methods: the instant 12.3 s stays 12.3 s after a cut.
    """

    name: str
    input_time: Array
    input: Array
    time: Array
    output: Array
    input_name: str
    input_unit: str
    output_names: tuple[str, ...]
    output_units: tuple[str, ...]
    reference_time: Array | None = None
    reference: Array | None = None
    excitation_time: Array | None = None
    excitation: Array | None = None
    conditions: tuple[Condition, ...] = ()
    start_ns: int = 0
    findings: tuple[Finding, ...] = ()

    @classmethod
    def from_arrays(
        cls,
        time: ArrayLike,
        command: ArrayLike,
        outputs: Mapping[str, ArrayLike],
        model: Model | None = None,
        *,
        command_time: ArrayLike | None = None,
        name: str = "data",
        command_name: str = "axis.effort",
        command_unit: str = "",
        units: Mapping[str, str] | None = None,
    ) -> Record:
        """Record of measurements that are arrays already.

        Parameters
        ----------
        time : array_like, shape (n,)
            Stamps of the measurements [s], strictly increasing.
        command : array_like, shape (n,) or (m,)
            In the unit of the model's input; held from its stamp until the next one.
        outputs : mapping of str to array_like, shape (n,)
            Measurements by output: ``motor.position``, or ``position`` where only one output has this field. NaN where
            not measured; outputs of the model that are left out are NaN throughout.
        model : Model, optional
            Gives names and units of the signals.
        command_time : array_like, shape (m,), optional
            Stamps of the command [s]; those of the measurements when left out.
        name : str
            Of the record.
        command_name, command_unit, units
            Without a model: name and unit of the command, unit by output.

        Returns
        -------
        Record
            Time begins at 0 at the first measurement.

        Raises
        ------
        InputError
            Arrays of different lengths, stamps that do not rise, outputs that the model does not have.

        Examples
        --------
        >>> import numpy as np
        >>> from idloop import Record, load_model
        >>> t = np.arange(3) * 0.01
        >>> Record.from_arrays(t, [0, 1, 1], {"velocity": [0, 0.1, 0.2]}, load_model("axis")).output_names
        ('axis.position', 'axis.velocity')
        """
        stamps = _column(name, "time", time)
        if model is not None:
            names, its_units = model.output_names, tuple(signal.unit for signal in model.outputs)
            command_name, command_unit = model.input.name, model.input.unit
        else:
            names, its_units = tuple(outputs), tuple((units or {}).get(output, "") for output in outputs)
        columns = np.full((stamps.size, len(names)), np.nan)
        for given, values in outputs.items():
            column = _column(name, given, values)
            if column.size != stamps.size:
                raise InputError(f"{name}: {given} has {column.size} values for {stamps.size} stamps")
            columns[:, _place(name, given, names)] = column
        sent = _column(name, "command", command)
        sent_at = stamps if command_time is None else _column(name, "command_time", command_time)
        begin = float(stamps[0]) if stamps.size else 0.0
        return cls(name, sent_at - begin, sent, stamps - begin, columns, command_name, command_unit, names, its_units)

    @classmethod
    def from_frame(
        cls,
        frame: Any,
        model: Model | None = None,
        *,
        time: str,
        command: str,
        outputs: Mapping[str, str],
        name: str = "data",
        **options: Any,
    ) -> Record:
        """Record of the columns of a pandas or polars frame, or of a mapping of columns.

        Parameters
        ----------
        frame : DataFrame or mapping
        model : Model, optional
            Gives names and units of the signals.
        time, command : str
            Columns of the stamps [s] and of the command.
        outputs : mapping of str to str
            Column by output: ``{"motor.position": "theta"}``.
        name : str
            Of the record.
        **options
            As in `from_arrays`.

        Raises
        ------
        InputError
            The frame lacks a column; as `from_arrays`.

        Examples
        --------
        >>> from idloop import Record, load_model
        >>> frame = {"t": [0.0, 0.01, 0.02], "u": [0, 1, 1], "w": [0, 0.1, 0.2]}
        >>> motor = load_model("dc_motor")
        >>> Record.from_frame(frame, motor, time="t", command="u", outputs={"velocity": "w"}).duration
        0.02
        """
        known = [str(column) for column in (frame.columns if hasattr(frame, "columns") else frame)]
        for column in (time, command, *outputs.values()):
            check_known(column, known, f"{name}: no column")
        measured = {output: frame[column] for output, column in outputs.items()}
        return cls.from_arrays(frame[time], frame[command], measured, model, name=name, **options)

    def __post_init__(self) -> None:
        if self.input.shape != self.input_time.shape or self.input.ndim != 1:
            raise InputError(
                f"{self.name}: input {self.input.shape} and its time {self.input_time.shape} must be of one length"
            )
        if self.output.shape != (self.time.size, len(self.output_names)):
            raise InputError(
                f"{self.name}: output {self.output.shape} must be (samples, outputs) = ({self.time.size},"
                f" {len(self.output_names)})"
            )
        if len(self.output_units) != len(self.output_names):
            raise InputError(
                f"{self.name}: {len(self.output_names)} outputs need as many units, not {len(self.output_units)}"
            )
        self._check_pair("reference", "position and velocity")
        self._check_pair("excitation", "to the position reference and to the command")
        if np.any(np.diff(self.time) <= 0) or np.any(np.diff(self.input_time) <= 0):
            raise InputError(f"{self.name}: time does not increase strictly; sort the samples and drop repeated stamps")

    def _check_pair(self, name: str, columns: str) -> None:
        """Two columns over their own time; NaN stands for what is not given."""
        when, what = getattr(self, f"{name}_time"), getattr(self, name)
        if what is not None and when is not None and what.shape != (when.size, 2):
            raise InputError(
                f"{self.name}: {name} {what.shape} must be (samples, 2) = ({when.size}, 2): {columns}; NaN where one is"
                " not given"
            )

    @property
    def duration(self) -> float:
        """Span of the measurements [s]."""
        return float(self.time[-1] - self.time[0]) if self.time.size else 0.0

    @property
    def sample_time(self) -> float:
        """Median interval of the measurements [s]."""
        return float(np.median(np.diff(self.time))) if self.time.size > 1 else float("nan")

    def absolute(self, time: Array) -> Integers:
        """Return instants of this record as absolute stamps [ns]."""
        stamps: Integers = self.start_ns + np.round(time * 1e9).astype(np.int64)
        return stamps

    def column(self, output: str) -> int:
        """Return the column of an output by its name; InputError when there is none."""
        check_known(output, self.output_names, f"{self.name}: no output")
        return self.output_names.index(output)

    def input_at(self, time: Array) -> Array:
        """Return the command held at each instant (k,), NaN before the first command."""
        return resample_held(self.input_time, self.input, time)

    def input_mean(self, time: Array) -> Array:
        """Return the mean command between consecutive instants (k,) -> (k-1,): exact for the held signal."""
        return held_mean(self.input_time, self.input, time)

    def cut(self, start: float | None = None, stop: float | None = None) -> Record:
        """Keep start <= time <= stop [s on the record's own axis]; the command held at `start` stays known."""
        low = self.time[0] if start is None else start
        high = self.time[-1] if stop is None else stop
        keep = (self.time >= low) & (self.time <= high)
        if keep.sum() < 2:
            raise InputError(
                f"{self.name}: nothing left between {low:.6g} and {high:.6g} s; the record spans"
                f" {self.time[0]:.6g} to {self.time[-1]:.6g} s"
            )
        inputs = _covering(self.input_time, low, high)
        changes: dict[str, Any] = {}
        for name in ("reference", "excitation"):
            when, what = getattr(self, f"{name}_time"), getattr(self, name)
            if when is not None and what is not None:
                part = _covering(when, low, high)
                changes |= {f"{name}_time": when[part], name: what[part]}
        return replace(
            self,
            time=self.time[keep],
            output=self.output[keep],
            input_time=self.input_time[inputs],
            input=self.input[inputs],
            conditions=tuple(one.cut(low, high) for one in self.conditions),
            **changes,
        )

    def drop(self, start_seconds: float = 0.0, stop_seconds: float = 0.0) -> Record:
        """Leave out the first and the last seconds."""
        if start_seconds < 0 or stop_seconds < 0:
            raise InputError(
                f"{self.name}: seconds to drop must not be negative (got {start_seconds:g} and {stop_seconds:g})"
            )
        return self.cut(self.time[0] + start_seconds, self.time[-1] - stop_seconds)

    def decimate(self, factor: int, antialias: bool = True) -> Record:
        """Keep every `factor`-th sample of each output; the command keeps all of its steps.

        With `antialias` a zero-phase low-pass at 80 % of the new half sample rate goes before.
        """
        if factor < 1 or int(factor) != factor:
            raise InputError(f"{self.name}: decimation factor {factor}; it must be a whole number of at least 1")
        if factor == 1:
            return self
        source = self.filtered(None, 0.4 / (factor * self._column_period())) if antialias else self
        keep = np.zeros(self.output.shape, dtype=bool)
        for column in range(self.output.shape[1]):
            keep[np.flatnonzero(np.isfinite(self.output[:, column]))[:: int(factor)], column] = True
        rows = keep.any(axis=1)
        output = np.where(keep, source.output, np.nan)[rows]
        return self._processed(
            f"every {factor}th sample kept" + (", anti-alias filter before" if antialias else ""),
            self.time[rows],
            output,
        )

    def resample(self, period: float, antialias: bool = True) -> Record:
        """Interpolate the outputs onto a grid of `period` [s]; holes stay NaN, the command keeps its own stamps.

        Use `input_at(record.time)` for the command on the same grid.
        """
        if not period > 0 or period > self.duration:
            raise InputError(
                f"{self.name}: sample period {period:g} s; it must be positive and below the record's"
                f" {self.duration:.4g} s"
            )
        old = self._column_period()
        source = self.filtered(None, 0.4 / period) if antialias and period >= 2 * old else self
        count = int(np.floor(self.duration / period + 1e-6)) + 1
        grid = self.time[0] + period * np.arange(count)
        columns = [
            resample_linear(
                self.time, source.output[:, column], np.minimum(grid, self.time[-1]), _LONGEST_HOLE * max(old, period)
            )
            for column in range(self.output.shape[1])
        ]
        return self._processed(f"resampled to {period * 1e3:.6g} ms", grid, np.column_stack(columns))

    def filtered(
        self, low: float | None = None, high: float | None = None, *, order: int = 4, inputs: bool = False
    ) -> Record:
        """Filter the outputs without phase, pass band `low` to `high` [Hz]; with `inputs` the command likewise.

        The command is first put on the grid of the measurements when it is filtered, as a filtered command is
        no longer a staircase.
        """
        output = np.column_stack(
            [zero_phase(self.time, self.output[:, column], low, high, order) for column in range(self.output.shape[1])]
        )
        band = f"{low or 0:g} to {high:g} Hz" if high is not None else f"above {low or 0:g} Hz"
        record = self._processed(f"filtered without phase, {band}", self.time, output)
        if not inputs:
            return record
        held = self.input_at(self.time)
        known = np.isfinite(held)
        return replace(
            record, input_time=self.time[known], input=zero_phase(self.time[known], held[known], low, high, order)
        )

    def detrend(self, kind: str = "mean") -> Record:
        """Remove the mean, or with ``"linear"`` the straight line, of the command and of every output."""
        check_known(kind, ("mean", "linear"), f"{self.name}: no detrend")
        degree = int(kind == "linear")
        output = np.column_stack([_without_trend(self.time, column, degree) for column in self.output.T])
        record = self._processed(f"{kind} removed", self.time, output)
        return replace(record, input=_without_trend(self.input_time, self.input, degree))

    def unwrapped(self, output: str, span: float) -> Record:
        """Undo the wrap of an encoder with the declared range `span` (2π, 4096 counts, ...) in the output's unit."""
        values = self.output.copy()
        column = self.column(output)
        values[:, column] = unwrap(self.time, values[:, column], span).value
        return self._processed(f"{output} unwrapped over {span:g}", self.time, values)

    def _column_period(self) -> float:
        """Median interval of the densest output: with mixed sensors the rows are denser than each of them."""
        periods = [
            float(np.median(np.diff(self.time[known])))
            for known in (np.isfinite(column) for column in self.output.T)
            if known.sum() > 1
        ]
        return min(periods, default=self.sample_time)

    def _processed(self, text: str, time: Array, output: Array) -> Record:
        return replace(
            self, time=time, output=output, findings=(*self.findings, Finding("processing", text, where=self.name))
        )


def _column(record: str, name: str, values: ArrayLike) -> Array:
    try:
        column = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{record}: {name} holds values that are no numbers ({error})") from error
    if column.ndim != 1:
        raise InputError(f"{record}: {name} {column.shape} must have one dimension")
    return column


def _place(record: str, given: str, names: Sequence[str]) -> int:
    """Column of an output by its name, or by its field alone where that is unique."""
    if given in names:
        return list(names).index(given)
    same = [index for index, known in enumerate(names) if known.rpartition(".")[2] == given]
    if len(same) == 1:
        return same[0]
    why = f"{given} is the field of several outputs" if same else f"no output '{given}'"
    raise InputError(f"{record}: {why}: the outputs are {', '.join(names)}{did_you_mean(given, names)}")


def _covering(time: Array, low: float, high: float) -> slice:
    """Return the samples that tell a held signal on [low, high]: from the one in force at `low` on."""
    start = max(int(np.searchsorted(time, low, side="right")) - 1, 0)
    return slice(start, int(np.searchsorted(time, high, side="right")))


def _without_trend(time: Array, value: Array, degree: int) -> Array:
    known = np.isfinite(value)
    if known.sum() <= degree:
        return value
    centred = time - time.mean()
    trend = np.polynomial.polynomial.polyfit(centred[known], value[known], degree)
    result: Array = value - np.polynomial.polynomial.polyval(centred, trend)
    return result
