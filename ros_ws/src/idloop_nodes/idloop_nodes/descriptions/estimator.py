"""What the node `estimator` does, its streams, services and parameters."""

from __future__ import annotations

from idloop_nodes.descriptions.common import COMMON, EFFECTS, MODEL, RELIABLE
from idloop_nodes.descriptions.node_description import NodeDescription
from idloop_nodes.parameters import Table, fixed, flag, number, seconds, text, texts, whole
from idloop_nodes.topics import RESULTS

PARAMETERS: Table = (
    *COMMON,
    RELIABLE,
    MODEL,
    texts(EFFECTS.name, (), EFFECTS.description + " Setting it refits with exactly these beside the model file's own."),
    seconds("window", 20.0, "Length of the data a fit uses.", minimum=0.05),
    seconds("validation", 10.0, "Length of the data after it on which the fit is judged.", minimum=0.05),
    seconds("fit_period", 10.0, "Time between fits; 0 fits on request only."),
    text("criterion", "auto", "What a fit minimises.", choices=("auto", "prediction", "simulation", "force")),
    *fixed(
        flag("recursive", True, "Predict every sample while parameters and state are estimated."),
        text(
            "recursion",
            "none",
            "Black-box model that is estimated sample by sample beside the prediction; its innovations are published.",
            choices=("none", "rarx", "kalman", "ekf", "rarmax", "roe", "rbj", "rpem", "rplr"),
        ),
        whole("recursion_order", 2, "Degree of its polynomials.", minimum=1, maximum=20),
        whole(
            "recursion_delay",
            1,
            "Samples until a command shows in a measurement; 1 is none beyond that of sampling.",
            minimum=0,
            maximum=1000,
        ),
        seconds("recursion_memory", 0.0, "Time constant with which it forgets old data; 0 keeps all."),
    ),
    seconds("recursion_period", 0.5, "Time between its published coefficients.", minimum=1e-3),
    flag("auto_diagnose", True, "Diagnose when the residual of the fits stops being white."),
    flag("auto_add", False, "Add what a diagnosis finds missing, and diagnose again until nothing is left."),
    flag("auto_experiment", False, "Let the excitation run the suggested experiment where effects tie."),
    seconds(
        "diagnose_window",
        30.0,
        "Length of the newest data that a diagnosis uses; as for a fit, it is judged on the data after it.",
        minimum=0.5,
    ),
    number("level", 0.01, "Family-wise rate of false effects.", minimum=1e-6, maximum=0.5),
    number(
        "minimum_improvement",
        0.01,
        "Part by which an effect must make the errors on unseen samples smaller to be named.",
        minimum=0.0,
        maximum=0.99,
    ),
    texts("catalogue", (), "Candidate effects: name or name@site; none: the whole catalogue."),
    seconds(
        "evidence_period",
        10.0,
        "Time between two scores of the evidence for missing effects, each of the newest samples; 0 never.",
    ),
    flag(
        "end_when_decided",
        False,
        "End the experiment (stop the excitation, emergency stop of bridge and controller) as soon as an effect is "
        "decided, or every estimate may be trusted; with auto_add or auto_experiment only when every estimate may be.",
    ),
    number(
        "trusted_stderr",
        0.05,
        "Largest standard error of an estimate that may be trusted, as part of its value.",
        minimum=1e-6,
        maximum=1.0,
    ),
    number(
        "trusted_error",
        2.0,
        "Largest rms error of the free run on unseen samples with which estimates may be trusted, in units of the "
        "sensor's noise.",
        minimum=1.0,
    ),
    whole("seed", 0, "Seed of the bootstrap; equal seeds give equal answers.", minimum=0, maximum=2**53),
    *fixed(
        text("excitation_node", "excitation", "Node that runs the suggested experiment."),
        text("controller_node", "controller", "Node that is stopped when the experiment ends."),
        text("bridge_node", "", "Bridge to a robot's motor, which is stopped first; empty for none."),
        texts(
            "monitor",
            (),
            "What is watched for wear: effect@site, with .parameter and =growth (=20%, =0.01) if wanted; "
            "usual: dry friction and what sits in couplings; none: nothing is watched.",
        ),
        texts("monitor_reference", (), "Recordings of the healthy machine; none: this run is healthy at its start."),
        seconds(
            "monitor_learn",
            600.0,
            "Time for which this run counts as healthy, without monitor_reference.",
            minimum=10.0,
        ),
    ),
    seconds("monitor_period", 10.0, "Time between two checks for wear.", minimum=1.0),
    *fixed(
        text(
            "monitor_false_alarms",
            "per 1000 h",
            "Rate of false alarms of all watched parameters together, per running time (s, min, h, days, weeks, "
            "years).",
        ),
        texts("monitor_vary", (), "Parameters that may change without being wear, beside viscous friction."),
    ),
)

DESCRIPTION = NodeDescription(
    about="Predicts every sample, fits a sliding window in a worker process, judges the fit on the samples after the "
    "window. Diagnoses in the same worker process on request, after an experiment, and automatically when the "
    "free-run residual of successive fits is not white any more; in lock-step simulated time waits for it. With"
    " `recursion` a black-box model of each output follows every sample beside the prediction: measurements "
    "that are NaN, and lost samples, are predicted and not used; a bag gives the same in `idloop identify`. "
    "With `monitor` it watches wear: an alarm is an error on `/diagnostics` and on `estimator/wear`, at the "
    "rate of false alarms of `monitor_false_alarms`. [How it decides](how-to/monitor.md).",
    parameters=lambda: PARAMETERS,
    publishes=("estimator/prediction", "estimator/residual", "estimator/innovation", *RESULTS),
    subscribes=("joint_states", "joint_command", "reference"),
    services={
        "~/refit": "fit the newest window now",
        "~/diagnose": "diagnose missing effects, on the newest data and all experiments",
        "~/add_best_effect": "add what the newest diagnosis names first, and refit",
        "~/undo": "take the last step of the ladder back; `auto_add` and `auto_experiment` are then switched off",
        "~/run_suggested_experiment": "run an experiment that separates the tied effects, then diagnose again",
    },
    example="-p model:=torsion -p window:=10.0",
    uses_applied_command=True,
)
