"""What a bag holds of the estimator's diagnostics, message by message, without ROS."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any, TypeAlias

from idloop.errors import IdloopError
from idloop.records.bags.bag_limits import limit_bag_readers

_TYPE = "diagnostic_msgs/msg/DiagnosticArray"

Statuses: TypeAlias = tuple[dict[str, str], ...]


def read_diagnostics(bag: Path, names: Iterable[str]) -> list[tuple[str, Statuses]]:
    """Read some of the estimator's topics from a bag, in the order of the recording.

    Parameters
    ----------
    bag : Path
    names : iterable of str
        Last parts of the topics, such as ``fit`` for ``estimator/fit`` in any namespace.

    Returns
    -------
    list of (str, tuple of dict)
        Which topic, and the values of each of the message's statuses by their keys.

    Raises
    ------
    IdloopError
        When the bag cannot be read.
    """
    from rosbags.highlevel import AnyReader, AnyReaderError
    from rosbags.typesys import Stores, get_typestore

    limit_bag_readers()
    ends = tuple(f"estimator/{name}" for name in names)
    found = []
    try:
        with AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_KILTED)) as reader:
            wanted = [one for one in reader.connections if one.msgtype == _TYPE and one.topic.endswith(ends)]
            # without connections the reader would go through everything
            for connection, _, data in reader.messages(wanted) if wanted else ():
                message: Any = reader.deserialize(data, connection.msgtype)
                statuses = tuple({one.key: one.value for one in status.values} for status in message.status)
                found.append((connection.topic.rsplit("/", 1)[-1], statuses))
    except (AnyReaderError, OSError, LookupError, ValueError) as error:
        raise unreadable(bag, error) from error
    return found


def unreadable(bag: Path, error: Exception) -> IdloopError:
    """Say that a bag, or a message in it, is not what the estimator records."""
    return IdloopError(f"{bag}: cannot be read: {error}")
