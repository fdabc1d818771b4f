import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.signal import welch
from scipy.special import ndtr

from idloop.estimation.force_balance.motion import (
    _least_error_cutoff,
    _spectrum,
    _turned,
    differentiate,
    excitation_band,
    low_pass,
    measured_motion,
    uniform,
)
from idloop.estimation.observer.sensor_noise import noise_std, resolution
from idloop.estimation.sensors import lagging_sensors
from idloop.physics import load_model
from idloop.records import Record


@pytest.mark.slow
@given(st.floats(0.5, 5.0), st.floats(0.0, 6.0))
def test_derivative_of_a_sine(frequency: float, phase: float) -> None:
    t = np.arange(0.0, 4.0, 1e-3)
    w = 2.0 * np.pi * frequency
    slope = differentiate(np.sin(w * t + phase), 1e-3)
    assert slope[2:-2] == pytest.approx(w * np.cos(w * t + phase)[2:-2], abs=1e-6 * w)


def test_low_pass_keeps_the_band_in_phase_and_stops_the_rest() -> None:
    t = np.arange(0.0, 10.0, 1e-3)
    slow, fast = np.sin(2 * np.pi * t), np.sin(2 * np.pi * 200.0 * t)
    left = low_pass(slow + fast, 20.0, 1e-3)[1000:-1000]
    assert left == pytest.approx(slow[1000:-1000], abs=1e-3)


def test_excited_band_is_found_under_noise() -> None:
    rng = np.random.default_rng(0)
    t = np.arange(0.0, 60.0, 1e-3)
    position = np.sin(2 * np.pi * 3.0 * t) + 1e-4 * rng.normal(size=len(t))
    assert 2.5 < excitation_band(np.diff(position) / 1e-3, 1e-3) < 5.0


@given(st.integers(100, 3000), st.integers(64, 300), st.integers(0, 99))
def test_the_spectrum_is_that_of_welch(samples: int, segment: int, seed: int) -> None:
    walk = np.cumsum(np.random.default_rng(seed).normal(size=max(samples, segment)))
    frequency, power = _spectrum(walk, segment, 1e-3)
    expected, density = welch(walk, fs=1e3, nperseg=segment)
    assert frequency == pytest.approx(expected)
    # Only shares of it are used.
    assert power / np.sum(power) == pytest.approx(density / np.sum(density))


def test_uneven_stamps_are_resampled_and_big_holes_refused() -> None:
    rng = np.random.default_rng(1)
    t = np.cumsum(rng.uniform(0.008, 0.012, 500))
    found = uniform(t, 3.0 * t)
    assert found is not None
    assert np.ptp(np.diff(found[0])) < 1e-9
    assert found[1] == pytest.approx(3.0 * found[0])
    holes = 3.0 * t
    holes[100:200] = np.nan
    assert uniform(t, holes) is None


@pytest.mark.parametrize("order", [0, 1])
@pytest.mark.parametrize("noise", [1e-5, 1e-3, 3e-2])
def test_the_cutoff_is_that_of_the_least_error_of_the_velocity(order: int, noise: float) -> None:
    rng, step = np.random.default_rng(7), 1e-3
    velocity = low_pass(rng.normal(size=20_000), 15.0, step)
    true = velocity if order else np.concatenate([[0.0], np.cumsum(0.5 * (velocity[1:] + velocity[:-1]))]) * step
    measured = true + noise * (1.0 if order else 0.01) * rng.normal(size=len(true))

    def error(cutoff: float) -> float:
        kept = low_pass(measured, cutoff, step)
        return float(np.std((kept if order else differentiate(kept, step)) - velocity))

    found = _least_error_cutoff(*((None, measured) if order else (measured, None)), step)
    least = min(error(cutoff) for cutoff in np.geomspace(2.0, 449.0, 40))
    # A spectrum of short pieces shows no less than some millionths of the motion's power at other frequencies.
    assert error(found) < 1.2 * least + 0.006 * np.std(velocity)


@given(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(1e-6, 1.0))
def test_a_body_moves_both_ways_in_a_sample_by_the_share_of_its_time(start: float, end: float, noise: float) -> None:
    share = _turned(np.array([start, end]), noise)
    half = np.linspace(start, 0.5 * (start + end), 2001)
    chance = ndtr(-np.sign(half[0] or 1.0) * half / noise)
    alone = ndtr(-abs(start) / noise)
    assert share[0] == pytest.approx(0.5 * (np.mean(chance) + alone), abs=2e-3)


@given(st.floats(1e-6, 1e3), st.integers(0, 100))
def test_noise_level_under_smooth_motion(std: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    t = np.linspace(0.0, 10.0, 4000)
    assert noise_std(50 * std * np.sin(t) + std * rng.normal(size=4000)) == pytest.approx(std, rel=0.12)


def test_noise_of_a_quantised_sensor_is_that_of_rounding() -> None:
    y = 0.01 * np.round(np.sin(np.linspace(0.0, 20.0, 5000)) / 0.01)
    assert resolution(y) == pytest.approx(0.01)
    assert noise_std(y) >= 0.01 / np.sqrt(12.0) * 0.999


@given(st.integers(0, 99), st.floats(1e-5, 10.0))
def test_a_quantum_is_found_in_a_sweep_without_repeated_values(seed: int, step: float) -> None:
    rng = np.random.default_rng(seed)
    sweep = np.cumsum(rng.uniform(0.5, 3.0, 2000))
    assert resolution(step * np.round(sweep)) == pytest.approx(step, rel=1e-6)
    assert resolution(step * sweep) == 0.0


def test_a_lagging_sensor_is_not_used_beside_another() -> None:
    t = np.arange(0.0, 4.0, 1e-3)
    place, late = np.sin(6.0 * t), 6.0 * np.cos(6.0 * (t - 0.05))
    model = load_model("axis")
    names, units = model.output_names, tuple(o.unit for o in model.outputs)
    record = Record("run", t, np.zeros_like(t), t, np.column_stack([place, late]), "effort", "N·m", names, units)
    slow = model.with_effects(["velocity_filter@velocity[axis](time_constant=0.05)"])
    assert lagging_sensors(model) == set()
    assert lagging_sensors(slow) == {1}
    truth = 6.0 * np.cos(6.0 * t)
    # The data show it where the model does not say it.
    for one in (slow, model):
        motion = measured_motion(one, record)
        assert motion is not None
        assert np.max(np.abs(motion.velocity[100:-100, 0] - truth[100:-100])) < 0.01


@given(st.integers(1, 8), st.integers(0, 99))
def test_a_velocity_that_follows_late_is_not_used(samples: int, seed: int) -> None:
    rng, step = np.random.default_rng(seed), 1e-3
    time = np.arange(0.0, 8.0, step)
    frequencies = rng.uniform(1.0, 12.0, 5)
    phases = rng.uniform(0.0, 6.0, 5)

    def velocity(instants: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.sum(np.cos(2 * np.pi * frequencies * instants[:, None] + phases), axis=1)

    position = np.sum(np.sin(2 * np.pi * frequencies * time[:, None] + phases) / (2 * np.pi * frequencies), axis=1)
    position += 1e-5 * rng.normal(size=len(time))
    for late in (0, samples):
        measured = velocity(time - late * step) + 1e-3 * rng.normal(size=len(time))
        record = Record(
            "run", time, np.zeros(len(time)), time, np.column_stack([position, measured]), "joint_command", "N·m",
            ("axis.position", "axis.velocity"), ("rad", "rad/s"), start_ns=10**9,
        )  # fmt: skip
        motion = measured_motion(load_model("axis"), record)
        assert motion is not None
        used = motion.measured[0][1] is not None
        apart = np.sqrt(np.mean((measured - velocity(time)) ** 2) / np.mean(velocity(time) ** 2))
        assert used == (late == 0) or apart < 0.04


def test_a_reading_that_is_missing_leaves_an_even_grid_as_it_is() -> None:
    """Stamps that are even but for rounding have one grid, whether every reading is there or not."""
    time = 0.01 * np.arange(3000) + np.where(np.arange(3000) % 3 == 0, 1e-7, -1e-7)
    gappy = np.cos(time)
    gappy[500] = np.nan
    found = [uniform(time, values) for values in (np.sin(time), gappy)]
    for one in found:
        assert one is not None
        np.testing.assert_array_equal(one[0], time)
    assert np.all(np.isfinite(found[1][1]))
