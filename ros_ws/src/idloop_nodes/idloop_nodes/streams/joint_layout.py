"""Between the model's signals and the columns of JointState messages."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from idloop.errors import InputError
from idloop_nodes.codec import JointWriter
from idloop_nodes.codec.joints import FIELDS, NAN

if TYPE_CHECKING:
    from idloop.physics import Model


class OutputPacker:
    """Packs a model's outputs into one JointState: NaN where a joint's field is not measured.

    `outputs`: outputs in the model's order.
    """

    def __init__(self, outputs: Sequence[tuple[str, str]]) -> None:
        joints = list(dict.fromkeys(joint for joint, _ in outputs))
        fields = [field for field in FIELDS if any(one == field for _, one in outputs)]
        self._columns = [[NAN] * len(joints) for _ in fields]
        self._places = [(fields.index(field), joints.index(joint)) for joint, field in outputs]
        self._as_given = self._places == [(0, joint) for joint in range(len(joints))]
        self._writer = JointWriter(joints, fields)

    def pack(self, stamp_ns: int, values: Sequence[float]) -> bytes:
        """Return the message of one measurement, `values` in the model's order."""
        if self._as_given:
            return self._writer.pack(stamp_ns, values)
        columns = self._columns
        for (column, joint), value in zip(self._places, values, strict=True):
            columns[column][joint] = value
        return self._writer.pack(stamp_ns, *columns)


def output_columns(model: Model) -> list[tuple[str, str]]:
    """Return (joint, field) of every output.

    Raises InputError: when the outputs lie on several topics.
    """
    topics = {output.topic for output in model.outputs}
    if len(topics) > 1:
        raise InputError(
            f"model {model.name}: the nodes take all outputs from one topic, not {', '.join(sorted(topics))}; "
            "give them one topic in the model file"
        )
    return [(output.joint, output.field) for output in model.outputs]


def output_topic(model: Model) -> str:
    """Return the topic of the model's outputs."""
    return str(model.outputs[0].topic)
