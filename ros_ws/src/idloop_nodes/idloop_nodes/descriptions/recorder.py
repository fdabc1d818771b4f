"""What the node `recorder` does, its streams, services and parameters."""

from __future__ import annotations

from idloop_nodes.descriptions.common import COMMON, RELIABLE
from idloop_nodes.descriptions.node_description import NodeDescription
from idloop_nodes.parameters import NodeParameter as P
from idloop_nodes.parameters import Table
from idloop_nodes.topics import RECORDED

PARAMETERS: Table = (
    *COMMON,
    RELIABLE,
    P("topics", "strs", RECORDED, "What to record.", read_only=True),
    P("bag", "str", "", "Folder of the recording; refused when it exists. Empty: named by time.", read_only=True),
    P("directory", "str", "bags", "Where recordings named by time go.", read_only=True),
    P("prefix", "str", "run", "First part of a name by time.", read_only=True),
    # The index of a file is in memory until the file ends: without an end it would grow by 0.1 GB in an hour at 1 kHz.
    P("split_size", "float", 1000.0, "New file after this much data; 0 never.", unit="MB", minimum=0.0),
    P("split_duration", "float", 0.0, "New file after this long; 0 never.", unit="s", minimum=0.0),
    P(
        "queue_limit",
        "int",
        500_000,
        "Messages that may wait for the disk; more are dropped and counted.",
        minimum=1000,
    ),
)

DESCRIPTION = NodeDescription(
    about="Writes every message as it came into a rosbag2 directory (mcap, 16 KiB chunks) and counts every loss.",
    parameters=lambda: PARAMETERS,
    subscribes=RECORDED,
    example="-p bag:=bags/first",
)
