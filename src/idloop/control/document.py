"""Write the types of controllers as a page: ``python -m idloop.control.document > docs/controllers.md``."""

from __future__ import annotations

import sys

from idloop.parameter_table import ParameterSpec
from idloop.physics.controller_section import CONTROLLERS, ControllerKind

HEAD = """\
# The types of controllers

Written by `python -m idloop.control.document` from `src/idloop/physics/controller_section.py`.

The section `controller` of a [model file](reference/model-file.md) describes the control law that computed the
command during the recording: `type`, and the keys of that type. The controller node runs the same law,
`idloop compensate` simulates it, `idloop identify --method vodma` uses it, and `idloop export` writes its gains.
`idloop identify --controller FILE` also accepts a file with this section alone.

In the units `u` is that of the command and `y` that of the controlled output. r is the reference, y the measured output
times `feedback_gain`, v the velocity, e the error. At each `sample_time` the law is evaluated with the newest
measurements, and the command

    u = (law + feedforward - linearisation.offset) / linearisation.gain, at most ±limit

is held until the next sample. `feedforward` is the excitation signal. Without `limit` the command is not bounded.

"""
EXAMPLES = {
    "none": "{type: none, limit: 10.0}",
    "p": "{type: p, output: motor.position, kp: 4.0, limit: 10.0, sample_time: 0.01}",
    "pd": "{type: pd, output: motor.position, kp: 4.0, kd: 0.3, velocity_feedforward: 0.3, sample_time: 0.001}",
    "pid": "{type: pid, output: motor.position, kp: 8.4, ki: 0.33, kd: 0.8, limit: 2.95, sample_time: 0.001}",
    "lead": "{type: lead, output: motor.position, gain: 20.0, zero: 5.0, pole: 50.0, sample_time: 0.001}",
    "cascade": "{type: cascade, output: motor.position, velocity_output: motor.velocity, kp: 20.0, kv: 0.5, ki: 5.0, "
    "velocity_feedforward: 1.0, sample_time: 0.001}",
    "state_feedback": "{type: state_feedback, states: [motor.position, motor.velocity], gains: [4.0, 0.3], "
    "sample_time: 0.001}",
}


def _default(spec: ParameterSpec) -> str:
    if spec.required:
        return "must be given"
    if spec.default is None or spec.default == ():
        return "none"
    return f"`{spec.default:g}`" if isinstance(spec.default, float) else f"`{spec.default}`"


def _row(spec: ParameterSpec) -> str:
    allowed = spec.range_text.replace(" | ", ", ")
    return f"| `{spec.name}` | {spec.unit} | {_default(spec)} | {allowed} | {spec.description} |\n"


def _section(kind: ControllerKind) -> str:
    example = f"```yaml\ncontroller: {EXAMPLES[kind.name]}\n```"
    return (
        f"## `{kind.name}`\n\n{kind.description}\n\n    {kind.law}\n\n{example}\n\n"
        "| key | unit | default | allowed | meaning |\n|---|---|---|---|---|\n"
        f"{''.join(_row(spec) for spec in kind.parameters)}\n"
    )


def page() -> str:
    """Return the page as Markdown."""
    return (HEAD + "".join(_section(kind) for kind in CONTROLLERS.values())).rstrip("\n") + "\n"


if __name__ == "__main__":
    sys.stdout.write(page())
