"""Predicted limit cycles against python-control, closed solutions and the simulated loop."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

import control
from idloop.errors import InputError
from idloop.estimation.describing_functions import (
    DeadZone,
    FrictionBacklash,
    InertiaBacklash,
    Relay,
    Saturation,
    describing_function,
    effect_element,
    limit_cycles,
    simulate_loop,
)
from idloop.estimation.describing_functions.limit_cycle import grid_roots

LAG = control.tf([1.0], [1.0, 2.0, 1.0, 0.0])  # 1 / (s (s + 1)²)
CUBE = control.tf([12.0], [1.0, 3.0, 3.0, 1.0])


@given(row=st.floats(0.0, 6.0), column=st.floats(0.0, 4.0), turn=st.floats(0.0, 6.3), skew=st.floats(-0.9, 0.9))
def test_the_root_of_a_linear_function_is_found_in_its_cell(
    row: float, column: float, turn: float, skew: float
) -> None:
    rows, columns = np.meshgrid(np.arange(7), np.arange(5), indexing="ij")
    value = np.exp(1j * turn) * ((rows - row) + (skew + 1j) * (columns - column))
    found = grid_roots(value)
    assert len(found) >= 1
    np.testing.assert_allclose(found, np.tile([row, column], (len(found), 1)), atol=1e-7)


def test_no_root_where_the_grid_is_thin_or_unknown() -> None:
    assert grid_roots(np.ones((1, 5), dtype=complex)).shape == (0, 2)
    assert grid_roots(np.full((4, 4), np.nan + 0j)).shape == (0, 2)


@pytest.mark.slow
@given(gain=st.floats(2.1, 50.0), limit=st.floats(0.1, 10.0))
def test_saturation_closed_solution(gain: float, limit: float) -> None:
    # G(jω) is real at ω = 1, so the loop settles where N = 2 / gain.
    found = limit_cycles(gain * LAG, Saturation(limit)).cycles
    assert len(found) == 1
    assert found[0].frequency == pytest.approx(0.5 / np.pi, rel=1e-6)
    assert Saturation(limit).gain(found[0].amplitude) == pytest.approx(2.0 / gain, rel=1e-6)
    assert found[0].stable


def test_limit_cycles_print_as_one_line() -> None:
    text = repr(limit_cycles(8.0 * LAG, Saturation(1.0), unit="V"))
    assert text.startswith("LimitCycles(saturation: stable: ")
    assert " V at 0.1592 Hz" in text
    assert "\n" not in text
    assert repr(limit_cycles(0.5 * LAG, Saturation(1.0))).endswith(": none)")


def test_as_python_control_finds_it() -> None:
    system = control.tf([8.0], [1.0, 2.0, 2.0, 1.0])
    theirs = control.describing_function_response(
        system, control.saturation_nonlinearity(1.0), np.linspace(1.1, 6.0, 50), np.linspace(0.5, 3.0, 500)
    )
    amplitude, omega = theirs.intersections[0]
    (ours,) = limit_cycles(system, Saturation(1.0)).cycles
    assert ours.amplitude == pytest.approx(amplitude, rel=1e-4)
    assert 2.0 * np.pi * ours.frequency == pytest.approx(omega, rel=1e-4)


def test_a_relay_with_dead_zone_has_an_unstable_and_a_stable_one() -> None:
    low, high = limit_cycles(4.0 * LAG, Relay(1.0, 0.3)).cycles
    assert not low.stable
    assert high.stable
    for cycle in (low, high):
        assert Relay(1.0, 0.3).gain(cycle.amplitude) == pytest.approx(0.5, rel=1e-6)
    assert low.growth > 0.0 > high.growth


def test_none_where_the_curves_do_not_meet() -> None:
    assert limit_cycles(1.9 * LAG, Saturation(1.0)).cycles == ()
    assert limit_cycles(control.tf([3.0], [0.2, 1.0, 0.0]), DeadZone(0.2)).cycles == ()


def test_a_cycle_beside_another_growing_mode_is_not_stable() -> None:
    system = LAG + control.tf([40.0], [1.0, 0.02, 400.0])
    small, large = limit_cycles(system, Relay(1.0)).cycles
    # On its own the small one would last: an error of its amplitude dies out. But the slow mode grows beside it.
    assert small.growth < 0.0
    assert not small.stable
    assert large.stable
    signal = simulate_loop(system, Relay(1.0), small, periods=800, steps=50).signal
    assert np.max(np.abs(signal[signal.size // 2 :])) == pytest.approx(large.amplitude, rel=0.25)


@pytest.mark.parametrize(
    ("system", "element", "delay"),
    [
        (CUBE, Saturation(1.0), 0.0),
        (LAG, Relay(1.0), 0.0),
        (4.0 * LAG, Relay(1.0, 0.3), 0.0),
        (control.tf([1.0], [1.0, 1.0, 0.0]), Relay(1.0, 0.1, -0.1), 0.0),
        (1.5 * LAG, FrictionBacklash(0.2), 0.0),
        (control.tf([1.0, 0.3], [1.0, 1.0, 0.0, 0.0]), FrictionBacklash(0.2), 0.0),
        (control.tf([1.0], [1.0, 1.5, 1.0, 0.0]), InertiaBacklash(0.2), 0.0),
        (control.tf([3.0], [1.0, 1.0]), Saturation(1.0), 1.0),
        (control.c2d(CUBE, 0.01), Saturation(1.0), 0.05),
        (control.ss(CUBE), Saturation(2.0), 0.0),
    ],
    ids=[
        "saturation",
        "relay",
        "relay with dead zone",
        "relay with hysteresis",
        "play",
        "play under PI",
        "inertia backlash",
        "delay",
        "sampled with delay",
        "state space",
    ],
)
def test_the_simulated_loop_settles_on_the_prediction(system, element, delay: float) -> None:
    (cycle,) = limit_cycles(system, element, delay=delay).stable
    for start in (0.8, 1.2):
        run = simulate_loop(system, element, cycle, delay=delay, start=start)
        assert run.steady
        assert run.amplitude == pytest.approx(cycle.amplitude, rel=0.05)
        assert run.frequency == pytest.approx(cycle.frequency, rel=0.05)
        assert run.distortion == pytest.approx(cycle.harmonics, rel=0.5)


def test_an_unstable_cycle_is_left_both_ways() -> None:
    system, element = 36.0 * control.tf([1.0], [1.0, 6.0, 5.0, 0.0]), DeadZone(0.5)
    (cycle,) = limit_cycles(system, element).cycles
    assert not cycle.stable
    below, above = (simulate_loop(system, element, cycle, start=s) for s in (0.9, 1.1))
    assert below.amplitude < 0.01 * cycle.amplitude
    assert above.amplitude > 10.0 * cycle.amplitude
    assert not above.steady


def test_the_simulation_of_a_relay_is_exact() -> None:
    # Tsypkin: the relay switches where the sum of all harmonics crosses zero.
    odd = np.arange(1, 4001, 2)
    omega = brentq(lambda w: float(np.sum(np.imag(LAG(1j * odd * w)) / odd)), 0.5, 1.5)
    (cycle,) = limit_cycles(LAG, Relay(1.0)).cycles
    run = simulate_loop(LAG, Relay(1.0), cycle, steps=4000)
    assert 2.0 * np.pi * run.frequency == pytest.approx(omega, rel=1e-3)
    assert run.amplitude == pytest.approx(4.0 / np.pi * abs(LAG(1j * omega)), rel=1e-3)


def test_an_effect_of_the_catalogue_through_its_table() -> None:
    table = describing_function(effect_element("saturation", limit=1.0), np.geomspace(1.01, 10.0, 60))
    (ours,) = limit_cycles(CUBE, table).cycles
    (exact,) = limit_cycles(CUBE, Saturation(1.0)).cycles
    assert ours.amplitude == pytest.approx(exact.amplitude, rel=1e-3)
    assert ours.frequency == pytest.approx(exact.frequency, rel=1e-6)
    assert ours.harmonics == pytest.approx(exact.harmonics, rel=0.1)
    assert ours.stable


def test_a_table_over_amplitude_and_frequency() -> None:
    # A lag is linear: where the frequency alone decides, the gain must be met for any amplitude, so limit it too.
    class Limited:
        name = "limited lag"
        needs_frequency = True

        def answer(self, interval: float):
            lag = effect_element("actuator_lag", time_constant=0.5).answer(interval)
            limit = effect_element("saturation", limit=1.0).answer(interval)
            return lambda value, rate, total: lag(limit(value, 0.0, 0.0), 0.0, 0.0)

    table = describing_function(Limited(), np.geomspace(1.01, 10.0, 15), np.geomspace(0.1, 0.5, 12), samples=128)
    (ours,) = limit_cycles(CUBE, table).cycles
    (exact,) = limit_cycles(CUBE * control.tf([1.0], [0.5, 1.0]), Saturation(1.0)).cycles
    assert ours.amplitude == pytest.approx(exact.amplitude, rel=0.01)
    assert ours.frequency == pytest.approx(exact.frequency, rel=0.003)
    assert ours.stable


def test_results_draw_themselves_and_fit_json() -> None:

    found = limit_cycles(CUBE, Saturation(1.0), unit="V")
    run = simulate_loop(CUBE, Saturation(1.0), found.cycles[0], periods=20, steps=100)
    for result in (found, found.cycles[0], run):
        json.dumps(result.to_dict(), allow_nan=False)
        axes = result.plot()
        assert axes.get_xlabel() or result is found.cycles[0]


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: limit_cycles("G", Relay(1.0)), "not str"),
        (lambda: limit_cycles(control.tf([1], [1, 1], True), Relay(1.0)), "unknown sample time"),
        (lambda: limit_cycles(control.tf([1, 0, 0], [1, 1]), Relay(1.0)), "more zeros than poles"),
        (lambda: limit_cycles(control.append(LAG, LAG), Relay(1.0)), "2 inputs and 2 outputs"),
        (lambda: limit_cycles(LAG, Relay(1.0), delay=-1.0), "the delay is -1"),
        (lambda: limit_cycles(LAG, Relay(1.0), frequency=(2.0, 1.0)), "band must be positive"),
        (lambda: limit_cycles(LAG, Relay(1.0), amplitude=[-1.0, 1.0]), "amplitudes must be"),
        (lambda: limit_cycles(LAG, effect_element("saturation", limit=1.0)), "tabulate it"),
        (lambda: limit_cycles(LAG, describing_function(Relay(1.0), [1.0])), "two amplitudes or more"),
    ],
)
def test_wrong_use_in_one_line(make, words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        make()
    assert "\n" not in str(caught.value)


def test_what_cannot_be_simulated() -> None:
    (cycle,) = limit_cycles(CUBE, Saturation(1.0)).cycles
    with pytest.raises(InputError, match="direct feedthrough"):
        simulate_loop(control.tf([1.0, 1.0], [1.0, 3.0]), Saturation(1.0), cycle)
    with pytest.raises(InputError, match="no whole number of samples"):
        simulate_loop(control.c2d(CUBE, 0.01), Saturation(1.0), cycle, delay=0.015)
    with pytest.raises(InputError, match="take 20 and 16 or more"):
        simulate_loop(CUBE, Saturation(1.0), cycle, periods=5)
