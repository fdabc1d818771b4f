"""What holds for every kind of signal."""

from __future__ import annotations

import inspect

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idloop.errors import InputError
from idloop.signals import COMMON_PARAMETERS, SIGNALS, build_signal, check_signal
from idloop.signals.generate import ramp

KINDS = sorted(SIGNALS)
WANTED = {
    "zero", "constant", "step", "sine", "square", "saw", "triangle", "stepped_sine", "chirp", "prbs", "rgs",
    "multilevel", "multisine", "coast_down", "smooth",
}  # fmt: skip


def test_every_kind_of_the_catalogue_is_there():
    assert set(SIGNALS) == WANTED


@pytest.mark.parametrize("name", KINDS)
def test_table_and_generator_agree(name):
    arguments = list(inspect.signature(SIGNALS[name].generate).parameters)[1:]
    assert arguments == [spec.name for spec in SIGNALS[name].parameters]


@pytest.mark.parametrize("name", KINDS)
def test_defaults_of_the_table_pass_their_own_check(name):
    for spec in (*COMMON_PARAMETERS, *SIGNALS[name].parameters):
        assert spec.description.endswith(".")
        if not spec.required:
            assert spec.check(spec.default, "here") == spec.default


@pytest.mark.parametrize("name", KINDS)
@given(
    amplitude=st.floats(0.0, 100.0),
    offset=st.floats(-100.0, 100.0),
    seed=st.integers(0, 2**53),
    ramp_in=st.floats(0.0, 3.0),
)
def test_size_range_and_repeatability(name, amplitude, offset, seed, ramp_in):
    wanted = {
        "sample_time": 0.01,
        "duration": 10.0,
        "amplitude": amplitude,
        "offset": offset,
        "seed": seed,
        "ramp_in": ramp_in,
    }
    signal = build_signal(name, **wanted)
    assert signal.time.shape == signal.value.shape == (1000,)
    assert np.allclose(np.diff(signal.time), 0.01)
    assert np.all(np.isfinite(signal.value))
    again = build_signal(name, **signal.parameters)
    assert np.array_equal(again.value, signal.value)
    if SIGNALS[name].amplitude_means == "peak":
        # The fade pulls towards zero, so the bound is that of the signal joined with zero.
        low, high = min(offset - amplitude, 0.0), max(offset + amplitude, 0.0)
        slack = 1e-9 * (amplitude + abs(offset))
        assert np.all(signal.value >= low - slack)
        assert np.all(signal.value <= high + slack)


@pytest.mark.parametrize("name", ["prbs", "rgs", "multilevel", "multisine", "smooth"])
def test_another_seed_gives_another_signal(name):
    first, second = (build_signal(name, sample_time=0.01, duration=10.0, seed=s) for s in (1, 2))
    assert not np.array_equal(first.value, second.value)


@pytest.mark.parametrize("name", sorted(set(KINDS) - {"smooth"}))
def test_ramp_in_starts_at_zero_and_leaves_the_rest_alone(name):
    common = {"sample_time": 0.01, "duration": 10.0, "amplitude": 2.0, "offset": 0.5, "seed": 4}
    plain, faded = build_signal(name, **common), build_signal(name, ramp_in=1.0, **common)
    assert faded.value[0] == 0.0
    assert np.allclose(faded.value[:100], plain.value[:100] * ramp(100, 0.01, 1.0))
    assert np.array_equal(faded.value[100:], plain.value[100:])


@pytest.mark.parametrize(
    ("name", "parameters"),
    [
        *((name, {}) for name in ("zero", "constant", "sine", "square", "saw", "triangle")),
        ("chirp", {"sweep_time": 7.0}),
        ("prbs", {"order": 8, "clock_divider": 3}),
        ("prbs", {"order": 8, "inverse_repeat": True}),
        ("multisine", {"period": 9.0}),
        ("coast_down", {"fractions": [0.3, 1.0]}),
    ],
)
def test_declared_period_is_the_period(name, parameters):
    signal = build_signal(name, sample_time=0.01, duration=30.0, seed=5, **parameters)
    period = signal.period_samples
    assert period < signal.value.size
    assert np.allclose(signal.value[period:], signal.value[:-period], atol=1e-9)


@pytest.mark.parametrize("name", KINDS)
def test_summary_is_plain_data(name):
    import json

    signal = build_signal(name, sample_time=0.01, duration=10.0, amplitude=1.5, offset=0.2)
    summary = json.loads(json.dumps(signal.summary(), allow_nan=False))
    assert summary["samples"] == 1000
    assert summary["crest_factor"] == pytest.approx(signal.crest_factor)


@pytest.mark.parametrize(
    ("name", "parameters", "words"),
    [
        ("prsb", {}, "did you mean 'prbs'"),
        ("sine", {"frequncy": 1.0}, "did you mean 'frequency'"),
        ("sine", {"duration": None}, "duration is missing"),
        ("sine", {"sample_time": 0.0}, "sample_time is 0 but must be > 0"),
        ("sine", {"sample_time": float("nan")}, "sample_time is nan"),
        ("sine", {"duration": 0.001}, "shorter than sample_time"),
        ("sine", {"duration": 1e9}, "samples"),
        ("sine", {"amplitude": -1.0}, "amplitude is -1 but must be >= 0"),
        ("sine", {"frequency": 51.0}, "above half the sample rate (50 Hz)"),
        ("sine", {"seed": 1.5}, "seed must be a whole number"),
        ("chirp", {"sweep": "lin"}, "sweep is 'lin'"),
        ("prbs", {"clock_divider": 2, "band_hz": 10.0}, "give only one"),
        ("prbs", {"order": 32}, "order is 32"),
        ("rgs", {"frequency_min": 20.0, "frequency_max": 10.0}, "not below frequency_max"),
        ("rgs", {"frequency_min": 10.01, "frequency_max": 10.02}, "no frequency line"),
        ("multisine", {"frequency_min": 1.01, "frequency_max": 1.02}, "no full harmonic"),
        ("multilevel", {"levels": 1}, "never moves"),
        ("multilevel", {"hold_min": 1.0, "hold_max": 0.5}, "is below hold_min"),
        ("stepped_sine", {"frequencies": [0.1, 0.2]}, "lengthen it or ask for fewer"),
        ("stepped_sine", {"frequencies": []}, "frequencies is empty"),
        ("stepped_sine", {"frequencies": [60.0]}, "above half the sample rate"),
        ("coast_down", {"fractions": [2.0]}, "fractions is 2"),
        ("coast_down", {"fractions": []}, "fractions is empty"),
        ("smooth", {"velocity_limit": 0.0}, "velocity_limit is 0 but must be > 0"),
        ("smooth", {"duration": None}, "random points need a duration"),
        ("smooth", {"points": []}, "points is empty"),
    ],
)
def test_bad_input_is_refused_in_one_line(name, parameters, words):
    with pytest.raises(InputError) as error:
        build_signal(name, **{"sample_time": 0.01, "duration": 10.0, **parameters})
    assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_check_fills_in_defaults_without_building():
    values = check_signal("sine", {"sample_time": 0.01, "frequency": 3})
    assert values["frequency"] == 3.0
    assert values["duration"] is None
