"""The terms of a force balance add up to the balance of the compiled model."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.physics.test_effects import STRONG

from idloop.estimation.dataset import prepare
from idloop.estimation.force_balance.balance_terms import BalanceTerms, WholeBalance, balance_terms
from idloop.estimation.force_balance.weak_form import WeakForm, weak_form
from idloop.estimation.optimisation.caching_engine import CachingEngine
from idloop.physics import Model, load_model
from idloop.physics.conditions import Condition
from idloop.physics.effect import BODY, COUPLING, INPUT, Effect, built_in
from idloop.physics.simulation import simulate
from idloop.records import Record

RATE = 200.0
# Three bodies, all of which are measured.
MACHINE = """
schema: idloop/model/1
name: chain
input: {topic: joint_command, joint: motor, field: effort, unit: N·m}
outputs:
  - {topic: joint_states, joint: motor, field: position, unit: rad}
  - {topic: joint_states, joint: load, field: position, unit: rad}
  - {topic: joint_states, joint: tool, field: position, unit: rad}
bodies:
  - {name: motor, inertia: {value: 0.01}, viscous_friction: {value: 0.02}}
  - {name: load, inertia: {value: 0.02}, viscous_friction: {value: 0.01}}
  - {name: tool, inertia: {value: 0.01}, viscous_friction: {value: 0.01}}
couplings:
  - {from: motor, to: load, stiffness: {value: 5.0}, damping: {value: 0.01}}
  - {from: load, to: tool, stiffness: {value: 8.0}, damping: {value: 0.02}}
drive: {gain: {value: 1.0}}
"""
SITE = {INPUT: "input", BODY: "motor", COUPLING: "motor-load"}
BALANCED = [
    effect for several in built_in().values() for effect in several if effect.site in SITE and not effect.splits
]
CONDITIONS = (
    Condition("temperature", "°C", np.arange(0.0, 7.0), np.linspace(20.0, 60.0, 7)),
    Condition("supply", "V", np.arange(0.0, 7.0), np.linspace(24.0, 15.0, 7)),
)


@pytest.fixture(scope="module")
def machine(tmp_path_factory: pytest.TempPathFactory) -> Model:
    path: Path = tmp_path_factory.mktemp("chain") / "chain.yaml"
    path.write_text(MACHINE)
    return load_model(str(path))


@pytest.fixture(scope="module")
def form(machine: Model) -> WeakForm:
    """Two records with reversals, standstill and steps of the command, in windows of eleven samples."""
    records = []
    for seed in (1, 2):
        rng, time = np.random.default_rng(seed), np.arange(0.0, 6.0, 1.0 / RATE)
        command = np.repeat(rng.uniform(-1.0, 1.0, len(time) // 60), 60) * (time < 5.0)
        truth = machine.with_effect("coulomb_friction", "motor", level=0.1)
        output = simulate(truth, time, command, time).output
        names, units = tuple(o.name for o in machine.outputs), tuple(o.unit for o in machine.outputs)
        records.append(
            Record(
                f"run {seed}", time, command, time, output, "motor.effort", "N·m", names, units, conditions=CONDITIONS
            )
        )
    found = weak_form(CachingEngine(machine), prepare(machine, records), 11)
    assert found is not None
    return found


def balances(model: Model, form: WeakForm) -> tuple[BalanceTerms, WholeBalance]:
    return balance_terms(model, form._along), WholeBalance(model, form._along)


@pytest.mark.parametrize("friction", [False, True], ids=["", "with dry friction"])
@pytest.mark.parametrize("effect", BALANCED, ids=lambda effect: f"{effect.name}@{effect.site}")
def test_the_terms_add_up(machine: Model, form: WeakForm, effect: Effect, *, friction: bool) -> None:
    model = machine.with_effect(effect.name, SITE[effect.site], **STRONG[effect.name])
    if friction:
        for body in model.bodies:
            if (effect.name, body) != ("coulomb_friction", "motor"):
                model = model.with_effect("coulomb_friction", body, level=0.05)
    terms, whole = balances(model, form)
    values = dict(model.values)
    # What is kept of other values must not be taken for these.
    for name in ("", *model.free):
        values = values | ({name: 1.05 * values[name] + 1e-3} if name else {})
        found, wanted = (one.residual(values, 0.0013, 0.05) for one in (terms, whole))
        # What has a memory is asked for one command between two samples, not for two.
        same = 1e-9 if effect.settle is None else 0.02
        assert np.linalg.norm(found - wanted) <= same * np.linalg.norm(wanted)
    slopes = [one.slope(values, 0.0013, 0.05) for one in (terms, whole)]
    near = np.isclose(*slopes, rtol=1e-6, atol=1e-6)
    assert np.mean(near) > (0.999 if effect.settle is None else 0.9)


def test_load_dependent_friction_is_no_independent_term(machine: Model, form: WeakForm) -> None:
    for name, raised in (("coulomb_friction", False), ("load_dependent_friction", True)):
        model = machine.with_effect(name, "motor", **STRONG[name])
        assert isinstance(balances(model, form)[0], WholeBalance) == raised


@pytest.mark.parametrize("effect", [one for one in BALANCED if one.proportional], ids=lambda effect: effect.name)
def test_proportional_effects_are_proportional(machine: Model, form: WeakForm, effect: Effect) -> None:
    first = effect.parameters[0].name
    forces = []
    for factor in (0.0, 1.0, 3.0):
        own = {**STRONG[effect.name], first: factor * STRONG[effect.name][first]}
        model = machine.with_effect(effect.name, SITE[effect.site], **own)
        forces.append(WholeBalance(model, form._along).residual(model.values, 0.0, 0.0))
    np.testing.assert_allclose(forces[2] - forces[0], 3.0 * (forces[1] - forces[0]), atol=1e-9)


@pytest.mark.parametrize("friction", [False, True], ids=["", "with dry friction"])
@pytest.mark.parametrize("place", [-0.5, -0.03, 0.0, 0.37, 1.21])
def test_between_averaged_delays_the_force_changes_by_a_line(
    machine: Model, form: WeakForm, place: float, *, friction: bool
) -> None:
    """Commands that are averaged at this very delay [samples], in place of the line, leave the same force."""
    model = machine.with_effect("coulomb_friction", "motor", level=0.1) if friction else machine
    timing = place / RATE
    on_the_line = balance_terms(model, form._along).residual(model.values, timing, form.rest_speed)
    late = with_later_command(form, timing)
    exact = balance_terms(model, late._along).residual(model.values, 0.0, form.rest_speed)
    size = np.sqrt(np.mean(late.drive(machine.theta, 0.0) ** 2))
    assert np.sqrt(np.mean((on_the_line - exact) ** 2)) < 1e-3 * size


def with_later_command(form: WeakForm, timing: float) -> WeakForm:
    """The same windows with a command that was recorded later [s]."""
    data = [replace(one, input_time=one.input_time + timing) for one in form.data]
    found = weak_form(form.engine, data, form.width)
    assert found is not None
    return found


def test_a_delay_that_is_no_number_leaves_no_force(form: WeakForm) -> None:
    assert np.all(np.isnan(form.residual(form.engine.model.theta, float("nan"))))
