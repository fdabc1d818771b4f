"""Message types of a bag: those it defines, those of ROS 2, and those of ros2_control that bags may not define.

Fields of the latter after control_msgs (https://github.com/ros-controls/control_msgs), whose controller state has
changed: a bag's messages tell which form they have, by their length.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any

from idloop.errors import InputError
from idloop.records.bags.storage.ros1 import ros2_types
from idloop.records.bags.storage.storage_file import StorageFile
from idloop.records.bags.storage.unpacking import one_line
from idloop.records.bags.topics import Topic

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

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


def build_typestore(
    distro: str,
    definitions: Mapping[str, str],
    files: Iterable[StorageFile],
    topics: Iterable[Topic],
    first_message: Callable[[str], bytes | None],
) -> Typestore:
    """Return the types of a bag, over those of a ROS distribution.

    `definitions`: of further types, name to text of the ``.msg`` file.
    `first_message`: of a topic.
    Raises InputError: a definition cannot be parsed.
    """
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    types: dict[str, Any] = dict(get_typestore(Stores(f"ros2_{distro}")).fielddefs)
    for name, text in definitions.items():
        try:
            types.update(get_types_from_msg(text, name))
        except Exception as error:  # noqa: BLE001 - any parsing error means a damaged file
            raise InputError(f"definition of {name}: not a valid .msg text ({one_line(error)})") from None
    for file in files:
        for connection in file.connections:
            own = _own_types(connection)
            types.update(ros2_types(own) if file.ros1 else own)
    for topic in topics:
        if topic.type not in types and topic.type in FORMS:
            types.update(_form_of(topic.type, types, first_message(topic.name)))
    # A type that refers to an unknown one would make the whole store fail: leave such types out.
    while incomplete := [name for name, (_, fields) in types.items() if not _references(fields) <= types.keys()]:
        for name in incomplete:
            del types[name]
    store = get_typestore(Stores.EMPTY)
    store.register(types)
    return store


def _own_types(connection: Any) -> dict[str, Any]:
    """Return the types that the bag itself defines for a connection; none when the text cannot be parsed."""
    from rosbags.interfaces import MessageDefinitionFormat
    from rosbags.typesys import get_types_from_idl, get_types_from_msg

    definition, found = connection.msgdef, dict[str, Any]()
    if not definition.data.strip():  # a recovered topic of unknown type
        return found
    try:
        if definition.format == MessageDefinitionFormat.MSG:
            found = dict(get_types_from_msg(definition.data, connection.msgtype))
        elif definition.format == MessageDefinitionFormat.IDL:
            for part in definition.data.split("=" * 80 + "\n"):
                text = part.split("\n", 1)[1] if part.startswith("IDL: ") else part
                found |= get_types_from_idl(text) if text.strip() else {}
    except Exception:  # noqa: BLE001 - one unreadable definition must not stop the reading of the other topics
        return {}
    return found


def _form_of(message_type: str, types: Mapping[str, Any], message: bytes | None) -> dict[str, Any]:
    """Return the definition of a type in the form that fits a message of it in CDR; without one, in the newest."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    for text in FORMS[message_type]:
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


def _references(fields: Iterable[tuple[str, Any]]) -> set[str]:
    """Names of the types of some fields."""
    from rosbags.interfaces import Nodetype

    nodes = [node for _, node in fields]
    nodes = [args[0] if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE) else (kind, args) for kind, args in nodes]
    return {args for kind, args in nodes if kind == Nodetype.NAME}
