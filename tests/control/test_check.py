"""Bad controller sections, each refused in one line."""

from __future__ import annotations

import subprocess
import sys

import pytest

from idloop.control import CONTROLLERS, build_controller, check_controller
from idloop.errors import InputError

PID = {"type": "pid", "output": "motor.position", "kp": 1.0, "ki": 1.0, "sample_time": 0.01}
STATES = {
    "type": "state_feedback",
    "states": ["m.position", "m.velocity"],
    "gains": [1.0, 2.0],
    "sample_time": 0.01,
}
DESIGN = {
    **STATES,
    "gains": None,
    "q": [1.0, 0.0],
    "r": 1.0,
    "model": {"a": [[0.0, 1.0], [0.0, -2.0]], "b": [0.0, 8.0]},
}


@pytest.mark.parametrize(
    ("spec", "words"),
    [
        ("pid", "must be a mapping with a type"),
        ({}, "type is missing"),
        ({"type": "PID"}, "unknown type 'PID' (did you mean 'pid'?)"),
        ({"type": ["pid"]}, "unknown type ['pid']"),
        ({**PID, "Kd": 1.0}, "unknown parameter 'Kd' (did you mean 'kd'?)"),
        ({**PID, "kp": None}, "kp must be a number in u/y, got nothing"),
        ({**PID, "kp": "8"}, "kp must be a number in u/y, got str '8'"),
        ({**PID, "ki": float("nan")}, "ki is nan"),
        ({**PID, "limit": -2.95}, "limit is -2.95 but must be > 0"),
        ({**PID, "limit": float("inf")}, "limit is inf"),
        ({**PID, "sample_time": 0}, "sample_time is 0 but must be > 0"),
        ({key: PID[key] for key in PID if key != "sample_time"}, "sample_time is missing"),
        ({key: PID[key] for key in PID if key != "output"}, "output is missing"),
        ({**PID, "output": "motor"}, "must be joint.field"),
        ({**PID, "output": "motor.angle"}, "must be joint.field"),
        ({**PID, "linearisation": {"gain": 0.0}}, "linearisation.gain is 0 but must be not 0"),
        ({**PID, "linearisation": {"ofset": 0.0}}, "did you mean 'linearisation.offset'"),
        ({**PID, "linearisation": 3.0}, "unknown parameter 'linearisation'"),
        ({**PID, "anti_windup": "clamp"}, "anti_windup is 'clamp'"),
        ({**PID, "derivative_filter": -1.0}, "derivative_filter is -1 but must be >= 0"),
        ({**PID, "type": "p"}, "unknown parameter 'ki'"),
        ({"type": "cascade", "output": "m.velocity", "kp": 1, "kv": 1, "sample_time": 1}, "position"),
        (
            {
                "type": "cascade",
                "output": "m.position",
                "velocity_output": "m.position",
                "kp": 1,
                "kv": 1,
                "sample_time": 1,
            },
            "must name a velocity",
        ),
        ({**STATES, "states": []}, "states is empty"),
        ({**STATES, "states": ["m.position", "m.position"]}, "twice"),
        ({**STATES, "gains": [1.0]}, "gains has 1 entries but there are 2 states"),
        ({**STATES, "differentiate": ["n.velocity"]}, "differentiate holds 'n.velocity'"),
        ({**STATES, "gains": None}, "give gains, or q, r, model.a and model.b"),
        ({**DESIGN, "gains": [1.0, 2.0]}, "both gains and q are given"),
        ({**DESIGN, "r": None}, "r missing"),
        ({**DESIGN, "q": [1.0]}, "q has 1 entries"),
        ({**DESIGN, "model": {"a": [[0.0], [1.0]], "b": [1.0, 2.0]}}, "each row of model.a has 1"),
        ({**DESIGN, "model": {"a": [[0, 1], [0, 1]], "b": [0, 0]}}, "no stabilising solution"),
    ],
)
def test_bad_sections(spec, words):
    with pytest.raises(InputError) as error:
        build_controller(spec, where="model.yaml: controller")
    assert words in str(error.value)
    assert str(error.value).startswith("model.yaml: controller")
    assert "\n" not in str(error.value)


def test_a_checked_section_is_complete_and_stays_as_it_is():
    values = check_controller(PID)
    assert set(values) == {"type", *(spec.name for spec in CONTROLLERS["pid"].parameters)}
    assert check_controller(values) == values


def test_joint_names_may_hold_dots():
    controller = build_controller({**PID, "output": "arm.left.joint.position"})
    assert controller.inputs == ("arm.left.joint.position",)


def test_tables_and_checks_come_without_heavy_imports():
    code = (
        "import sys; from idloop.control import CONTROLLERS, check_controller; import idloop.signals;"
        "check_controller({'type': 'none'});"
        "print([m for m in ('numba', 'scipy', 'control', 'matplotlib') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
