"""A controller that is taken for known is held against the recorded command."""

from dataclasses import replace

import numpy as np
import pytest

from idloop.control import build_controller
from idloop.errors import InputError
from idloop.estimation.black_box.method import Choices
from idloop.estimation.black_box.methods import find_method
from idloop.estimation.black_box.sampled import sampled
from idloop.estimation.subspace.known_controller import command_misfit, controller_notes
from idloop.records import Record

STEP = 0.01
LAWS = {
    "p": {"type": "p", "output": "motor.position", "kp": 1.0},
    "pid": {"type": "pid", "output": "motor.position", "kp": 1.0, "ki": 0.5, "kd": 0.05, "derivative_filter": 0.02},
    "cascade": {
        "type": "cascade", "output": "motor.position", "velocity_output": "motor.velocity", "kp": 2.0, "kv": 0.3,
        "velocity_feedforward": 1.0,
    },
}  # fmt: skip


def spec(kind, **changes):
    return {**LAWS[kind], "sample_time": STEP, **changes}


def loop(law, samples=1500, added=0.0):
    """A noisy body with friction under a controller as the node runs it."""
    controller = build_controller(law)
    random = np.random.default_rng(4)
    time = STEP * np.arange(samples)
    reference, follows = np.sin(2.0 * time) + np.sin(0.7 * time), 2.0 * np.cos(2.0 * time) + 0.7 * np.cos(0.7 * time)
    feedforward = added * random.choice([-1.0, 1.0], samples)
    u, y = np.zeros(samples), np.zeros((samples, 2))
    position, velocity = 0.3, 0.0
    for k in range(samples):
        y[k] = [position + 0.01 * random.normal(), velocity + 0.05 * random.normal()]
        measured = dict(zip(("motor.position", "motor.velocity"), y[k], strict=True))
        u[k] = controller.step(reference[k], follows[k], [measured[name] for name in controller.inputs], feedforward[k])
        velocity += STEP * (20.0 * u[k] - 2.0 * velocity)
        position += STEP * velocity
    return Record(
        "loop", time, u, time, y, "motor.effort", "V", ("motor.position", "motor.velocity"), ("rad", "rad/s"),
        reference_time=time, reference=np.column_stack([reference, follows]),
        excitation_time=time, excitation=np.column_stack([np.full(samples, np.nan), feedforward]),
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("kind", LAWS)
@pytest.mark.parametrize("limit", [None, 0.3])
def test_the_controller_that_ran_made_the_command(kind, limit):
    law = spec(kind, limit=limit)
    data = sampled(loop(law, added=0.3), STEP)
    assert command_misfit(law, data).share < 1e-6
    assert any("at its limit of 0.3 V" in note for note in controller_notes(law, data)) == (limit is not None)


def test_another_gain_is_told_with_its_figure_and_another_sign_is_refused():
    data = sampled(loop(spec("p")), STEP)
    assert controller_notes(spec("p"), data) == []
    (note,) = controller_notes(spec("p", kp=1.3), data)
    assert "misses the recorded command by 30 %" in note
    for kp, share in ((-1.0, 200), (10.0, 900)):
        with pytest.raises(InputError, match=f"by {share} % .* another controller ran") as caught:
            find_method("vodma").run(data, Choices(controller=spec("p", kp=kp)), 3, 1)
        assert "\n" not in str(caught.value)


def test_a_command_that_answers_a_sample_late_is_told():
    record = loop(spec("pid"))
    late = np.append(record.input[:1], record.input[:-1])
    (note,) = controller_notes(spec("pid"), sampled(Record(**{**vars(record), "input": late}), STEP))
    assert "one sample later" in note


def test_without_a_reference_nothing_is_judged():
    (data,) = sampled(loop(spec("p")), STEP)
    (note,) = controller_notes(spec("p", kp=50.0), [replace(data, reference=None)])
    assert "no reference was recorded" in note
