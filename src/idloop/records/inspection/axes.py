"""The joints of a recording, each with its command."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from idloop.arrays import Array
from idloop.records.bags.publishers import Publishers, find_publishers
from idloop.records.bags.stream import JointStream
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.clocks import stamp_statistics
from idloop.records.inspection.excitation import Excitation
from idloop.records.inspection.motion import Motion
from idloop.records.inspection.values import unusable_magnitude

_MOTIONS = ("position", "velocity")


def once_per_stamp(stream: JointStream, start_ns: int | None = None) -> tuple[Array, dict[str, Array]]:
    """Time [s] from `start_ns` on, by default the first stamp, and columns; of two with one stamp the first counts."""
    stamp, first = np.unique(stream.stamp_ns, return_index=True)
    start = stamp[0] if start_ns is None else start_ns
    return (stamp - start) * 1e-9, {name: column[first] for name, column in stream.columns().items()}


def axes_of(
    measured: Mapping[str, JointStream],
    motions: Mapping[str, Mapping[str, Motion]],
    command: JointStream | None,
    commands: Mapping[str, Excitation],
    units: Mapping[str, str],
    *,
    start_ns: int,
    has_reference: bool,
    joined: bool = False,
) -> list[Axis]:
    """Return the joints that move, of streams whose clock runs forward.

    `measured`: by topic.
    `motions`: of their signals, by topic and ``joint.field``.
    `commands`: of its signals.
    `units`: by ``joint.field``.
    `start_ns`: zero of the times.
    `joined`: whether the recording was put together from several files.
    """
    found: dict[str, Axis] = {}
    two_commands, sent = (None, None) if command is None else _forward(command, start_ns)
    for topic, stream in measured.items():
        two, read = _forward(stream, start_ns)
        signals = motions.get(topic, {})
        good = {name for name, one in signals.items() if not unusable_magnitude(name, one.minimum, one.maximum)}
        moving = {name for name, one in signals.items() if name in good and one.moves and name.endswith(_MOTIONS)}
        joints = list(dict.fromkeys(name.rpartition(".")[0] for name in signals if name in moving))
        if read is None:
            continue
        time, columns = read
        for joint in [one for one in joints if one not in found]:
            names = {field: f"{joint}.{field}" for field in _MOTIONS}
            own = {field: _finite(columns[name]) if name in good else None for field, name in names.items()}
            name = _command_of(joint, len(joints), commands)
            given = {} if sent is None or not name else {"input_time": sent[0], "command": _finite(sent[1][name])}
            axis = Axis(
                joint,
                time,
                own["position"],
                own["velocity"],
                **given,  # type: ignore[arg-type]
                command_name=name if given else "",
                units=units,
                has_reference=has_reference,
                joined=joined,
                measured_stream=stream,
                command_stream=command,
                publishers=tuple(one for one in (two_commands, two) if one is not None),
            )
            found[joint] = axis.without_bad_readings()
    return list(found.values())


def _forward(stream: JointStream, start_ns: int) -> tuple[Publishers | None, tuple[Array, dict[str, Array]] | None]:
    """Two publishers, and time and columns of the more frequent one; None where the clock was set back."""
    two = find_publishers(stream)
    main = stream if two is None else stream.take(np.flatnonzero(~two.second))
    return two, None if stamp_statistics(main.stamp_ns).resets else once_per_stamp(main, start_ns)


def _finite(value: Array) -> Array:
    return np.where(np.isfinite(value), value, np.nan)


def _command_of(joint: str, joints: int, commands: Mapping[str, Excitation]) -> str:
    """Return the command of a joint: that of its name, the force first, or the only one where only one joint moves."""
    own = [name for name in commands if name.rpartition(".")[0] == joint]
    if own:
        return max(own, key=lambda name: (name.endswith(".effort"), commands[name].rms))
    varying = [name for name, one in commands.items() if one.levels > 1] or list(commands)
    return varying[0] if joints == 1 and len(varying) == 1 else ""
