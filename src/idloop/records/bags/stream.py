"""One topic of a bag as arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from idloop.errors import InputError
from idloop.records.finding import Finding
from idloop.spelling import check_known, listed

if TYPE_CHECKING:
    from idloop.arrays import Array, Integers

JOINT_STATE = "sensor_msgs/msg/JointState"
FIELDS = ("position", "velocity", "effort")


@dataclass(frozen=True, eq=False)
class JointStream:
    """All messages of one topic, joints as columns; NaN where a message does not carry a value."""

    topic: str  # topic name as in the bag
    # shape (n,): header stamp and receive time in nanoseconds, in the order of reception. Where the messages carry no
    # stamp, `stamp_ns` equals `receive_ns` and `stamped` is False.
    stamp_ns: Integers
    receive_ns: Integers
    # Joint names in the order of first appearance. Of other message types: the paths of their numeric fields
    # (``wrench.force.x``); of bare numbers their positions ``"0"``, ``"1"``, ...
    names: tuple[str, ...]
    # shape (n, j): values per joint. Messages of other types carry one value per name: all three are then the same
    # array.
    position: Array
    velocity: Array
    effort: Array
    type: str = JOINT_STATE  # message type
    stamped: bool = True  # whether `stamp_ns` comes from the messages themselves
    findings: tuple[Finding, ...] = ()  # what was noticed while reading
    # Names by the place of their numbers in a message, such as ``interface_values[1].values[0]``, where it is the same
    # in all messages
    paths: Mapping[str, str] = field(default_factory=dict)

    def __len__(self) -> int:
        return int(self.stamp_ns.size)

    @property
    def is_joint_state(self) -> bool:
        """Whether the names are joints, with three different fields."""
        return self.type == JOINT_STATE

    def take(self, rows: slice | Integers) -> JointStream:
        """Return some of the messages."""
        return replace(
            self,
            stamp_ns=self.stamp_ns[rows],
            receive_ns=self.receive_ns[rows],
            position=self.position[rows],
            velocity=self.velocity[rows],
            effort=self.effort[rows],
        )

    def columns(self) -> dict[str, Array]:
        """Return the columns that hold a number, by ``joint.field``, or by path for other types."""
        import numpy as np  # here, for a node that needs only the names above starts without it

        if not self.is_joint_state:
            return {name: self.position[:, index] for index, name in enumerate(self.names)}
        named = (
            (f"{joint}.{field}", getattr(self, field)[:, index])
            for index, joint in enumerate(self.names)
            for field in FIELDS
        )
        return {name: column for name, column in named if not np.isnan(column).all()}

    def column(self, joint: str, field: str) -> Array:
        """Return the values of one joint's field, shape (n,).

        `joint`: name. A stream with a single unnamed value (``std_msgs/Float64``) serves any joint; of a bare array the
        position ``"0"``, ``"1"``, ... picks the column.
        `field`: ``position``, ``velocity`` or ``effort``; of types that name their numbers by joints, such as
        control_msgs/DynamicJointState, any of those; without meaning for other types.
        Raises InputError: unknown joint or field.
        """
        if not self.is_joint_state:
            found = [name for name in (f"{joint}.{field}", joint) if name in self.names]
            if not found and len(self.names) != 1:
                self._check_has("value", joint)
            return self.position[:, self.names.index(found[0]) if found else 0]
        check_known(field, FIELDS, f"{self.topic}: no field")
        self._check_has("joint", joint)
        values: Array = getattr(self, field)
        return values[:, self.names.index(joint)]

    def _check_has(self, what: str, name: str) -> None:
        check_known(name, self.names, f"{self.topic} ({self.type}): no {what}")

    def number(self, joint: str, field: str) -> Array:
        """Return one number of each message as a mapping file names it, shape (n,).

        `joint`: owner of the number; "" where there is only one, or the type has none.
        `field`: ``position`` (also ""), ``velocity`` or ``effort`` of a JointState. Of other types a field of the
        joint, such as ``feedback.positions``, or the place of a number: ``wrench.force.x``, ``data[0]``,
        ``interface_values[1].values[0]``; "" for the only number.
        Raises InputError: no such joint or field, or several joints have this field.
        """
        if self.is_joint_state:
            return self.column(joint or (self.names[0] if len(self.names) == 1 else ""), field or FIELDS[0])
        if not field and len(self.names) == 1:
            return self.position[:, 0]
        bare = field.removeprefix("data").strip("[]")
        owners = [name for name in self.names if field and name.endswith(f".{field}")]
        only = owners[0] if len(owners) == 1 and not joint else ""
        tried = f"{joint}.{field}", "" if joint else field, self.paths.get(field, ""), bare, only or bare or "0"
        found = next((name for name in tried if name in self.names), f"{joint}.{field}" if joint else field)
        if owners and not joint and found not in self.names:
            raise InputError(
                f"{self.topic}: several joints have {field} ({listed(owners)}); name one as `source_joint:`"
            )
        self._check_has("field", found)
        return self.position[:, self.names.index(found)]
