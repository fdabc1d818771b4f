"""One topic of a bag as arrays."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from idloop.errors import InputError
from idloop.records.finding import Finding
from idloop.spelling import did_you_mean, listed

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

JOINT_STATE = "sensor_msgs/msg/JointState"
FIELDS = ("position", "velocity", "effort")


@dataclass(frozen=True, eq=False)
class JointStream:
    """All messages of one topic, joints as columns; NaN where a message does not carry a value.

    Parameters
    ----------
    topic : str
        Topic name as in the bag.
    stamp_ns, receive_ns : ndarray of int64, shape (n,)
        Header stamp and receive time in nanoseconds, in the order of reception. Where the messages carry no
        stamp, `stamp_ns` equals `receive_ns` and `stamped` is False.
    names : tuple of str
        Joint names in the order of first appearance. Of other message types: the paths of their numeric
        fields (``wrench.force.x``); of bare numbers their positions ``"0"``, ``"1"``, ...
    position, velocity, effort : ndarray of float64, shape (n, j)
        Values per joint. Messages of other types carry one value per name: all three are then the same array.
    type : str
        Message type.
    stamped : bool
        Whether `stamp_ns` comes from the messages themselves.
    findings : tuple of Finding
        What was noticed while reading.
    """

    topic: str
    stamp_ns: NDArray[np.int64]
    receive_ns: NDArray[np.int64]
    names: tuple[str, ...]
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    effort: NDArray[np.float64]
    type: str = JOINT_STATE
    stamped: bool = True
    findings: tuple[Finding, ...] = ()

    def __len__(self) -> int:
        return int(self.stamp_ns.size)

    @property
    def is_joint_state(self) -> bool:
        """Whether the names are joints, with three different fields."""
        return self.type == JOINT_STATE

    def take(self, rows: slice | NDArray[np.int64]) -> JointStream:
        """Return some of the messages."""
        return replace(
            self,
            stamp_ns=self.stamp_ns[rows],
            receive_ns=self.receive_ns[rows],
            position=self.position[rows],
            velocity=self.velocity[rows],
            effort=self.effort[rows],
        )

    def columns(self) -> dict[str, NDArray[np.float64]]:
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

    def column(self, joint: str, field: str) -> NDArray[np.float64]:
        """Return the values of one joint's field, shape (n,).

        Parameters
        ----------
        joint : str
            Joint name. A stream with a single unnamed value (``std_msgs/Float64``) serves any joint; of a
            bare array the position ``"0"``, ``"1"``, ... picks the column.
        field : str
            ``position``, ``velocity`` or ``effort``; without meaning for other types than JointState.

        Raises
        ------
        InputError
            Unknown joint or field.
        """
        if field not in FIELDS:
            raise InputError(
                f"{self.topic}: no field {field!r}; fields are {listed(FIELDS)}{did_you_mean(field, FIELDS)}"
            )
        values: NDArray[np.float64] = getattr(self, field)
        if joint in self.names:
            return values[:, self.names.index(joint)]
        if not self.is_joint_state and len(self.names) == 1:
            return values[:, 0]
        kind = "joint" if self.is_joint_state else "value"
        raise InputError(
            f"{self.topic}: no {kind} {joint!r} ({self.type}); it has"
            f" {listed(self.names)}{did_you_mean(joint, self.names)}"
        )
