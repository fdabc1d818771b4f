"""A nonlinear ARX model with a network: prediction, free run, training history, figures and files."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from idloop.arrays import Array
from idloop.documents import MOST_JSON, NOT_WHOLE, read_json, read_text
from idloop.errors import InputError
from idloop.estimation.black_box.labels import new_axes
from idloop.estimation.black_box.sampled import SampledData, check_fits
from idloop.estimation.networks.network import Network, ahead, parameters
from idloop.estimation.networks.training import TrainingHistory
from idloop.estimation.networks.training_data import Form, Preparation, Split, TappedDelays
from idloop.json_values import to_json
from idloop.output_files import write_text

if TYPE_CHECKING:
    import control

SCHEMA = "idloop/narx-model/1"
_RANGES = 50.0  # a free run that leaves so many times the range of the training data has diverged


@dataclass(frozen=True, eq=False)
class NarxModel:
    """A nonlinear ARX model y(k) = f(past outputs, past inputs), f a network."""

    method: str  # "narx-wavelet" or "narx-neural"
    form: Form  # trained to predict one step ahead from measurements, or in free run from its own past outputs
    delays: TappedDelays
    network: Network
    # shape (p,): a free run is held between these [output units]
    low: Array
    high: Array
    sample_time: float  # [s]
    input_names: tuple[str, ...]
    input_units: tuple[str, ...]
    output_names: tuple[str, ...]
    output_units: tuple[str, ...]
    samples: int  # for training
    split: Split  # which rows of the regressors served training, validation and test
    history: TrainingHistory
    notes: tuple[str, ...] = ()

    @classmethod
    def of(
        cls, method: str, prepared: Preparation, network: Network, history: TrainingHistory, form: Form,
        notes: tuple[str, ...] = (),
    ) -> NarxModel:  # fmt: skip
        """The model at the end of a training."""
        reach = _RANGES * 2 * prepared.output_width
        return cls(
            method=method,
            form=form,
            delays=prepared.delays,
            network=network,
            low=prepared.output_center - reach,
            high=prepared.output_center + reach,
            samples=prepared.split.train.size,
            split=prepared.split,
            history=history,
            notes=notes,
            **prepared.experiments[0].labels,
        )

    @property
    def first(self) -> int:
        """First sample of a record that is predicted: those before fill the delay lines."""
        return int(np.max(self.network.lag))

    @property
    def units(self) -> int:
        """Hidden units."""
        return int(self.network.kind.size)

    @property
    def free(self) -> int:
        """Numbers that were estimated."""
        return int(parameters(self.network, with_linear=bool(np.any(self.network.linear))).size)

    @property
    def system(self) -> control.NonlinearIOSystem:
        """The free run as a python-control system: `linearize`, `input_output_response` and `find_eqpt` work on it.

        Its states are the last `first` outputs, oldest first, then the last `first` inputs.
        """
        import control
        from idloop.estimation.black_box.labels import control_names

        first, p, m = self.first, len(self.output_names), len(self.input_names)

        def lines(state: Array) -> tuple[Array, Array]:
            return state[: first * p].reshape(first, p), state[first * p :].reshape(first, m)

        def output(time: float, state: Array, command: Array, parameters: Mapping[str, Any]) -> Array:
            past, sent = lines(np.asarray(state, dtype=float))
            inputs, outputs = np.vstack([sent, np.reshape(command, (1, m))]), np.vstack([past, np.zeros((1, p))])
            return np.asarray(ahead(self.network, inputs, outputs, first, 1, self.low, self.high)[-1])

        def update(time: float, state: Array, command: Array, parameters: Mapping[str, Any]) -> Array:
            past, sent = lines(np.asarray(state, dtype=float))
            now = output(time, state, command, parameters)
            return np.concatenate([*past[1:], now, *sent[1:], np.reshape(command, m)])

        return control.nlsys(
            update, output, inputs=control_names(self.input_names), outputs=control_names(self.output_names),
            states=first * (p + m), dt=self.sample_time,
        )  # fmt: skip

    def predict(self, data: SampledData, steps: int = 1) -> Array:
        """Prediction `steps` samples ahead (one: the series-parallel form).

        Returns shape (N, p): the samples before `first` are the measured ones [output units]. Raises InputError: other
        signals or another sample time than the model's, too short a record, or fewer than one step.
        """
        self._check(data)
        if steps < 1:
            raise InputError(f"prediction {steps} steps ahead; give at least 1, or simulate")
        return self._ahead(data, data.output, steps)

    def simulate(self, data: SampledData, initial: Array | Literal["measured", "zero"] = "measured") -> Array:
        """Free run (parallel form): the outputs from the commands alone.

        `initial` (first, p): the outputs before the first sample that is computed ("measured" or "zero"). Returns shape
        (N, p): the samples before `first` are `initial`. A run that diverges stays at `low` or `high` [output units].
        Raises InputError: other signals or another sample time than the model's, too short a record, or an `initial` of
        another shape.
        """
        self._check(data)
        past = data.output
        if not (isinstance(initial, str) and initial == "measured"):
            start = np.zeros((self.first, past.shape[1])) if isinstance(initial, str) else np.asarray(initial, float)
            if start.shape != (self.first, past.shape[1]) or not np.all(np.isfinite(start)):
                raise InputError(
                    f"{data.name}: initial outputs of shape {start.shape}; give ({self.first}, {past.shape[1]}) finite"
                    " values, 'measured' or 'zero'"
                )
            past = past.copy()
            past[: self.first] = start
        return self._ahead(data, past, len(data))

    def innovations(self, data: SampledData) -> Array:
        """One-step prediction errors, shape (N, p); zero before `first`."""
        return data.output - self.predict(data)

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        names = (
            "method",
            "form",
            "sample_time",
            "input_units",
            "output_units",
            "low",
            "high",
            "units",
            "free",
            "samples",
        )
        parts = {name: vars(getattr(self, name)) for name in ("delays", "split", "history")}
        return {
            **{name: getattr(self, name) for name in names},
            **parts,
            "samples": self.samples,
            "inputs": self.input_names,
            "outputs": self.output_names,
            "network": self.network._asdict(),
            "notes": list(self.notes),
        }

    @classmethod
    def from_dict(cls, document: Mapping[str, Any]) -> NarxModel:
        """The model of `to_dict`, of arrays or of plain lists with None for NaN.

        Raises InputError: something is missing, or of another shape.
        """
        try:
            history = dict(document["history"])
            curves: dict[str, Any] = {
                key: _numbers(history.pop(key)) for key in ("train", "validation", "test", "gradient", "mu")
            }
            rows = {key: np.asarray(value, dtype=np.int64) for key, value in document["split"].items()}
            return cls(
                method=str(document["method"]),
                form=document["form"],
                delays=TappedDelays(**document["delays"]),
                network=_network(document["network"], len(document["inputs"]), len(document["outputs"])),
                low=_numbers(document["low"]),
                high=_numbers(document["high"]),
                sample_time=float(document["sample_time"]),
                input_names=tuple(map(str, document["inputs"])),
                input_units=tuple(map(str, document["input_units"])),
                output_names=tuple(map(str, document["outputs"])),
                output_units=tuple(map(str, document["output_units"])),
                samples=int(document["samples"]),
                split=Split(**rows),
                history=TrainingHistory(**curves, **history),
                notes=tuple(map(str, document["notes"])),
            )
        except NOT_WHOLE as error:
            raise InputError(f"damaged, or not a network ({' '.join(str(error).split())})") from None

    def plot(self, axes: Any = None) -> Any:
        """Draw the training curve; returns the matplotlib axes."""
        from idloop import drawing

        with drawing.styled():
            axes = new_axes(axes, 1, 3.5)
            step = np.arange(len(self.history.train))
            curves = (self.history.train, self.history.validation, self.history.test)
            for index, (text, curve) in enumerate(zip(("training", "validation", "test"), curves, strict=True)):
                if np.any(np.isfinite(curve)):
                    drawing.line(axes, step, curve, label=text, **drawing.model_look(index))
            axes.axvline(self.history.best, color=drawing.COMMAND, linewidth=0.6, label="kept")
            axes.set(yscale="log", xlabel=f"{self.history.step}s [-]")
            axes.set_ylabel(drawing.label("mean square of the scaled error", "-"))
            axes.set_title(f"{self.method}, {self.units} units; stopped by: {self.history.stop}")
            axes.legend()
        return axes

    def _ahead(self, data: SampledData, past: Array, steps: int) -> Array:
        inputs, outputs = np.ascontiguousarray(data.input), np.ascontiguousarray(past)
        run: Array = ahead(self.network, inputs, outputs, self.first, steps, self.low, self.high)
        return run

    def _check(self, data: SampledData) -> None:
        check_fits(data, self.method, len(self.input_names), len(self.output_names), self.sample_time)
        if len(data) <= self.first:
            raise InputError(
                f"{data.name}: {len(data)} samples do not fill delays of {self.first}; give a longer record"
            )


def _numbers(values: Any) -> Array:
    """Array of a nested list, None being NaN."""
    return np.array(values, dtype=float)


def _network(values: Mapping[str, Any], inputs: int, outputs: int) -> Network:
    """Network of nested lists, whose shapes are checked: the compiled functions do not check them."""
    units, r, p = len(values["kind"]), len(values["source"]), len(values["constant"])
    shapes: dict[str, tuple[int, ...]] = {
        "source": (r,), "lag": (r,), "center": (r,), "width": (r,), "kind": (units,), "direction": (units, r),
        "scale": (units,), "weight": (p, units), "constant": (p,), "linear": (p, r), "output_center": (p,),
        "output_width": (p,),
    }  # fmt: skip
    found: dict[str, Any] = {}
    for name, shape in shapes.items():
        value = np.ascontiguousarray(values[name], dtype=np.int64 if name in ("source", "lag", "kind") else float)
        # A network without units has rows without numbers, which have lost their shape.
        value = value if value.size or np.prod(shape) else value.reshape(shape)
        if value.shape != shape or not np.all(np.isfinite(value)):
            raise InputError(f"damaged: {name} of shape {value.shape}; it must hold {shape} finite numbers")
        found[name] = value
    network = Network(**found)
    known = (network.source >= 0) & (network.source < inputs + outputs) & (network.lag >= 0)
    if not (np.all(known) and np.all(network.lag[network.source < outputs] >= 1)):
        raise InputError("damaged: a regressor that is no past output and no input")
    return network


def save(model: NarxModel, path: Path | str) -> Path:
    """Write a network.

    Parameters
    ----------
    path : Path or str
        With the suffix ``.json``.

    Raises
    ------
    InputError
        Another suffix.
    IdloopError
        The file cannot be written.
    """
    path = check_suffix(Path(path))
    document = to_json({"schema": SCHEMA, **model.to_dict()})
    write_text(path, json.dumps(document, ensure_ascii=False, allow_nan=False) + "\n")
    return path


def load(path: Path | str) -> NarxModel:
    """Read what `save` wrote.

    Raises
    ------
    InputError
        No such file, or not one of a network.
    """
    path = check_suffix(Path(path))
    content = read_json(read_text(path, MOST_JSON), str(path))
    if not isinstance(content, dict) or content.get("schema") != SCHEMA:
        raise InputError(f"{path}: no network in it; its schema must be {SCHEMA}")
    try:
        return NarxModel.from_dict(content)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def check_suffix(path: Path) -> Path:
    """Return `path` when it ends with ``.json``."""
    if path.suffix.lower() != ".json":
        raise InputError(f"{path}: a network is a file with the suffix .json")
    return path
