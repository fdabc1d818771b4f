"""Describing functions measured from stepped sines: synthetic records, and machines that are simulated."""

import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter

import control
from idloop.errors import InputError
from idloop.estimation.describing_functions import (
    DeadZone,
    Dwell,
    FrictionBacklash,
    InertiaBacklash,
    Saturation,
    dwells_of,
    find_dwells,
    limit_cycles,
    measure_describing_function,
)
from idloop.estimation.describing_functions.sine_fit import held_sine_fit, refine_frequency, sine_fit
from idloop.physics import load_model
from idloop.physics.model_file import from_text
from idloop.records import Record
from idloop.signals import Signal, build_signal

Stepped = Callable[..., tuple[Signal, Record]]
DC_MOTOR = control.tf([8.255], [1.0, 2.306])
LEVELS = (0.15, 0.25, 0.5, 1.0, 2.0)


@given(a=st.floats(-5.0, 5.0), b=st.floats(-5.0, 5.0), mean=st.floats(-9.0, 9.0), slope=st.floats(-9.0, 9.0))
def test_a_sine_on_a_slope_is_fitted_exactly(a: float, b: float, mean: float, slope: float) -> None:
    time = np.sort(np.random.default_rng(0).uniform(0.0, 2.0, 60))
    value = mean + slope * time + a * np.sin(3.0 * np.pi * time) + b * np.cos(9.0 * np.pi * time)
    fit = sine_fit(time, value, 1.5, 4)
    np.testing.assert_allclose(fit.phasors, [a, 0.0, 1j * b, 0.0], atol=1e-9)


def test_a_held_sine_lags_its_samples_by_half_a_sample() -> None:
    step, f = 0.05, 1.0
    time = np.arange(0.0, 6.0, step)
    fit = held_sine_fit(time, 2.0 * np.sin(2.0 * np.pi * f * time), 1.0, 4.0, f, 2, beside=np.array([2.0 / 3.0]))
    assert fit.phasors[0] == pytest.approx(2.0 * np.sinc(f * step) * np.exp(-1j * np.pi * f * step), rel=1e-12)
    assert abs(fit.phasors[1]) < 1e-12
    assert abs(fit.beside[0]) < 1e-12


def test_the_frequency_of_a_sine_is_refined() -> None:
    time = np.arange(0.0, 5.0, 0.01)
    value = 0.3 + np.sin(2.0 * np.pi * 1.2345 * time + 1.0)
    assert refine_frequency(time, value, 1.25) == pytest.approx(1.2345, rel=1e-6)


def synthetic(noise: np.ndarray, gain: complex = 0.5 - 0.25j, f: float = 0.5, step: float = 0.02) -> Record:
    """A sine of 2 V and a third harmonic, sampled with noise."""
    time = np.arange(noise.shape[0]) * step
    phase = 2.0 * np.pi * f * time
    source = 2.0 * np.sin(phase)
    answer = 2.0 * (gain.real * np.sin(phase) + gain.imag * np.cos(phase)) + 0.1 * np.sin(3.0 * phase)
    output = np.column_stack([source, answer]) + noise
    return Record(
        "synthetic", time, source, time, output, "m.effort", "V", ("a.position", "b.position"), ("rad", "rad")
    )


def test_the_confidence_circle_holds_the_truth_as_often_as_it_says() -> None:
    rng = np.random.default_rng(4)
    hits, errors, stderr = 0, [], []
    for _ in range(200):
        # Coloured noise on both signals.
        noise = lfilter([1.0], [1.0, -0.6], rng.normal(size=(600, 2)), axis=0) * [0.02, 0.1]
        found = measure_describing_function(
            synthetic(noise), "a.position", "b.position", [Dwell(2.0, 12.0, 0.5)], harmonics=5
        )
        errors.append(abs(found.gain[0] - (0.5 - 0.25j)))
        stderr.append(found.stderr[0])
        hits += errors[-1] < found.radius[0]
    # 95 % of 200 with three binomial standard deviations.
    assert 181 <= hits <= 199
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(np.sqrt(np.mean(np.square(stderr))), rel=0.15)


def test_harmonics_and_distortion_of_both_signals() -> None:
    found = measure_describing_function(
        synthetic(np.zeros((600, 2))), "a.position", "b.position", [Dwell(2.0, 12.0, 0.5)], harmonics=5
    )
    third = 0.1 / (2.0 * abs(0.5 - 0.25j))
    assert found.harmonics[0] == pytest.approx([0.0, third, 0.0, 0.0], abs=1e-9)
    assert found.distortion == pytest.approx([third])
    assert found.source_distortion == pytest.approx([0.0], abs=1e-9)
    assert found.amplitude == pytest.approx([2.0])
    assert found.periods == pytest.approx([5.0])
    assert (found.input_unit, found.output_unit) == ("rad", "rad")


def test_one_period_has_no_error_to_tell() -> None:
    found = measure_describing_function(
        synthetic(np.zeros((600, 2))), "a.position", "b.position", [Dwell(2.0, 4.0, 0.5)]
    )
    assert np.isnan(found.stderr[0])
    assert json.loads(json.dumps(found.to_dict(), allow_nan=False))["stderr"] == [None]


@pytest.mark.parametrize("seed", [None, 0])
def test_dead_zone_of_the_motor_by_theory_and_by_measured_sines(stepped: Stepped, seed: int | None) -> None:
    model = load_model("dc_motor").with_effects(["dead_zone@input(width=0.12)"])
    runs = [stepped(model, a, (0.25, 0.5, 1.0), seed=None if seed is None else seed + i) for i, a in enumerate(LEVELS)]
    found = measure_describing_function(
        [record for _, record in runs], None, "motor.velocity", [dwells_of(signal) for signal, _ in runs]
    ).without(DC_MOTOR)
    assert found.amplitude.size == 15
    error = np.abs(found.gain - DeadZone(0.12).gain(found.amplitude))
    if seed is None:
        assert np.max(error) < 2e-4
    else:
        assert np.mean(error < found.radius) > 0.85
        assert np.max(error / found.radius) < 2.0


def test_limit_of_the_motor_by_theory_and_by_measured_sines(stepped: Stepped) -> None:
    model = load_model("dc_motor").with_effects(["saturation@input(limit=0.6)"])
    records = [stepped(model, a, (0.5, 1.0))[1] for a in LEVELS]
    found = measure_describing_function(records, None, "motor.velocity").without(DC_MOTOR)
    np.testing.assert_allclose(found.gain, Saturation(0.6).gain(found.amplitude), atol=5e-4)


def test_steps_are_found_in_the_command_as_they_were_sent(stepped: Stepped) -> None:
    signal, record = stepped(load_model("dc_motor"), 0.4, (0.3, 0.7, 1.9), periods=5, settle=3)
    found = find_dwells(record)
    sent = dwells_of(signal)
    assert [dwell.frequency for dwell in found] == pytest.approx([dwell.frequency for dwell in sent], rel=1e-3)
    given_, looked = (measure_describing_function(record, None, "motor.velocity", dwells) for dwells in (sent, found))
    np.testing.assert_allclose(looked.gain, given_.gain, rtol=5e-3)


def test_steps_of_amplitude_are_told_apart() -> None:
    time = np.arange(0.0, 60.0, 0.01)
    value = np.repeat([0.2, 1.0, 1.1], 2000) * np.sin(2.0 * np.pi * 0.5 * time)
    record = Record("steps", time, value, time, value[:, None], "m.effort", "V", ("m.position",), ("rad",))
    found = measure_describing_function(record, None, "m.position")
    assert found.amplitude == pytest.approx([0.2, 1.0, 1.1], rel=1e-3)
    assert found.frequency == pytest.approx([0.5] * 3, rel=1e-3)


def test_play_before_the_sensor_between_two_outputs(stepped: Stepped) -> None:
    plain = load_model("dc_motor")
    played = plain.with_effects(["backlash@position[motor](gap=0.2)"])
    records, dwells = [], []
    for amplitude in (0.1, 0.2, 0.5, 2.0):
        signal, motor = stepped(plain, amplitude, (0.5,))
        load = stepped(played, amplitude, (0.5,))[1]
        both = np.column_stack([motor.output[:, 0], load.output[:, 0]])
        names = ("motor.position", "load.position")
        records.append(replace(motor, output=both, output_names=names, output_units=("rad", "rad")))
        dwells.append(dwells_of(signal))
    found = measure_describing_function(records, "motor.position", "load.position", dwells)
    np.testing.assert_allclose(found.gain, FrictionBacklash(0.2).gain(found.amplitude), atol=1e-3)


PAIR = """
schema: idloop/model/1
name: pair
input: {{topic: joint_command, joint: motor, field: effort, unit: N·m}}
outputs:
  - {{topic: joint_states, joint: motor, field: position, unit: rad}}
  - {{topic: joint_states, joint: load, field: position, unit: rad}}
bodies:
  - {{name: motor, inertia: 1.0, viscous_friction: 0.5}}
  - {{name: load, inertia: {inertia}, viscous_friction: {friction}}}
couplings:
  - {{from: motor, to: load, stiffness: {stiffness}, damping: {damping}}}
drive: {{gain: 1.0}}
effects:
  - {{effect: backlash, at: motor-load, gap: 0.2}}
"""


@pytest.mark.parametrize(
    ("element", "values", "frequency"),
    [
        (FrictionBacklash(0.2), {"inertia": 1e-3, "friction": 1.0, "stiffness": 2e3, "damping": 2.0}, 0.25),
        (InertiaBacklash(0.2), {"inertia": 0.05, "friction": 0.0, "stiffness": 3e3, "damping": 24.0}, 0.5),
    ],
    ids=["load held by friction", "load held by inertia"],
)
def test_a_gap_between_two_bodies_is_the_backlash_of_what_holds_the_load(
    stepped: Stepped, element, values: dict[str, float], frequency: float
) -> None:
    model = from_text(PAIR.format(**values), None)
    for torque in (2.0, 4.0):
        signal, record = stepped(model, torque, (frequency,), settle=6)
        found = measure_describing_function(record, "motor.position", "load.position", dwells_of(signal))
        # The walls give a little, as the closed form's do not.
        np.testing.assert_allclose(found.gain, element.gain(found.amplitude), atol=6e-3)


def test_a_measured_table_predicts_the_limit_cycle(stepped: Stepped) -> None:
    model = load_model("dc_motor").with_effects(["saturation@input(limit=0.6)"])
    records = [stepped(model, a, (0.5,))[1] for a in np.geomspace(0.65, 4.0, 12)]
    measured = measure_describing_function(records, None, "motor.velocity").without(DC_MOTOR)
    loop = control.tf([8.255 * 4.0], np.polymul([1.0, 2.306, 0.0], [0.2, 1.0]))
    (ours,) = limit_cycles(loop, measured).stable
    (exact,) = limit_cycles(loop, Saturation(0.6)).stable
    assert ours.amplitude == pytest.approx(exact.amplitude, rel=0.01)
    assert ours.frequency == pytest.approx(exact.frequency, rel=1e-3)


def test_what_was_measured_draws_itself(stepped: Stepped) -> None:

    record = stepped(load_model("dc_motor"), 0.4, (0.3, 0.7), seed=1)[1]
    found = measure_describing_function(record, None, "motor.velocity")
    size, _, distortion = found.plot()
    assert size.get_ylabel() == "|N| [rad/s/V]"
    assert distortion.get_xlabel() == "frequency [Hz]"


BAD = synthetic(np.zeros((600, 2)))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: measure_describing_function([], None, "b.position"), "no records"),
        (lambda: measure_describing_function(BAD, None, "b.positon"), "did you mean 'b.position'"),
        (lambda: measure_describing_function(BAD, "x", "b.position"), "no signal 'x'"),
        (
            lambda: measure_describing_function(BAD, None, "b.position", [Dwell(2.0, 3.0, 0.5)]),
            "shorter than one period",
        ),
        (lambda: measure_describing_function(BAD, None, "b.position", [Dwell(2.0, 42.0, 0.5)]), "does not lie in it"),
        (lambda: measure_describing_function(BAD, None, "b.position", [Dwell(2.0, 3.0, 40.0)]), "too coarsely"),
        (lambda: measure_describing_function(BAD, None, "b.position", [[], []]), "dwells of 2 records for 1"),
        (lambda: measure_describing_function(BAD, None, "b.position", probability=1.0), "probability 1"),
        (
            lambda: measure_describing_function(
                replace(BAD, input=np.zeros(600)), None, "b.position", [Dwell(2.0, 12.0, 0.5)]
            ),
            "no sine of this frequency in m.effort",
        ),
        (
            lambda: measure_describing_function(
                replace(BAD, output=BAD.output * [1.0, np.nan]), None, "b.position", [Dwell(2.0, 12.0, 0.5)]
            ),
            "b.position was not measured",
        ),
        (lambda: find_dwells(replace(BAD, input=np.ones(600))), "does not oscillate"),
        (lambda: find_dwells(BAD, settle_periods=20), "no 22 equal periods in a row"),
        (
            lambda: dwells_of(build_signal("prbs", sample_time=0.01, duration=1.0, amplitude=1.0)),
            "no steps of a sine",
        ),
        (
            lambda: measure_describing_function(BAD, None, "b.position", [Dwell(2.0, 12.0, 0.5)]).without(
                control.tf([1.0, 0.0, np.pi**2], [1.0, 2.0, 1.0])
            ),
            "a pole or a zero",
        ),
    ],
)
def test_wrong_use_in_one_line(make, words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        make()
    assert "\n" not in str(caught.value)
