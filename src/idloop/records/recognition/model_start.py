"""A model file to start with: one body or a motor and its load, the signals that were recorded, rough values."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from idloop.arrays import Array
from idloop.physics.model import Model
from idloop.physics.model_file import build_model
from idloop.physics.schema import SCHEMA, ModelFile
from idloop.records.inspection.coupled import transmission
from idloop.records.inspection.motion import white_noise
from idloop.records.record import Record

# Units in which a command is the force itself, by unit of the position.
_FORCES = {"rad": "N·m", "m": "N"}
_WINDOWS = 400
_FEWEST = 8
# Of a load: the damping ratio of the spring to it, and samples in a period of its resonance where the data show none.
_DAMPED, _PER_PERIOD = 0.05, 20
# Accuracy to which a gear ratio that was found from the data is a whole number.
_WHOLE = 2e-3


def start_model(
    name: str,
    joint: str,
    command_unit: str,
    outputs: dict[str, str],
    *,
    load: tuple[str, str] | None = None,
    measured: bool = False,
    records: Sequence[Record] = (),
) -> Model:
    """Return a model of one body, or of two where the position of the load was recorded as well.

    A command in the unit of the position, or of its rate, is the set-point of a loop in the drive, which acts late: its
    gains and the damping show in the motion, per inertia. Of the braking of a position loop and viscous friction only
    the sum shows until its limit is reached.

    `command_unit`: unit of the command on the topics.
    `outputs`: unit by field: ``position``, ``velocity``.
    `load`: (str, str), optional. Name of the body that the joint drives, and unit of its position.
    `measured`: the input was measured and is not held.
    `records`: from which inertia or gain, and viscous friction are estimated roughly; left out, they are 1.
    """
    place = next(iter(outputs.values())).removesuffix("/s")
    loop = {place: "position_loop", f"{place}/s": "velocity_loop"}.get(command_unit, "")
    gain, friction = _rough_values(records, loop) if records else (1.0, 1.0)
    body: dict[str, Any] = {"name": joint}
    if loop:
        # Only ratios of inertia, friction and gains show in the motion.
        body["inertia"] = 1.0
        body["viscous_friction"] = 0.0 if loop == "position_loop" else {"value": _rounded(friction), "min": 0.0}
    else:
        # Of a command that is no force a gain of one makes all forces those in units of the command.
        body["inertia"] = {"value": _rounded(1.0 / gain), "min": 0.0}
        body["viscous_friction"] = {"value": _rounded(friction / gain), "min": 0.0}
    bodies, sensor = [body], []
    couplings: list[dict[str, Any]] = []
    if load is not None:
        ratio, spring = _transmission(records, f"{joint}.position", f"{load[0]}.position")
        bodies, couplings = _with_load(body, load[0], spring)
        sensor = [_output(load[0], "position", load[1], records) | ({"scale": ratio} if ratio != 1.0 else {})]
    steps = [float(np.median(np.diff(record.input_time))) for record in records if len(record.input_time) > 1]
    delay = {"effect": "input_delay", "at": "input", "delay": {"value": _rounded(float(np.median(steps or [0.0])))}}
    signal = {"topic": "joint_command", "joint": joint, "field": "effort", "unit": command_unit or _FORCES[place]}
    content = {
        "schema": SCHEMA,
        "name": name,
        "input": signal | ({"kind": "measured"} if measured else {}),
        "outputs": [_output(joint, field, unit, records) for field, unit in outputs.items()] + sensor,
        "bodies": bodies,
        "couplings": couplings,
        "drive": _drive(loop, gain, friction),
        "effects": [delay] if loop else [],
    }
    return build_model(ModelFile.model_validate(content), name)


def _drive(loop: str, gain: float, friction: float) -> dict[str, Any]:
    if not loop:
        return {"gain": 1.0}
    gains = {"proportional": gain} | ({"derivative": friction} if loop == "position_loop" else {})
    return {"kind": loop, "unit": "-"} | {name: {"value": _rounded(one), "min": 0.0} for name, one in gains.items()}


def _output(joint: str, field: str, unit: str, records: Sequence[Record]) -> dict[str, Any]:
    signal = {"topic": "joint_states", "joint": joint, "field": field, "unit": unit}
    return signal | _noise(records, f"{joint}.{field}")


def _with_load(body: dict[str, Any], load: str, spring: float) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Return a motor and a load that share inertia and friction, and the spring between them."""

    def half(value: Any) -> Any:
        return {**value, "value": _rounded(0.5 * value["value"])} if isinstance(value, dict) else value

    motor = {key: value if key == "name" else half(value) for key, value in body.items()}
    driven = {**motor, "name": load}
    inertia = motor["inertia"]["value"] if isinstance(motor["inertia"], dict) else motor["inertia"]
    driven["inertia"] = {"value": inertia, "min": 0.0}
    stiffness = inertia * spring
    damping = 2.0 * _DAMPED * inertia * spring**0.5
    coupling = {
        "from": motor["name"],
        "to": load,
        "stiffness": {"value": _rounded(stiffness), "min": 0.0},
        "damping": {"value": _rounded(damping), "min": 0.0},
    }
    return [motor, driven], [coupling]


def _transmission(records: Sequence[Record], axis: str, load: str) -> tuple[float, float]:
    """Return how far the load moves beside the axis, and the stiffness between them per inertia of the load.

    Over windows of a record the load is accelerated and braked by what the spring is wound up.
    """
    if not records:
        return 1.0, 1.0
    longest = max(records, key=lambda record: float(np.nanstd(record.output[:, record.column(axis)])))
    place, other = (longest.output[:, longest.column(name)] for name in (axis, load))
    known = np.isfinite(place) & np.isfinite(other)
    time, place, other = longest.time[known], place[known], other[known]
    if not transmission(place, other):
        return 1.0, 1.0
    width = max(time.size // _WINDOWS, 2)
    speed = (other[width:] - other[:-width]) / (time[width:] - time[:-width])
    gained = (speed[width:] - speed[:-width]) / (0.5 * (time[2 * width :] - time[: -2 * width]))
    # Wound up by acceleration and friction, the load lags behind the axis.
    table = np.column_stack([place[width:-width], gained, 0.5 * (speed[width:] + speed[:-width]), np.ones(gained.size)])
    ratio, lag, *_ = np.linalg.lstsq(table, other[width:-width], rcond=None)[0].tolist()
    fastest = (2.0 * np.pi / (_PER_PERIOD * float(np.median(np.diff(time))))) ** 2
    return _usual_ratio(ratio), min(-1.0 / lag, fastest) if lag < 0.0 else fastest


def _usual_ratio(ratio: float) -> float:
    """A ratio with few digits; of a gear that of whole numbers, where it is one as accurately as the data show."""
    times = ratio if abs(ratio) > 1.0 else 1.0 / ratio
    whole = round(times)
    if abs(times / whole - 1.0) < _WHOLE:
        return float(whole) if times == ratio else 1.0 / whole
    return float(f"{ratio:.6g}")


def _noise(records: Sequence[Record], output: str) -> dict[str, float]:
    values = [
        white_noise(column[np.isfinite(column)])
        for record in records
        for column in [record.output[:, record.column(output)]]
        if np.isfinite(column).sum() > _FEWEST
    ]
    noise = float(np.median(values)) if values else 0.0
    return {"noise": _rounded(noise)} if noise > 0.0 else {}


def _rough_values(records: Sequence[Record], loop: str) -> tuple[float, float]:
    """Acceleration per command and per velocity, both at least of the size that the motion has.

    Over windows of the record the change of the velocity is what command, viscous and dry friction and a constant force
    have done in it; of a loop, the error of what it controls.
    """
    rows, targets = [], []
    for record in records:
        time, velocity, position = _motion(record)
        if time.size < 4 * _FEWEST:
            continue
        place = np.clip(np.searchsorted(record.input_time, time, side="right") - 1, 0, None)
        command = np.nan_to_num(record.input[place])
        if loop:
            command = command - (position if loop == "position_loop" else velocity)
        width = max(time.size // _WINDOWS, 1)
        edges = np.arange(0, time.size, width)
        step = np.diff(time, append=time[-1])
        motion = np.sign(velocity) * (np.abs(velocity) > 0.02 * np.max(np.abs(velocity), initial=0.0))
        sums = [np.add.reduceat(one * step, edges)[:-1] for one in (command, -velocity, -motion, np.ones_like(time))]
        rows.append(np.column_stack(sums))
        targets.append(np.diff(velocity[edges]))
    if not rows:
        return 1.0, 1.0
    table, target = np.vstack(rows), np.concatenate(targets)
    size = np.maximum(np.linalg.norm(table, axis=0), 1e-300)
    gain, friction, *_ = np.linalg.lstsq(table / size, target, rcond=1e-10)[0] / size
    duration = float(np.median([record.duration for record in records]))
    usual = float(np.linalg.norm(target)) / size
    gain = gain if gain > 0.0 and np.isfinite(gain) else float(usual[0]) or 1.0
    friction = friction if friction > 0.0 and np.isfinite(friction) else 1.0 / max(duration, 1e-9)
    return float(gain), float(friction)


def _motion(record: Record) -> tuple[Array, Array, Array]:
    """Stamps, velocity and position, each from its sensor or from the other."""
    for field in ("velocity", "position"):
        for name, column in zip(record.output_names, record.output.T, strict=True):
            known = np.isfinite(column)
            if not name.endswith(f".{field}") or known.sum() < 4 * _FEWEST:
                continue
            time, value = record.time[known], column[known]
            if field == "velocity":
                place = np.concatenate([[0.0], np.cumsum(0.5 * (value[1:] + value[:-1]) * np.diff(time))])
                for other, measured in zip(record.output_names, record.output.T, strict=True):
                    if other.endswith(".position") and np.isfinite(measured[known]).all():
                        place = measured[known]
                return time, value, place
            width = max(time.size // (4 * _WINDOWS), 1)
            span = time[2 * width :] - time[: -2 * width]
            return time[width:-width], (value[2 * width :] - value[: -2 * width]) / span, value[width:-width]
    return np.empty(0), np.empty(0), np.empty(0)


def _rounded(value: float) -> float:
    """Three digits are enough to start with."""
    return float(f"{value:.3g}")
