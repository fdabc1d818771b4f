"""Multisines: lines, phases, symmetry, crest factor."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.signals import build_signal

COMMON = {"sample_time": 0.001, "duration": 6.0, "period": 2.0, "frequency_min": 1.0, "frequency_max": 50.0}


@pytest.mark.parametrize("grid", ["full", "odd", "odd_random"])
def test_only_the_excited_lines_carry_power_and_all_alike(grid):
    signal = build_signal("multisine", grid=grid, seed=3, **COMMON)
    assert signal.period_samples == 2000
    amplitude = 2.0 * np.abs(np.fft.rfft(signal.value[:2000])) / 2000
    excited = signal.lines.excited
    assert np.allclose(amplitude[excited], amplitude[excited[0]])
    assert np.allclose(np.delete(amplitude, excited), 0.0, atol=1e-12)
    assert signal.lines.fundamental == pytest.approx(0.5)
    assert excited[0] * 0.5 >= 1.0
    assert excited[-1] * 0.5 <= 50.0
    assert np.max(np.abs(signal.value)) == pytest.approx(1.0)


def test_odd_grid_has_half_wave_symmetry():
    value = build_signal("multisine", grid="odd", **COMMON).value[:2000]
    assert np.allclose(value[1000:], -value[:1000])


def test_odd_random_leaves_one_line_of_each_group_for_detection():
    lines = build_signal("multisine", grid="odd_random", group=5, seed=9, **COMMON).lines
    odd = np.sort(np.concatenate([lines.excited, lines.odd_detection]))
    assert odd.tolist() == list(range(3, 100, 2))
    groups = odd[: odd.size // 5 * 5].reshape(-1, 5)
    assert np.isin(groups, lines.odd_detection).sum(axis=1).tolist() == [1] * len(groups)
    assert lines.even_detection.tolist() == list(range(2, 101, 2))


def test_a_static_nonlinearity_shows_on_its_own_detection_lines():
    signal = build_signal("multisine", grid="odd_random", seed=2, **COMMON)
    value = signal.value[:2000]

    def level(output, lines):
        return np.max(np.abs(np.fft.rfft(output))[lines])

    lines = signal.lines
    cubed, squared = value**3, value**2
    assert level(cubed, lines.odd_detection) > 1.0
    assert level(cubed, lines.even_detection) < 1e-9
    assert level(squared, lines.even_detection) > 1.0
    assert level(squared, lines.odd_detection) < 1e-9


def test_crest_factor_reduction_keeps_the_spectrum():
    plain = build_signal("multisine", seed=1, **COMMON)
    better = build_signal("multisine", seed=1, crest_iterations=200, **COMMON)
    assert better.crest_factor < 0.65 * plain.crest_factor
    assert better.crest_factor < 1.75
    amplitude = np.abs(np.fft.rfft(better.value[:2000]))[better.lines.excited]
    assert np.allclose(amplitude, amplitude[0])


def test_schroeder_phases_of_a_full_band_have_a_low_crest_factor():
    signal = build_signal("multisine", phases="schroeder", **COMMON)
    assert signal.crest_factor < 1.9


def test_period_defaults_to_the_duration_and_a_cut_period_is_reported():
    signal = build_signal("multisine", sample_time=0.01, duration=10.0)
    assert signal.period_samples == 1000
    assert build_signal("multisine", sample_time=0.01, period=4.0).value.size == 400
    assert "leak" in build_signal("multisine", sample_time=0.01, duration=2.0, period=4.0).notes[0]
