"""Every parameter of every node: the one place that declaration, checks and documentation read."""

from __future__ import annotations

from functools import cache

from idloop_nodes.parameters import NodeParameter as P
from idloop_nodes.parameters import Table
from idloop_nodes.progress import REPORT_EVERY
from idloop_nodes.safety.bridge_table import bridge_table
from idloop_nodes.wiring import RECORDED
from idloop_nodes.workbench_page.workbench_table import workbench_table

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
AUTOSTART = P("autostart", "bool", True, "Configure and activate by itself.", read_only=True)
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
COMMON: Table = (MODE, SAMPLE_TIME, PEERS, START_TIMEOUT)

_MACHINE: Table = (
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

PLANT: Table = (
    *COMMON,
    P(MODEL.name, "str", MODEL.default, MODEL.description, read_only=True),
    P(EFFECTS.name, "strs", (), "Hidden effects: " + EFFECTS.description, read_only=True),
    P(
        "disturbance_std",
        "float",
        0.0,
        "Standard deviation of the disturbance torque on the driven body, in the drive's unit.",
        minimum=0.0,
        read_only=True,
    ),
    P(
        "disturbance_time_constant",
        "float",
        1.0,
        "Correlation time of the disturbance.",
        unit="s",
        minimum=1e-3,
        read_only=True,
    ),
    *_MACHINE,
)

MUJOCO_PLANT: Table = (
    *COMMON,
    P("model", "str", "axis", "Model whose outputs are measured, with its units and noise.", read_only=True),
    P("mjcf", "str", "", "MuJoCo model (MJCF file) of the machine.", read_only=True),
    P(
        "joints",
        "strs",
        (),
        "Joint of the MJCF file for each joint that the model measures; empty: of the same name. "
        "An MJCF sensor with the name of an output, such as motor.position, goes before its joint.",
        read_only=True,
    ),
    P("actuator", "str", "", "Actuator of the MJCF file that takes the command; empty: the only one.", read_only=True),
    *_MACHINE,
)


def _compensation(name: str, text: str, unit: str = "") -> P:
    """A number of the compensator, chosen by itself where it is not set."""
    return P(f"compensation_{name}", "float", None, text, unit=unit, minimum=0.0, exclusive=True, read_only=True)


CONTROLLER: Table = (
    *COMMON,
    AUTOSTART,
    P("model", "str", "dc_motor", "Model whose input, outputs and controller section are used.", read_only=True),
    P(
        "controller",
        "str",
        "",
        "Controller as YAML flow text, for instance {type: pid, kp: 8.4, ...}; empty takes the model's.",
        read_only=True,
    ),
    P(
        "compensation",
        "str",
        "",
        "Model of the machine, as a fit or `idloop compensate --output` has written it, whose effects are cancelled "
        "beside the controller's law; empty: none.",
        read_only=True,
    ),
    P(
        "compensation_effects",
        "strs",
        (),
        "Effects of it that are cancelled: name or name@site; none: all that can be.",
        read_only=True,
    ),
    _compensation("limit", "Most that compensation adds to the command; not set: half of the controller's limit."),
    _compensation(
        "velocity_width",
        "Speed of the reference below which dry friction is cancelled in part; not set: what it gives the machine in "
        "two periods.",
    ),
    _compensation(
        "command_width",
        "Command below which a dead zone is crossed in part; not set: a quarter of its width, more where sensors are "
        "noisy.",
    ),
    _compensation("crossing_time", "Time in which a gap is crossed; not set: from 20 periods on.", unit="s"),
    P("use_reference", "bool", True, "Wait for and follow `reference`.", read_only=True),
    P("use_excitation", "bool", False, "Wait for and add `excitation`.", read_only=True),
    P("watchdog", "float", 0.05, "Real time: zero command after this silence.", unit="s", minimum=1e-3),
    P("phase", "float", 0.5, "Real time: when in the period the command is computed.", minimum=0.1, maximum=0.9),
)

RECORDER: Table = (
    *COMMON,
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

ESTIMATOR: Table = (
    *COMMON,
    MODEL,
    P(
        EFFECTS.name,
        "strs",
        (),
        EFFECTS.description + " Setting it refits with exactly these beside the model file's own.",
    ),
    P("window", "float", 20.0, "Length of the data a fit uses.", unit="s", minimum=0.05),
    P("validation", "float", 10.0, "Length of the data after it on which the fit is judged.", unit="s", minimum=0.05),
    P("fit_period", "float", 10.0, "Time between fits; 0 fits on request only.", unit="s", minimum=0.0),
    P(
        "criterion",
        "str",
        "auto",
        "What a fit minimises.",
        choices=("auto", "prediction", "simulation", "force"),
    ),
    P("recursive", "bool", True, "Predict every sample while parameters and state are estimated.", read_only=True),
    P(
        "recursion",
        "str",
        "none",
        "Black-box model that is estimated sample by sample beside the prediction; its innovations are published.",
        choices=("none", "rarx", "kalman", "ekf", "rarmax", "roe", "rbj", "rpem", "rplr"),
        read_only=True,
    ),
    P("recursion_order", "int", 2, "Degree of its polynomials.", minimum=1, maximum=20, read_only=True),
    P(
        "recursion_delay",
        "int",
        1,
        "Samples until a command shows in a measurement; 1 is none beyond that of sampling.",
        minimum=0,
        maximum=1000,
        read_only=True,
    ),
    P(
        "recursion_memory",
        "float",
        0.0,
        "Time constant with which it forgets old data; 0 keeps all.",
        unit="s",
        minimum=0.0,
        read_only=True,
    ),
    P("recursion_period", "float", 0.5, "Time between its published coefficients.", unit="s", minimum=1e-3),
    P("auto_diagnose", "bool", True, "Diagnose when the residual of the fits stops being white."),
    P("auto_add", "bool", False, "Add what a diagnosis finds missing, and diagnose again until nothing is left."),
    P("auto_experiment", "bool", False, "Let the excitation run the suggested experiment where effects tie."),
    P(
        "diagnose_window",
        "float",
        30.0,
        "Length of the newest data that a diagnosis uses; as for a fit, it is judged on the data after it.",
        unit="s",
        minimum=0.5,
    ),
    P("level", "float", 0.01, "Family-wise rate of false effects.", minimum=1e-6, maximum=0.5),
    P(
        "minimum_improvement",
        "float",
        0.01,
        "Part by which an effect must make the errors on unseen samples smaller to be named.",
        minimum=0.0,
        maximum=0.99,
    ),
    P("catalogue", "strs", (), "Effects that are looked for: name or name@site; none: the whole catalogue."),
    P(
        "evidence_period",
        "float",
        10.0,
        "Time between two looks at the evidence for effects that may be missing; each scores the samples since the one "
        "before. 0 never looks.",
        unit="s",
        minimum=0.0,
    ),
    P(
        "end_when_decided",
        "bool",
        False,
        "End the experiment (stop the excitation, emergency stop of bridge and controller) as soon as an effect is "
        "decided, or every estimate may be trusted; with auto_add or auto_experiment only when every estimate may be.",
    ),
    P(
        "trusted_stderr",
        "float",
        0.05,
        "Largest standard error of an estimate that may be trusted, as part of its value.",
        minimum=1e-6,
        maximum=1.0,
    ),
    P(
        "trusted_error",
        "float",
        2.0,
        "Largest rms error of the free run on unseen samples with which estimates may be trusted, in units of the "
        "sensor's noise.",
        minimum=1.0,
    ),
    P("seed", "int", 0, "Seed of the bootstrap; equal seeds give equal answers.", minimum=0, maximum=2**53),
    P("excitation_node", "str", "excitation", "Node that runs the suggested experiment.", read_only=True),
    P("controller_node", "str", "controller", "Node that is told to stop when the experiment ends.", read_only=True),
    P(
        "bridge_node",
        "str",
        "",
        "Bridge to a robot's motor, which is told to stop first; empty for none.",
        read_only=True,
    ),
    P(
        "monitor",
        "strs",
        (),
        "What is watched for wear: effect@site, with .parameter and =growth (=20%, =0.01) if wanted; "
        "usual: dry friction and what sits in couplings; none: nothing is watched.",
        read_only=True,
    ),
    P(
        "monitor_reference",
        "strs",
        (),
        "Recordings of the healthy machine; none: this run is healthy at its start.",
        read_only=True,
    ),
    P(
        "monitor_learn",
        "float",
        600.0,
        "How long this run is taken for healthy, without monitor_reference.",
        unit="s",
        minimum=10.0,
        read_only=True,
    ),
    P("monitor_period", "float", 10.0, "Time between two looks for wear.", unit="s", minimum=1.0),
    P(
        "monitor_false_alarms",
        "str",
        "per 1000 h",
        "One false alarm of all that is watched in so much time of running (s, min, h, days, weeks, years).",
        read_only=True,
    ),
    P(
        "monitor_vary",
        "strs",
        (),
        "Parameters that may change without being wear, beside viscous friction.",
        read_only=True,
    ),
)

REPLAY: Table = (
    PEERS,
    START_TIMEOUT,
    P("bag", "str", "", "Recording to play.", read_only=True),
    P("topics", "strs", ("reference", "excitation", "joint_command", "joint_states"), "What to play.", read_only=True),
    P("rate", "float", 0.0, "Times real time; 0 plays as fast as the listeners acknowledge.", minimum=0.0),
    LISTENERS,
    WINDOW,
    DRAIN_TIMEOUT,
)

BRIDGE: Table = bridge_table(PEERS, START_TIMEOUT, AUTOSTART)

GUARDIAN: Table = (
    PEERS,
    START_TIMEOUT,
    P("bridge", "str", "bridge", "Name of the bridge's node that is watched.", read_only=True),
    P(
        "silence",
        "float",
        0.03,
        "Time without a sign of life from the bridge after which the motor is told to stop; it gives one every 5 ms.",
        unit="s",
        minimum=0.01,
        maximum=1.0,
        read_only=True,
    ),
)

WORKBENCH: Table = workbench_table(PEERS, START_TIMEOUT, SAMPLE_TIME, MODEL)


@cache
def excitation_table() -> Table:
    """Return the excitation node's parameters: its own, the common ones of signals, those of every kind."""
    from idloop.signals import COMMON_PARAMETERS, SIGNALS

    common = {spec.name: spec for spec in COMMON_PARAMETERS}
    rows = [
        *COMMON,
        AUTOSTART,
        P("signal", "str", "prbs", "Kind of signal.", choices=tuple(SIGNALS)),
        P(
            "target",
            "str",
            "reference",
            "Where it goes: the reference, added to the reference (position) or to the command (effort).",
            choices=("reference", "position", "effort"),
            read_only=True,
        ),
        P("joint", "str", "motor", "Joint that the messages name.", read_only=True),
        P("ahead", "int", 200, "Samples published ahead of the clock.", minimum=2, maximum=4000, read_only=True),
        P("experiment", "str", "", "What ~/run_experiment plays, as YAML: {signal: {name: ..., ...}, adds_to: ...}."),
        P("handover_time", "float", 0.5, "Time of the smooth way into an experiment and back.", unit="s", minimum=0.0),
        P("rest_time", "float", 2.0, "Time without excitation before an experiment.", unit="s", minimum=0.0),
        P(
            "limit.amplitude",
            "float",
            None,
            "Largest absolute value of an experiment; not set, it becomes that of the normal signal.",
            minimum=0.0,
        ),
        P("limit.position_min", "float", None, "An experiment must not take the axis below this position."),
        P("limit.position_max", "float", None, "An experiment must not take the axis above this position."),
        P("limit.velocity", "float", None, "An experiment must not move the axis faster than this.", minimum=0.0),
        P.adopt(common["duration"], "duration", 60.0),
        P("repeat", "bool", False, "Begin again when the signal is over; else it stays at rest."),
    ]
    rows += [P.adopt(common[name], name, common[name].default) for name in ("amplitude", "offset", "seed", "ramp_in")]
    rows += [
        P.adopt(spec, f"{kind.name}.{spec.name}", None if spec.required else spec.default)
        for kind in SIGNALS.values()
        for spec in kind.parameters
    ]
    return tuple(rows)


def tables() -> dict[str, Table]:
    """Return the table of every node by its executable's name."""
    return {
        "excitation": excitation_table(),
        "controller": CONTROLLER,
        "bridge": BRIDGE,
        "guardian": GUARDIAN,
        "plant": PLANT,
        "mujoco_plant": MUJOCO_PLANT,
        "recorder": RECORDER,
        "estimator": ESTIMATOR,
        "replay": REPLAY,
        "workbench": WORKBENCH,
    }
