"""Rows that several nodes share."""

from __future__ import annotations

from idloop_nodes.parameters import NodeParameter as P
from idloop_nodes.parameters import Table
from idloop_nodes.progress import REPORT_EVERY

MODES = ("lockstep", "realtime")

MODE = P(
    "mode",
    "str",
    "lockstep",
    "lockstep: deterministic, as fast as the machine allows; realtime: against the wall clock.",
    choices=MODES,
    read_only=True,
)
SAMPLE_TIME = P(
    "sample_time", "float", 0.001, "Period of the loop.", unit="s", minimum=1e-4, maximum=10.0, read_only=True
)
PEERS = P(
    "peers",
    "strs",
    (),
    "Kinds of nodes in this graph; each waits until its streams are matched with all of them.",
    read_only=True,
)
START_TIMEOUT = P(
    "start_timeout",
    "float",
    30.0,
    "Longest wait for peers that do not appear; those that are there (a first start compiles) have 20 times as long.",
    unit="s",
    minimum=0.1,
    read_only=True,
)
MODEL = P("model", "str", "dc_motor", "Model: name of a preset or path of a model file.")
EFFECTS = P("effects", "strs", (), "Effects added to the model: name@site or name@site(parameter=value,...).")
AUTOSTART = P("autostart", "bool", True, "Configure and activate at the start.", read_only=True)
WINDOW = P(
    "listener_window",
    "int",
    1000,
    "Samples that a listener may lag behind before the loop waits for it.",
    minimum=REPORT_EVERY,
    maximum=4000,
    read_only=True,
)
LISTENERS = P("listeners", "strs", (), "Names of the nodes that must not lose a sample (lock-step).", read_only=True)
DRAIN_TIMEOUT = P(
    "drain_timeout",
    "float",
    300.0,
    "Longest wait, at the end, for listeners to finish their work.",
    unit="s",
    minimum=0.0,
)
RELIABLE = P(
    "reliable",
    "bool",
    True,
    "Ask for every joint state; false for publishers that send them best effort: then samples may be lost.",
    read_only=True,
)
COMMON: Table = (MODE, SAMPLE_TIME, PEERS, START_TIMEOUT)

MACHINE: Table = (
    P("duration", "float", 0.0, "Length of the run; 0 runs until stopped.", unit="s", minimum=0.0, read_only=True),
    P("start_time", "float", 1.0, "Stamp of the first sample (lock-step).", unit="s", minimum=0.0, read_only=True),
    P("seed", "int", 0, "Seed of noise and disturbance.", minimum=0, maximum=2**53, read_only=True),
    P("noise", "bool", True, "Measurement noise on or off.", read_only=True),
    P("clock_rate", "float", 100.0, "Simulated rate of /clock (lock-step).", unit="Hz", minimum=1.0, read_only=True),
    P(
        "real_time_factor",
        "float",
        0.0,
        "Lock-step: simulated seconds in a second of the wall clock, at most; 0 as many as the machine allows.",
        minimum=0.0,
        read_only=True,
    ),
    P("command_timeout", "float", 0.2, "Real time: command falls to zero after this silence.", unit="s", minimum=0.0),
    LISTENERS,
    WINDOW,
    DRAIN_TIMEOUT,
)
