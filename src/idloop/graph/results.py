"""What a recorded live estimator found: the newest fit and its parameters, without ROS."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from idloop.errors import IdloopError

_TYPE = "diagnostic_msgs/msg/DiagnosticArray"


@dataclass(frozen=True)
class LiveResult:
    """The last result of a run.

    Attributes
    ----------
    fit : dict
        FIT per output in percent, on samples that the fit did not use.
    fit_train : dict
        FIT per output in percent, on the samples that it used.
    parameters : dict
        By name: value, stderr (or None), unit.
    fits : int
        How many fits there were.
    error : str
        Why the last fit failed; empty when it did not.
    """

    fit: dict[str, float] = field(default_factory=dict)
    fit_train: dict[str, float] = field(default_factory=dict)
    parameters: dict[str, dict[str, Any]] = field(default_factory=dict)
    fits: int = 0
    error: str = ""


def read_results(bag: Path) -> LiveResult:
    """Read the estimator's last result from a bag.

    Raises
    ------
    IdloopError
        When the bag cannot be read.
    """
    from rosbags.highlevel import AnyReader, AnyReaderError
    from rosbags.typesys import Stores, get_typestore

    newest: dict[str, Any] = {}
    fits = 0
    try:
        with AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_KILTED)) as reader:
            wanted = [
                one
                for one in reader.connections
                if one.msgtype == _TYPE and one.topic.endswith(("estimator/fit", "estimator/parameters"))
            ]
            # without connections the reader would go through everything
            for connection, _, data in reader.messages(wanted) if wanted else ():
                name = connection.topic.rsplit("/", 1)[-1]
                newest[name] = reader.deserialize(data, connection.msgtype)
                fits += name == "fit"
    except (AnyReaderError, OSError) as error:
        raise IdloopError(f"{bag}: cannot be read: {error}") from error
    if "fit" not in newest:
        return LiveResult()
    values = _values(newest["fit"].status[0])
    parameters: dict[str, dict[str, Any]] = {}
    for status in newest["parameters"].status if "parameters" in newest else ():
        one = _values(status)
        stderr = float(one["stderr"]) if one["stderr"] else None
        parameters[one["parameter"]] = {"value": float(one["value"]), "stderr": stderr, "unit": one["unit"]}
    return LiveResult(
        fit=_numbers(values, "fit/"),
        fit_train=_numbers(values, "train/"),
        parameters=parameters,
        fits=fits,
        error=values["error"],
    )


def _values(status: Any) -> dict[str, str]:
    return {one.key: one.value for one in status.values}


def _numbers(values: dict[str, str], prefix: str) -> dict[str, float]:
    return {key.removeprefix(prefix): float(value) for key, value in values.items() if key.startswith(prefix)}
