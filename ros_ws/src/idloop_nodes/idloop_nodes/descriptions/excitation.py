"""What the node `excitation` does, its streams, services and parameters."""

from __future__ import annotations

from functools import cache

from idloop_nodes.descriptions.common import AUTOSTART, COMMON
from idloop_nodes.descriptions.node_description import NodeDescription
from idloop_nodes.parameters import NodeParameter, Table, fixed, flag, number, seconds, text, whole


@cache
def _parameters() -> Table:
    """Return the excitation node's parameters: its own, the common ones of signals, those of every kind."""
    from idloop.signals import COMMON_PARAMETERS, SIGNALS

    common = {spec.name: spec for spec in COMMON_PARAMETERS}
    rows = [
        *COMMON,
        AUTOSTART,
        text("signal", "prbs", "Kind of signal.", choices=tuple(SIGNALS)),
        *fixed(
            text(
                "target",
                "reference",
                "Where it goes: the reference, added to the reference (position) or to the command (effort).",
                choices=("reference", "position", "effort"),
            ),
            text("joint", "motor", "Joint that the messages name."),
            whole("ahead", 200, "Samples published ahead of the clock.", minimum=2, maximum=4000),
        ),
        text("experiment", "", "What ~/run_experiment plays, as YAML: {signal: {name: ..., ...}, adds_to: ...}."),
        seconds("handover_time", 0.5, "Time of the smooth way into an experiment and back."),
        seconds("rest_time", 2.0, "Time without excitation before an experiment."),
        number(
            "limit.amplitude",
            None,
            "Largest absolute value of an experiment; not set, it becomes that of the normal signal.",
            minimum=0.0,
        ),
        number("limit.position_min", None, "An experiment must not take the axis below this position."),
        number("limit.position_max", None, "An experiment must not take the axis above this position."),
        number("limit.velocity", None, "An experiment must not move the axis faster than this.", minimum=0.0),
        NodeParameter.adopt(common["duration"], "duration", 60.0),
        flag("repeat", False, "Begin again when the signal is over; else it stays at rest."),
    ]
    rows += [
        NodeParameter.adopt(common[name], name, common[name].default)
        for name in ("amplitude", "offset", "seed", "ramp_in")
    ]
    rows += [
        NodeParameter.adopt(spec, f"{kind.name}.{spec.name}", None if spec.required else spec.default)
        for kind in SIGNALS.values()
        for spec in kind.parameters
    ]
    return tuple(rows)


DESCRIPTION = NodeDescription(
    about="Builds the whole signal once and publishes it ahead of the clock, each sample stamped with the time at which"
    " it holds. Lifecycle node: inactive, it publishes neutral values. An experiment is put between the samples "
    "of the normal signal, with a smooth way in and back, after a check of the `limit.*` parameters; where a "
    "motion limit is set, the axis is watched on `joint_states` and a breach deactivates the node.",
    parameters=_parameters,
    publishes=("reference", "excitation"),
    subscribes=("/clock",),
    services={
        "~/start": "start the signal from its beginning",
        "~/stop": "neutral values from the next sample, whatever runs",
        "~/run_experiment": "play the parameter `experiment` once, then go on with the signal",
        "~/stop_experiment": "end it now and go on with the signal",
    },
    example="-p signal:=prbs -p prbs.band_hz:=10.0 -p amplitude:=0.6",
)
