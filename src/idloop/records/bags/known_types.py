"""Message types of ros2_control, for bags that do not define them, as those of ROS 2 Humble in sqlite3.

Fields after control_msgs (https://github.com/ros-controls/control_msgs), whose controller state has changed: a bag's
messages tell which form they have, by their length.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

_HEAD = "std_msgs/Header header\nstring[] joint_names\n"
_POINT = "trajectory_msgs/JointTrajectoryPoint {}\n"
_MANY = "trajectory_msgs/MultiDOFJointTrajectoryPoint multi_dof_{}\n"
_VALUE = f"{80 * '='}\nMSG: control_msgs/InterfaceValue\nstring[] interface_names\nfloat64[] values\n"
_NEW, _OLD = ("reference", "feedback", "error", "output"), ("desired", "actual")


def _controller_state(*names: str, many: tuple[str, ...] = ()) -> str:
    text = _HEAD + "".join(map(_POINT.format, names))
    return text + ("string[] multi_dof_joint_names\n" + "".join(map(_MANY.format, many)) if many else "")


# Type: forms of its definition, the newest first.
FORMS: Mapping[str, tuple[str, ...]] = {
    "control_msgs/msg/DynamicJointState": (_HEAD + f"control_msgs/InterfaceValue[] interface_values\n{_VALUE}",),
    "control_msgs/msg/JointTrajectoryControllerState": (
        _controller_state(*_NEW, many=_NEW),
        _controller_state(*_NEW, *_OLD, many=(*_NEW, *_OLD)),
        _controller_state("desired", "actual", "error"),
    ),
}


def form_of(message_type: str, types: Mapping[str, Any], message: bytes | None) -> dict[str, Any]:
    """Return the definition of a type, in the form that fits a message of it; nothing where none does.

    `types`: types known otherwise.
    `message`: the first message in CDR; without one the newest form is taken.
    """
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    for text in FORMS.get(message_type, ()):
        found = dict(get_types_from_msg(text, message_type))
        if message is None:
            return found
        store = get_typestore(Stores.EMPTY)
        store.register({**types, **found})
        try:
            store.deserialize_cdr(message, message_type)
        except Exception:  # noqa: BLE001, S112 - of another form
            continue
        return found
    return {}
