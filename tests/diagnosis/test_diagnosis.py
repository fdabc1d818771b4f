"""The whole way from records to a named effect, on machines that hide one."""

from dataclasses import replace

import numpy as np
import pytest

from idloop.diagnosis import Ladder, add_effect, diagnose, refine
from idloop.errors import InputError
from idloop.estimation.likelihood.estimation_problem import prepare_estimation
from idloop.estimation.likelihood.refit import refit
from idloop.physics import Model, load_model
from idloop.physics.simulation import simulate
from idloop.records import Record

from .conftest import record_of

HIDDEN = [
    "dead_zone@input(width=0.1)",
    "coulomb_friction@axis(level=0.05)",
    "input_delay@input(delay=0.01)",
    "imbalance@axis(amplitude=0.05,phase=0.5)",
    "backlash@position[axis](gap=0.05)",
    "sensor_ripple@velocity[axis](amplitude=0.02,harmonic=4,phase=0.3)",
]


@pytest.mark.slow
@pytest.mark.parametrize("hidden", HIDDEN, ids=lambda text: text.split("(")[0])
def test_a_hidden_effect_is_named(start: Model, hidden: str) -> None:
    machine = load_model("axis").with_effects([hidden])
    found = diagnose(start, [record_of(machine, 1)])
    assert found.set == (hidden.split("(", maxsplit=1)[0],)
    assert found.best is not None
    assert found.best.p_value < 1e-6
    name, _, rest = hidden.partition("(")
    first = rest.split(",")[0].rstrip(")").split("=")
    value = found.best.parameters[first[0]]
    assert value["value"] == pytest.approx(float(first[1]), rel=0.1), name


@pytest.mark.slow
@pytest.mark.parametrize("disturbance", [0.0, 0.03])
def test_nothing_is_named_where_nothing_is_hidden(start: Model, disturbance: float) -> None:
    found = diagnose(start, [record_of(load_model("axis"), 3, disturbance=disturbance)], level=0.001)
    assert found.best is None
    assert found.verdict == "adequate"


@pytest.mark.slow
def test_an_effect_that_the_noise_model_has_absorbed_is_named(start: Model) -> None:
    hidden = "velocity_filter@velocity[axis](time_constant=0.04)"
    record = record_of(load_model("axis").with_effects([hidden]), 1)
    estimation = prepare_estimation(start, [record], "prediction")
    parent = refit(estimation, start)
    # This is what makes it hard: a whitening of many lags explains the effect, and nothing else does.
    assert max(parent.problem.orders) >= 10
    assert parent.whitening_gain > 0.5
    found = diagnose(start, [record])
    assert found.best is not None
    assert found.best.name == hidden.split("(", maxsplit=1)[0]


@pytest.mark.slow
def test_equivalent_effects_come_as_a_set(start: Model) -> None:
    machine = load_model("axis").with_effects(["load_torque@axis(torque=0.05)"])
    found = diagnose(start, [record_of(machine, 2)])
    assert set(found.set) == {"input_offset@input", "load_torque@axis"}


@pytest.mark.slow
def test_the_only_sensor_may_be_what_is_late(start: Model) -> None:
    # A strong observer: where it corrects the present by what a late sensor shows of the past it runs away.
    alone = replace(start, outputs=start.outputs[:1])
    late = alone.with_effect("sensor_delay", "position[axis]", delay=0.03)
    found = diagnose(alone, [record_of(late, 4, disturbance=0.1)])
    assert set(found.set) == {"input_delay@input", "sensor_delay@position[axis]"}
    for name in found.set:
        fitted = next(c for c in found.candidates if c.name == name)
        assert fitted.model is not None
        assert fitted.parameters["delay"]["value"] == pytest.approx(0.03, rel=0.1)


@pytest.mark.slow
def test_the_ladder_climbs_to_both_effects_and_back(start: Model) -> None:
    machine = load_model("axis").with_effects(["dead_zone@input(width=0.1)", "coulomb_friction@axis(level=0.05)"])
    train, validation = record_of(machine, 5), record_of(machine, 6, name="unseen")
    seen: list[tuple[str, ...]] = []
    ladder = refine(start, [train], [validation], on_step=lambda ladder: seen.append(ladder.added))
    assert set(ladder.added) == {"dead_zone@input", "coulomb_friction@axis"}
    assert ladder.verdict == "adequate"
    assert [len(names) for names in seen] == [1, 2]
    errors = [step.validation["nrmse"]["axis.velocity"] for step in ladder.steps]
    assert errors[-1] < 0.5 * errors[0]
    again = Ladder.from_dict(ladder.to_dict())
    assert again.added == ladder.added
    assert [step.set for step in again.steps] == [step.set for step in ladder.steps]
    assert again.verdict == ladder.verdict
    assert again.model.values == pytest.approx(ladder.model.values, rel=1e-6)
    back = ladder.undo()
    assert back.added == ladder.added[:1]
    own = add_effect(back, ladder.added[1], [train], [validation])
    assert own.steps[-1].chosen_by == "user"
    assert own.added == ladder.added
    assert own.model.values["coulomb_friction@axis.level"] == pytest.approx(0.05, rel=0.05)
    with pytest.raises(InputError, match="nothing to undo"):
        back.undo().undo()


@pytest.mark.slow
def test_a_limit_far_below_the_command_is_found(start: Model) -> None:
    # A controller that winds up asks for many times what the drive gives: nearly every sample is cut.
    machine = load_model("axis").with_effects(["saturation@input(limit=0.04)"])
    found = diagnose(start, [record_of(machine, 3, 6.0)])
    assert found.set == ("saturation@input",)
    assert found.best is not None
    assert found.best.parameters["limit"]["value"] == pytest.approx(0.04, rel=0.05)


@pytest.mark.slow
def test_a_limit_that_falls_with_speed_takes_the_place_of_one_that_does_not() -> None:
    # The command peaks far above the limit, so the size of the peaks says nothing of it.
    motor = load_model("dc_motor")
    machine = motor.with_effects(["speed_limit_voltage@input(supply=2.0,back_emf=0.207)"])
    rng = np.random.default_rng(3)
    command = np.where(np.arange(4000) % 100 < 3, 8.0, 1.5) * np.repeat(rng.choice([-1.0, -0.5, 0.5, 1.0], 40), 100)
    limited = motor.with_effects(["saturation@input(limit=1.2)"])
    found = diagnose(
        limited, [record_of(machine, 4, command=command)], effects=["speed_limit_voltage", "quadratic_drag"]
    )
    assert found.set == ("speed_limit_voltage@input",)
    assert found.best is not None
    assert found.best.parameters["supply"]["value"] == pytest.approx(2.0, rel=0.05)
    assert found.best.parameters["back_emf"]["value"] == pytest.approx(0.207, rel=0.1)


def test_equal_seeds_give_equal_answers(start: Model) -> None:
    record = record_of(load_model("axis"), 7, seconds=6.0)
    first, second = (diagnose(start, [record], effects=["dead_zone", "coulomb_friction"], seed=4) for _ in range(2))
    assert first.to_dict() == second.to_dict()


@pytest.mark.slow
def test_physics_that_no_effect_has_is_shown_as_a_curve(start: Model) -> None:
    rng = np.random.default_rng(0)
    time = np.arange(0.0, 20.0, 0.005)
    command = rng.normal(size=81)[(4 * time).astype(int)]
    position = velocity = 0.0
    rows = []

    def acceleration(u: float, v: float) -> float:
        return (u - 0.05 * v - 0.2 * np.exp(-(((v - 5.0) / 3.0) ** 2))) / 0.01

    for u in command:
        rows.append((position, velocity))
        for _ in range(10):
            h = 0.0005
            a = acceleration(u, velocity)
            b = acceleration(u, velocity + 0.5 * h * a)
            position, velocity = position + h * velocity + 0.5 * h * h * b, velocity + h * b
    noise = rng.normal(size=(len(time), 2)) * np.array([5e-4, 1e-2])
    names, units = ("axis.position", "axis.velocity"), ("rad", "rad/s")
    record = Record("bump", time, command, time, np.array(rows) + noise, "axis.effort", "N·m", names, units)
    found = diagnose(start, [record], effects=["dead_zone", "saturation"])
    if found.best is None:
        assert found.unknown is not None
        assert found.verdict == "unknown_structure"
        assert found.unknown.variable == "axis.velocity"
        at = float(found.unknown.at[np.argmax(np.abs(found.unknown.force))])
        assert at == pytest.approx(5.0, abs=6.0)


def test_two_sizes_of_command_cannot_show_a_dead_zone() -> None:
    base = load_model("dc_motor")
    machine = base.with_effects(["dead_zone@input(width=0.1)"])
    rng = np.random.default_rng(1)
    time = np.arange(0.0, 20.0, 0.01)
    command = np.where(rng.normal(size=41)[(2 * time).astype(int)] > 0, 0.5, -0.5)
    output = simulate(machine, time, command, time).output + rng.normal(size=(len(time), 2)) * np.array([0.003, 0.007])
    names, units = ("motor.position", "motor.velocity"), ("rad", "rad/s")
    record = Record("two-level", time, command, time, output, "motor.effort", "V", names, units)
    found = diagnose(base, [record])
    assert "dead_zone@input" in found.untestable
    assert found.verdict == "not_excited"
    assert "one size" in found.gate.why["dead_zone@input"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"level": 0.0}, "error rate"),
        ({"criterion": "guess"}, "unknown"),
        ({"effects": ["dead_zon"]}, "did you mean"),
    ],
)
def test_bad_questions_are_refused(start: Model, arguments: dict[str, object], message: str) -> None:
    record = record_of(load_model("axis"), 8, seconds=2.0)
    with pytest.raises(InputError, match=message):
        diagnose(start, [record], **arguments)  # type: ignore[arg-type]
