"""Exact oscillations of relay loops against closed solutions and the simulated loop."""

import json
import math

import numpy as np
import pytest
from scipy.optimize import brentq

import control
from idloop.errors import InputError
from idloop.estimation.describing_functions import Relay, limit_cycles, relay_cycle, relay_cycles, simulate_loop

LAG = control.tf([1.0], [1.0, 1.0])
THIRD = control.tf([1.0], [1.0, 2.0, 1.0, 0.0])


@pytest.mark.parametrize("share", [0.001, 0.1, 0.5, 0.95])
@pytest.mark.parametrize(("gain", "constant", "level"), [(1.0, 1.0, 1.0), (4.0, 0.05, 0.5)])
def test_a_thermostat_oscillates_as_its_exponentials_say(share: float, gain: float, constant: float, level: float):
    on = share * gain * level
    (cycle,) = relay_cycles(control.tf([gain], [constant, 1.0]), Relay(level, on, -on))
    assert cycle.frequency == pytest.approx(0.5 / constant / math.log((1.0 + share) / (1.0 - share)), rel=1e-6)
    assert cycle.peak == pytest.approx(on, rel=1e-6)
    assert cycle.stable


def test_a_relay_whose_hysteresis_is_never_reached_rests():
    assert relay_cycles(LAG, Relay(1.0, 1.1, -1.1)) == ()
    assert relay_cycles(LAG, Relay(1.0)) == ()


def test_tsypkin_finds_the_same():
    odd = np.arange(1, 4001, 2)
    omega = brentq(lambda w: float(np.sum(np.imag(THIRD(1j * odd * w)) / odd)), 0.5, 1.5)
    (cycle,) = relay_cycles(THIRD, Relay(1.0))
    assert 2.0 * np.pi * cycle.frequency == pytest.approx(omega, rel=1e-6)


def test_behind_a_mode_that_rings_there_are_several(monkeypatch):
    system, relay = control.tf([1.0], [5.0, 1.0]) + control.tf([20.0], [1.0, 0.2, 400.0]), Relay(1.0, 0.7, -0.7)
    found = relay_cycles(system, relay)
    assert [one.frequency for one in found] == pytest.approx([0.07781, 0.08174, 0.08605, 0.2898, 3.229], rel=1e-3)
    assert all(one.stable for one in found)
    monkeypatch.setattr(relay_cycle, "TURN", 0.04)
    assert [one.frequency for one in relay_cycles(system, relay)] == pytest.approx([one.frequency for one in found])


def test_behind_a_delay_the_input_goes_on_after_the_threshold():
    (cycle,) = relay_cycles(LAG, Relay(1.0, 0.2, -0.2), delay=0.5)
    assert cycle.peak == pytest.approx(1.0 - 0.8 * math.exp(-0.5), rel=1e-9)


@pytest.mark.parametrize(
    ("system", "relay", "delay"),
    [
        (LAG, Relay(1.0, 0.3, -0.3), 0.0),
        (LAG, Relay(1.0, 0.2, -0.2), 0.5),
        (LAG, Relay(2.0), 0.5),
        (THIRD, Relay(1.0), 0.0),
        (control.tf([1.0], [1.0, 0.0]), Relay(1.0, 0.2, -0.2), 0.0),
        (control.tf([1.0], [1.0, -1.0]), Relay(1.0, 0.2, -0.2), 0.0),
        (control.tf([1.0], [1.0, 2.0, 1.0]), Relay(1.0, 0.2, -0.2), 0.0),
    ],
    ids=["thermostat", "late thermostat", "late relay", "third order", "integrator", "unstable", "second order"],
)
def test_the_simulated_loop_settles_on_it(system, relay: Relay, delay: float):
    (cycle,) = relay_cycles(system, relay, delay=delay)
    assert cycle.stable
    run = simulate_loop(system, relay, cycle, delay=delay, start=1.2)
    assert run.steady
    assert run.frequency == pytest.approx(cycle.frequency, rel=0.005)
    assert run.amplitude == pytest.approx(cycle.amplitude, rel=0.005)


def test_limit_cycles_names_what_the_first_harmonic_misses():
    found = limit_cycles(LAG, Relay(1.0, 0.3, -0.3), unit="K")
    assert found.cycles == ()
    assert repr(found) == "LimitCycles(relay: none by the first harmonic; exactly stable: peak 0.3 K at 0.8077 Hz)"
    document = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert document["exact"][0]["peak"] == pytest.approx(0.3)
    assert any("exact" in text.get_text() for text in found.plot().get_legend().get_texts())
    assert limit_cycles(LAG, Relay(1.0, 0.3)).exact == ()
    assert limit_cycles(control.c2d(LAG, 0.01), Relay(1.0, 0.3, -0.3)).exact == ()


@pytest.mark.parametrize(
    ("system", "relay", "words"),
    [
        (LAG, Relay(1.0, 0.3), "with a dead zone"),
        (control.c2d(LAG, 0.1), Relay(1.0), "continuous system"),
        (control.tf([1.0, 2.0], [1.0, 1.0]), Relay(1.0), "direct feedthrough"),
    ],
)
def test_what_has_no_exact_cycle_is_one_line(system, relay: Relay, words: str):
    with pytest.raises(InputError, match=words):
        relay_cycles(system, relay)
