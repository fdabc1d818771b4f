"""What the node `recorder` does, its streams, services and parameters."""

from __future__ import annotations

from idloop_nodes.descriptions.common import COMMON, RELIABLE
from idloop_nodes.descriptions.node_description import NodeDescription
from idloop_nodes.parameters import Table, fixed, number, seconds, text, texts, whole
from idloop_nodes.topics import RECORDED

PARAMETERS: Table = (
    *COMMON,
    RELIABLE,
    *fixed(
        texts("topics", RECORDED, "What to record."),
        text("bag", "", "Folder of the recording; refused when it exists. Empty: named by time."),
        text("directory", "bags", "Where recordings named by time go."),
        text("prefix", "run", "First part of a name by time."),
    ),
    # The index of a file is in memory until the file ends: without an end it would grow by 0.1 GB in an hour at 1 kHz.
    number("split_size", 1000.0, "New file after this much data; 0 never.", unit="MB", minimum=0.0),
    seconds("split_duration", 0.0, "New file after this long; 0 never."),
    whole("queue_limit", 500_000, "Messages that may wait for the disk; more are dropped and counted.", minimum=1000),
)

DESCRIPTION = NodeDescription(
    about="Writes every message as it came into a rosbag2 directory (mcap, 16 KiB chunks) and counts every loss.",
    parameters=lambda: PARAMETERS,
    subscribes=RECORDED,
    example="-p bag:=bags/first",
)
