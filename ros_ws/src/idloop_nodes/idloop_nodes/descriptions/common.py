"""Rows that several nodes share."""

from __future__ import annotations

from idloop_nodes.parameters import Table, fixed, flag, number, seconds, text, texts, whole
from idloop_nodes.progress import REPORT_EVERY

MODES = ("lockstep", "realtime")

MODE = text(
    "mode",
    "lockstep",
    "lockstep: deterministic, as fast as the machine allows; realtime: against the wall clock.",
    choices=MODES,
    read_only=True,
)
SAMPLE_TIME = seconds("sample_time", 0.001, "Period of the loop.", minimum=1e-4, maximum=10.0, read_only=True)
PEERS = texts(
    "peers",
    (),
    "Kinds of nodes in this graph; each waits until its streams are matched with all of them.",
    read_only=True,
)
START_TIMEOUT = seconds(
    "start_timeout",
    30.0,
    "Longest wait for peers that do not appear; those that are there (a first start compiles) have 20 times as long.",
    minimum=0.1,
    read_only=True,
)
MODEL = text("model", "dc_motor", "Model: name of a preset or path of a model file.")
EFFECTS = texts("effects", (), "Effects added to the model: name@site or name@site(parameter=value,...).")
AUTOSTART = flag("autostart", True, "Configure and activate at the start.", read_only=True)
WINDOW = whole(
    "listener_window",
    1000,
    "Samples that a listener may lag behind before the loop waits for it.",
    minimum=REPORT_EVERY,
    maximum=4000,
    read_only=True,
)
LISTENERS = texts("listeners", (), "Names of the nodes that must not lose a sample (lock-step).", read_only=True)
DRAIN_TIMEOUT = seconds("drain_timeout", 300.0, "Longest wait, at the end, for listeners to finish their work.")
RELIABLE = flag(
    "reliable",
    True,
    "Ask for every joint state; false for publishers that send them best effort: then samples may be lost.",
    read_only=True,
)
COMMON: Table = (MODE, SAMPLE_TIME, PEERS, START_TIMEOUT)

MACHINE: Table = (
    *fixed(
        seconds("duration", 0.0, "Length of the run; 0 runs until stopped."),
        seconds("start_time", 1.0, "Stamp of the first sample (lock-step)."),
        whole("seed", 0, "Seed of noise and disturbance.", minimum=0, maximum=2**53),
        flag("noise", True, "Measurement noise on or off."),
        number("clock_rate", 100.0, "Simulated rate of /clock (lock-step).", unit="Hz", minimum=1.0),
        number(
            "real_time_factor",
            0.0,
            "Lock-step: simulated seconds in a second of the wall clock, at most; 0 as many as the machine allows.",
            minimum=0.0,
        ),
    ),
    seconds("command_timeout", 0.2, "Real time: command falls to zero after this silence."),
    LISTENERS,
    WINDOW,
    DRAIN_TIMEOUT,
)
