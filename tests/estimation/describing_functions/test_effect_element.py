"""Every effect of the catalogue driven alone, against closed forms where there are any."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import j1

from idloop.errors import IdloopError, InputError
from idloop.estimation.describing_functions import describing_function, drive_by_sine, effect_element
from idloop.physics import catalogue

amplitudes = st.floats(0.05, 20.0)
frequencies = st.floats(0.02, 50.0)
VALUES = {
    "compliance": {"stiffness": 30.0, "damping": 0.5},
    "stribeck_friction": {"coulomb": 0.3, "static": 0.5, "velocity": 0.2},
    "presliding_friction": {"level": 0.3, "stiffness": 5.0},
}


@pytest.mark.parametrize("name", sorted(catalogue()))
def test_every_effect_of_the_catalogue_gives_a_describing_function(name: str) -> None:
    for effect in catalogue()[name]:
        for drive in {"input": ("command",), "coupling": ("twist",), "body": ("position", "velocity")}.get(
            effect.site, effect.outputs
        ):
            values = VALUES.get(name) or {
                spec.name: 0.3 for spec in effect.parameters if spec.min <= 0.3 <= spec.max and not spec.integer
            }
            found = describing_function(effect_element(name, effect.site, drive, **values), [0.5, 2.0], 0.5)
            assert np.all(np.isfinite(found.gain))
            json.dumps(found.to_dict(), allow_nan=False)


def gain(name: str, a: float, f: float, /, **given) -> complex:
    return drive_by_sine(effect_element(name, **given), a, f).gain


@given(f=frequencies, tau=st.floats(1e-3, 2.0))
def test_lag_and_filter_are_first_order_at_any_time_constant(f: float, tau: float) -> None:
    exact = 1.0 / (1.0 + 2j * np.pi * f * tau)
    # A lag that is over within one sample is seen as none.
    assert gain("actuator_lag", 1.0, f, time_constant=tau) == pytest.approx(exact, abs=5e-4)
    assert gain("velocity_filter", 1.0, f, time_constant=tau) == pytest.approx(exact, abs=3e-6)


@given(a=amplitudes, f=frequencies, periods=st.floats(0.0, 3.3))
def test_a_delay_turns_the_phase_only(a: float, f: float, periods: float) -> None:
    delay = min(periods / f, 1.0)
    exact = np.exp(-2j * np.pi * f * delay)
    assert gain("input_delay", a, f, delay=delay) == pytest.approx(exact, abs=3e-6)
    assert gain("sensor_delay", a, f, delay=delay) == pytest.approx(exact, abs=3e-6)


@given(f=st.floats(0.1, 3.0), damping=st.floats(0.2, 2.0), split=st.floats(0.1, 0.9))
def test_compliance_is_the_far_half_on_its_spring(f: float, damping: float, split: float) -> None:
    s, far = 2j * np.pi * f, 0.4 * split
    exact = (30.0 + damping * s) / (30.0 + damping * s + far * s**2)
    found = gain("compliance", 1.0, f, body_inertia=0.4, stiffness=30.0, damping=damping, split=split)
    assert found == pytest.approx(exact, abs=1e-3 * abs(exact))


@given(a=st.floats(0.05, 4.0), f=frequencies)
def test_forces_that_are_powers_of_the_motion(a: float, f: float) -> None:
    omega = 2.0 * np.pi * f
    assert gain("viscous_friction", a, f, coefficient=0.3) == pytest.approx(0.3j * omega, rel=1e-9)
    assert gain("cable_spring", a, f, stiffness=0.3) == pytest.approx(0.3, rel=1e-9)
    assert gain("quadratic_drag", a, f, drive="velocity", coefficient=0.3) == pytest.approx(
        8.0 / (3.0 * np.pi) * 0.3 * a, rel=1e-5
    )
    assert gain("hardening_stiffness", a, f, coupling_stiffness=2.0, cubic=0.3) == pytest.approx(
        2.0 + 0.75 * 0.3 * a**2, rel=1e-9
    )


@given(a=st.floats(0.05, 4.0), phase=st.floats(-3.0, 3.0))
def test_imbalance_and_cogging_are_bessel_functions_of_the_swing(a: float, phase: float) -> None:
    assert gain("imbalance", a, 1.0, amplitude=0.3, phase=phase) == pytest.approx(
        0.6 * j1(a) * np.cos(phase) / a, abs=1e-9
    )
    assert gain("cogging", a, 1.0, amplitude=0.3, harmonic=6, phase=phase) == pytest.approx(
        0.6 * j1(6.0 * a) * np.cos(phase) / a, abs=1e-9
    )


def test_play_and_slip_do_not_depend_on_the_frequency() -> None:
    for effect in (
        effect_element("backlash", "output", gap=0.3),
        effect_element("slip", coupling_stiffness=2.0, limit=0.7),
    ):
        slow, fast = (drive_by_sine(effect, 1.0, f).gain for f in (0.01, 30.0))
        assert fast == pytest.approx(slow, rel=1e-9)
        assert slow.imag != 0.0


def test_lost_motion_of_a_coupling_is_a_dead_zone_of_half_the_gap() -> None:
    twist = gain("backlash", 1.0, 1.0, site="coupling", coupling_stiffness=3.0, gap=0.6)
    assert twist == pytest.approx(3.0 * gain("dead_zone", 1.0, 1.0, width=0.3), rel=1e-9)


def test_friction_that_grows_with_the_load_needs_a_load() -> None:
    loaded = gain("load_dependent_friction", 2.0, 1.0, drive="velocity", ratio=0.1, transmitted_force=5.0)
    assert loaded == pytest.approx(4.0 * 0.5 / (2.0 * np.pi), rel=1e-5)
    assert gain("load_dependent_friction", 2.0, 1.0, ratio=0.1) == 0.0


def test_a_voltage_limit_depends_on_the_speed() -> None:
    values = {"supply": 1.0, "back_emf": 0.5, "resistance": 1.0}
    standing = gain("speed_limit_voltage", 2.0, 1.0, **values)
    assert standing == pytest.approx(gain("saturation", 2.0, 1.0, limit=1.0), abs=1e-12)
    assert abs(gain("speed_limit_voltage", 2.0, 1.0, velocity_per_command=0.5, **values)) < abs(standing)


def test_a_bias_moves_the_working_point() -> None:
    element = effect_element("dead_zone", width=1.0)
    assert drive_by_sine(element, 0.5, 1.0).gain == 0.0
    beside = drive_by_sine(element, 0.5, 1.0, bias=3.0)
    assert beside.gain == pytest.approx(1.0)
    assert beside.mean == pytest.approx(2.0)
    assert describing_function(element, [0.5], bias=3.0).gain == pytest.approx([1.0])


def test_distortion_of_a_square_wave_and_of_a_sine() -> None:
    square = drive_by_sine(effect_element("coulomb_friction", drive="velocity", level=1.0), 2.0, 1.0)
    assert square.distortion == pytest.approx(np.sqrt(np.pi**2 / 8.0 - 1.0), rel=1e-4)
    assert square.harmonics[:3] == pytest.approx([0.0, 1.0 / 3.0, 0.0], abs=1e-5)
    assert drive_by_sine(effect_element("dead_zone", width=0.0), 2.0, 1.0).distortion < 1e-6


def test_a_constant_answer_has_no_distortion_in_json() -> None:
    answer = drive_by_sine(effect_element("dead_zone", width=1.0), 0.5, 1.0)
    assert np.isnan(answer.distortion)
    assert json.loads(json.dumps(answer.to_dict(), allow_nan=False))["distortion"] is None


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: effect_element("dead_zon", width=1.0), "did you mean 'dead_zone'"),
        (lambda: effect_element("backlash", gap=1.0), "say which: coupling or output"),
        (lambda: effect_element("dead_zone", "body", width=1.0), "acts at input"),
        (lambda: effect_element("dead_zone", width=-1.0), "width is -1; it must be 0 to inf"),
        (lambda: effect_element("dead_zone", with_=1.0), "no parameter 'with_'"),
        (lambda: effect_element("dead_zone", drive="position"), "is driven by command, not 'position'"),
        (lambda: effect_element("velocity_filter", drive="position"), "is driven by velocity"),
        (lambda: effect_element("stribeck_friction", coulomb=1.0, static=0.5), "do not go together"),
        (lambda: effect_element("slip", coupling_stiffness=0.0), "coupling_stiffness is 0"),
        (lambda: describing_function(effect_element("actuator_lag", time_constant=1.0), [1.0]), "give it in Hz"),
        (lambda: describing_function(effect_element("dead_zone"), [1.0], 0.0), "frequency is 0"),
        (lambda: drive_by_sine(effect_element("dead_zone"), 1.0, 1.0, samples=8), "8 samples per period"),
    ],
)
def test_wrong_use_in_one_line(make, words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        make()
    assert "\n" not in str(caught.value)


def test_an_answer_that_never_repeats_is_said_so() -> None:
    undamped = effect_element("compliance", stiffness=30.0, damping=0.0, split=0.5)
    with pytest.raises(IdloopError, match="no steady answer"):
        drive_by_sine(undamped, 1.0, 0.913, samples=16, harmonics=2)
