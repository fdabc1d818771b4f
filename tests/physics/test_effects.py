"""Invariants of every effect of the catalogue."""

import numpy as np
import pytest

from idloop.errors import InputError
from idloop.physics import Condition, Model, catalogue, load_model, simulate
from idloop.physics.effect import Effect
from idloop.physics.model_file import from_text

TIME = np.arange(0.0, 2.0, 0.002)
COMMAND = 2.0 * np.sign(np.sin(5.0 * TIME)) * np.abs(np.sin(1.3 * TIME))
CONDITIONS = [
    Condition("temperature", "°C", np.array([0.0, 2.0]), np.array([20.0, 60.0])),
    Condition("supply", "V", np.array([0.0, 2.0]), np.array([24.0, 18.0])),
]
SERVO = """
schema: idloop/model/1
name: servo
input: {joint: arm, field: position, unit: rad}
outputs: [{joint: arm, field: position, unit: rad}]
bodies: [{name: arm, inertia: 0.02, viscous_friction: 0.05}]
drive: {kind: position_loop, unit: N·m, proportional: 2.0, derivative: 0.1}
"""
ALL = [effect for several in catalogue().values() for effect in several]


def machine() -> Model:
    return load_model("torsion").with_values({"motor.inertia": 2e-4})


def site_of(effect: Effect, model: Model) -> str:
    if effect.site == "output":
        return model.sites("output")[0]
    return model.sites(effect.site)[0]


def fits(effect: Effect) -> Model:
    """A model with a site that the effect fits."""
    if effect.set_point:
        return from_text(SERVO, None)
    return machine() if "position" in effect.outputs else load_model("axis")


def at(effect: Effect, model: Model) -> str:
    if effect.site != "output":
        return model.sites(effect.site)[0]
    return next(o.site for o in model.outputs if o.field in effect.outputs)


@pytest.mark.parametrize("effect", ALL, ids=lambda e: f"{e.name}-{e.site}")
def test_at_its_neutral_value_an_effect_does_nothing(effect: Effect) -> None:
    model = fits(effect)
    neutral = {}
    for spec in effect.parameters:
        value = spec.neutral
        if not spec.min <= value <= spec.max:
            value = spec.start
        neutral[spec.name] = value
    with_effect = model.with_effect(effect.name, at(effect, model), **neutral)
    plain = simulate(model, TIME, COMMAND, TIME).output
    shown = simulate(with_effect, TIME, COMMAND, TIME, conditions=CONDITIONS).output
    np.testing.assert_allclose(shown, plain, atol=1e-6 * np.max(np.abs(plain)))


STRONG = {
    "input_offset": {"offset": 0.3},
    "friction_compensation": {"level": 0.3},
    "friction_feed_forward": {"level": 0.3},
    "gain_asymmetry": {"ratio": 0.2},
    "dead_zone": {"width": 0.4},
    "saturation": {"limit": 1.0},
    "speed_limit_voltage": {"supply": 1.0, "back_emf": 0.02, "resistance": 1.0},
    "input_delay": {"delay": 0.01},
    "actuator_lag": {"time_constant": 0.02},
    "viscous_friction": {"coefficient": 1e-3},
    "coulomb_friction": {"level": 0.02},
    "stribeck_friction": {"coulomb": 0.02, "static": 0.04, "velocity": 0.5},
    "asymmetric_friction": {"level": 0.02, "ratio": 0.5},
    "presliding_friction": {"level": 0.02, "stiffness": 20.0},
    "quadratic_drag": {"coefficient": 1e-4},
    "asymmetric_viscous_friction": {"coefficient": 1e-3},
    "imbalance": {"amplitude": 0.02},
    "gravity": {"moment": 0.02},
    "cogging": {"amplitude": 0.02, "harmonic": 4},
    "periodic_force": {"amplitude": 0.02, "period": 1.3},
    "cable_spring": {"stiffness": 0.05},
    "load_torque": {"torque": 0.02},
    "load_dependent_friction": {"ratio": 0.3},
    "thermal_dry_friction": {"slope": 1e-3},
    "thermal_viscosity": {"coefficient": 1e-4},
    "supply_sag": {"share": 1.0},
    "compliance": {"stiffness": 1.0},
    "backlash": {"gap": 0.1},
    "hardening_stiffness": {"cubic": 50.0},
    "slip": {"limit": 0.02},
    "sensor_quantisation": {"resolution": 0.05},
    "sensor_delay": {"delay": 0.01},
    "sensor_offset": {"offset": 0.1},
    "sensor_ripple": {"amplitude": 0.1, "harmonic": 3},
    "velocity_filter": {"time_constant": 0.02},
}


@pytest.mark.parametrize("effect", ALL, ids=lambda e: f"{e.name}-{e.site}")
def test_a_strong_effect_shows(effect: Effect) -> None:
    model = fits(effect)
    changed = model.with_effect(effect.name, at(effect, model), **STRONG[effect.name])
    plain = simulate(model, TIME, COMMAND, TIME).output
    shown = simulate(changed, TIME, COMMAND, TIME, conditions=CONDITIONS).output
    assert np.all(np.isfinite(shown))
    assert np.max(np.abs(shown - plain)) > 1e-3 * np.max(np.abs(plain))


@pytest.mark.parametrize("effect", ALL, ids=lambda e: f"{e.name}-{e.site}")
def test_every_effect_explains_itself(effect: Effect) -> None:
    known = catalogue()
    assert effect.text.endswith(".")
    assert len(effect.text) > 30
    assert all(name in known for name in effect.looks_like)
    assert all(spec.unit for spec in effect.parameters)


@pytest.mark.parametrize("effect", ALL, ids=lambda effect: f"{effect.name}@{effect.site}")
def test_an_angle_is_found_within_a_turn(effect: Effect) -> None:
    """A fit cannot leave it many turns away while it has no influence yet."""
    for parameter in effect.parameters:
        if parameter.unit == "rad":
            assert -7.0 <= parameter.min <= parameter.neutral <= parameter.max <= 7.0


def test_an_unknown_parameter_is_named_with_the_nearest_one() -> None:
    with pytest.raises(InputError, match="did you mean 'width'"):
        load_model("dc_motor").with_effect("dead_zone", "input", widht=0.1)


def test_a_user_effect_is_one_file(tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "square_law.py").write_text(
        "from idloop.physics import Effect, EffectParameter, hook\n"
        "@hook\n"
        "def command(value, velocity, sent, elapsed, state, parameters):\n"
        "    return value * abs(value) ** parameters[0]\n"
        "EFFECT = Effect(name='square_law', site='input', text='The drive answers with a power of the command.',\n"
        "                parameters=(EffectParameter('exponent', '-'),), command=command)\n"
    )
    monkeypatch.setenv("IDLOOP_EFFECTS", str(tmp_path))
    model = load_model("dc_motor").with_effects(["square_law@input(exponent=1.0)"])
    run = simulate(model, [0.0], [3.0], TIME)
    nine = simulate(load_model("dc_motor"), [0.0], [9.0], TIME)
    np.testing.assert_allclose(run.output, nine.output, rtol=1e-12)
