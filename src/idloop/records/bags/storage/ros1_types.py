"""Messages of ROS 1 as those of ROS 2: the same fields, a header without its sequence number."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

# Of ROS 2: the conversion to CDR passes over the sequence number of ROS 1.
_OWN = ("std_msgs/msg/Header", "builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")


def ros2_types(types: dict[str, Any]) -> dict[str, Any]:
    """Return the types of a definition of ROS 1 without those that ROS 2 has its own of."""
    return {name: fields for name, fields in types.items() if name not in _OWN}


def ros1_typestore(message_type: str, definition: str) -> tuple[str, Typestore]:
    """Return the name that a type has in ROS 2, and a store that knows it.

    Raises Exception: any, where the definition cannot be parsed.
    """
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    from rosbags.typesys.msg import normalize_msgtype

    name = normalize_msgtype(message_type)
    base = get_typestore(Stores.LATEST).fielddefs
    store = get_typestore(Stores.EMPTY)
    store.register({**base, **ros2_types(dict(get_types_from_msg(definition, name)))})
    return name, store
