import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import signal

from idloop.errors import InputError
from idloop.estimation.black_box.sampled import SampledData
from idloop.estimation.nonparametric import etfe, spa, welch

METHODS = {
    "welch": lambda data: welch(data, 512),
    "spa": lambda data: spa(data, 150),
    "etfe": lambda data: etfe(data, 0.5),
}


def test_welch_is_scipys(plant):
    data = plant.open_loop(0)
    u, y = data.input[:, 0], data.output[:, 0]
    ours = welch(data, 512)
    frequency, cross = signal.csd(u, y, 1 / plant.sample_time, nperseg=512)
    _, power = signal.welch(u, 1 / plant.sample_time, nperseg=512)
    _, coherence = signal.coherence(u, y, 1 / plant.sample_time, nperseg=512)
    np.testing.assert_allclose(ours.frequency, frequency[1:-1])
    np.testing.assert_allclose(ours.response[:, 0, 0], (cross / power)[1:-1], rtol=1e-9)
    np.testing.assert_allclose(ours.coherence[:, 0], coherence[1:-1], rtol=1e-9)


def test_a_figure_begins_at_the_resolution_and_names_the_bands_that_there_are(plant):
    data = plant.open_loop(0)
    smooth, raw = spa(data, 150), etfe(data)
    for estimate, bands in ((smooth, True), (raw, False)):
        axes = estimate.plot()
        assert ("bands of 95 %" in axes[0].get_title(loc="left")) is bands
        (curve, *_) = axes[0].get_lines()
        np.testing.assert_array_equal(curve.get_xdata(), estimate.frequency[estimate.resolved])
    assert not smooth.resolved[0]
    assert np.all(raw.resolved)
    low = spa(data, 150, frequency=smooth.resolution * np.array([0.1, 0.2]))
    assert np.all(low.resolved)


@pytest.mark.parametrize("overlap", [0.0, 0.75])
def test_welch_is_scipys_at_any_overlap_and_over_experiments(plant, overlap):
    data = [plant.open_loop(0, 2000), plant.open_loop(1, 3000)]
    ours = welch(data, 200, overlap=overlap)
    pairs, counts = [], []
    for one in data:
        options = {"fs": 1 / plant.sample_time, "nperseg": 200, "noverlap": round(200 * overlap)}
        u, y = one.input[:, 0], one.output[:, 0]
        pairs.append([signal.csd(u, y, **options)[1], signal.welch(u, **options)[1]])
        counts.append((len(one) - 200) // (200 - round(200 * overlap)) + 1)
    cross, power = np.average(pairs, axis=0, weights=counts)
    np.testing.assert_allclose(ours.response[:, 0, 0], (cross / power)[1:-1], rtol=1e-9)


@pytest.mark.parametrize("method", METHODS)
def test_bands_hold_the_true_response_as_often_as_they_say(plant, method):
    inside, square, inside_half = [], [], []
    for seed in range(40):
        estimate = METHODS[method](plant.open_loop(seed))
        error = np.abs(estimate.response[:, 0, 0] - plant.response(estimate.frequency))
        inside.append(error <= estimate.radius()[:, 0, 0])
        inside_half.append(error <= estimate.radius(0.5)[:, 0, 0])
        square.append((error / estimate.stderr[:, 0, 0]) ** 2)
    assert 0.92 < np.mean(inside) < 0.97
    assert 0.44 < np.mean(inside_half) < 0.56
    # F-distributed with 2 and many degrees of freedom: a mean a little above one.
    assert 0.9 < np.mean(square) < 1.2


@pytest.mark.parametrize("method", METHODS)
def test_error_falls_with_the_root_of_the_length(plant, method):
    def mean_error(samples):
        found = []
        for seed in range(6):
            estimate = METHODS[method](plant.open_loop(seed, samples, noise=0.5))
            found.append(np.abs(estimate.response[:, 0, 0] - plant.response(estimate.frequency)) ** 2)
        return np.sqrt(np.mean(found))

    assert mean_error(4096) / mean_error(65536) == pytest.approx(4.0, rel=0.25)


@pytest.mark.parametrize("method", METHODS)
def test_spectrum_of_the_disturbance(plant, method):
    ratio = []
    for seed in range(20):
        estimate = METHODS[method](plant.open_loop(seed, kind="white", noise=1.0))
        true = plant.disturbance_density(estimate.frequency, 1.0)
        ratio.append((estimate.disturbance[:, 0] - true) / true)
        spread = np.median(estimate.disturbance_stderr / estimate.disturbance)
    middle = estimate.frequency > 5
    assert abs(np.mean(np.array(ratio)[:, middle])) < 0.03
    assert np.std(np.array(ratio)[:, middle]) == pytest.approx(spread, rel=0.15)


def test_the_first_method_has_every_line_of_a_periodic_record_exactly(plant):
    u = np.tile(plant.multisine(3, periods=1).value, 3)
    y = signal.lfilter(plant.numerator, plant.denominator, u)
    estimate = etfe(plant.pack(u[1024:], y[1024:]))
    np.testing.assert_allclose(estimate.response[:, 0, 0], plant.response(estimate.frequency), rtol=1e-9)
    # Lines without input are no lines of the response.
    assert estimate.frequency.max() < 20.1
    assert "carry no input" in estimate.notes[0]
    assert np.all(np.isnan(estimate.stderr))
    assert estimate.coherence is None


def test_several_experiments_are_averaged(plant):
    data = [plant.open_loop(seed, 1024) for seed in range(30)]
    estimate = etfe(data)
    error = np.abs(estimate.response[:, 0, 0] - plant.response(estimate.frequency))
    assert np.mean(error <= estimate.radius()[:, 0, 0]) == pytest.approx(0.95, abs=0.03)
    alone = np.abs(etfe(data[0]).response[:, 0, 0] - plant.response(estimate.frequency))
    assert np.median(error) < 0.4 * np.median(alone)


@pytest.mark.parametrize("method", METHODS)
def test_two_inputs_are_told_apart(plant, method):
    rng = np.random.default_rng(5)
    u = rng.normal(size=(8192, 2)) @ np.array([[1.0, 6e-5], [0.0, 1e-4]])
    gain = np.array([3.0, -2e3])
    y = np.column_stack([np.roll(u, 1, axis=0) @ gain, u @ gain[::-1]]) + 0.05 * rng.normal(size=(8192, 2))
    data = SampledData("two", u, y, plant.sample_time, ("a", "b"), ("V", "V"), ("y", "z"), ("rad", "rad"))
    estimate = METHODS[method](data)
    turn = np.exp(-2j * np.pi * estimate.frequency * plant.sample_time)
    true = np.stack([turn[:, None] * gain, np.broadcast_to(gain[::-1], (turn.size, 2))], axis=1)
    inside = np.abs(estimate.response - true) <= estimate.radius()
    # A window that is one sample late leaks a little, hence the lower limit.
    assert np.all(np.mean(inside, axis=0) > 0.85)
    assert estimate.coherence.shape == estimate.disturbance.shape == (turn.size, 2)


def test_inputs_that_move_together_are_refused(plant):
    u = np.random.default_rng(1).normal(size=(1000, 1))
    data = SampledData("two", np.hstack([u, 2 * u]), u, 0.01, ("a", "b"), ("V", "V"))
    for method in (lambda d: welch(d, 64), lambda d: spa(d, 20), lambda d: etfe(d, 2.0)):
        with pytest.raises(InputError, match="move together"):
            method(data)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda d: welch(d, 5000), "segments of 5000"),
        (lambda d: welch(d, 64, overlap=1.0), "overlap"),
        (lambda d: spa(d, 1000), "lag window"),
        (lambda d: spa(d, 20, [70.0]), "half the sample rate"),
        (lambda d: etfe(d, 1e-4), "smoothing"),
        (lambda d: etfe(d, trend="cubic"), "trend"),
        (lambda d: welch(d, 64).radius(95), "share"),
        (lambda d: welch([]), "no data"),
    ],
)
def test_bad_input_is_one_line(plant, call, message):
    with pytest.raises(InputError, match=message) as caught:
        call(plant.open_loop(0, 1000))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("method", METHODS)
def test_an_input_that_stands_still(plant, method):
    data = plant.open_loop(0)
    with pytest.raises(InputError, match="u does not move"):
        METHODS[method](plant.pack(np.full(len(data), 3.0), data.output))


@given(scale=st.sampled_from([1e-12, 1e-6, 1.0, 1e9]), offset=st.sampled_from([0.0, 1e3]), seed=st.integers(0, 5))
def test_units_and_offsets_change_nothing(plant, scale, offset, seed):
    data = plant.open_loop(seed, 2048)
    moved = plant.pack(data.input, scale * (data.output + offset))
    for method in (lambda d: welch(d, 256), lambda d: spa(d, 50), lambda d: etfe(d, 2.0)):
        one, other = method(data), method(moved)
        np.testing.assert_allclose(other.response, scale * one.response, rtol=1e-6, atol=1e-9 * scale)
        np.testing.assert_allclose(other.stderr, scale * one.stderr, rtol=1e-6)


def test_a_straight_line_is_taken_off(plant):
    data = plant.open_loop(0, 4096)
    moved = plant.pack(data.input, data.output + 0.05 * np.arange(len(data))[:, None])
    one, other = (spa(d, 50, trend="linear") for d in (data, moved))
    np.testing.assert_allclose(other.response, one.response, atol=1e-6)


def test_spa_by_its_definition(plant):
    data = plant.open_loop(0, 300)
    u, y = (signal.detrend(v[:, 0], type="constant") for v in (data.input, data.output))
    lag = np.arange(-10, 11)
    across, own = (np.correlate(v, u, "full")[299 - 10 : 299 + 11] for v in (y, u))
    window = 0.5 * (1 + np.cos(np.pi * lag / 10))
    turn = np.exp(-2j * np.pi * 7.0 * plant.sample_time * lag) * window
    estimate = spa(data, 10, [7.0])
    assert estimate.response[0, 0, 0] == pytest.approx((turn @ across) / (turn @ own), rel=1e-9)


def test_an_integrating_plant_leaks_and_says_so(plant):
    u = np.random.default_rng(0).normal(size=20_000)
    data = plant.pack(u, 1e-4 * np.cumsum(np.cumsum(u)))
    estimates = [welch(data, 4096), spa(data, 400), etfe(data, 0.2)]
    for estimate in estimates:
        true = 1e-4 / (1 - np.exp(-2j * np.pi * estimate.frequency * plant.sample_time)) ** 2
        error = np.abs(estimate.response[:, 0, 0] - true)
        # What leaks in from the slow motion is no noise, but the bands know it.
        assert np.mean(error <= estimate.radius(0.99)[:, 0, 0]) > 0.75
    # The window of the segments takes the leakage away.
    middle = np.searchsorted(estimates[0].frequency, 10.0)
    true = 1e-4 / np.abs(1 - np.exp(-2j * np.pi * estimates[0].frequency[middle] * plant.sample_time)) ** 2
    assert np.abs(estimates[0].response[middle, 0, 0]) == pytest.approx(true, rel=0.05)


def test_half_a_million_samples(plant):
    data = plant.open_loop(0, 500_000, noise=0.01)
    for estimate in (welch(data, 1024), spa(data, 150), etfe(data, 0.5)):
        error = np.abs(estimate.response[:, 0, 0] - plant.response(estimate.frequency))
        assert np.max(error / np.abs(plant.response(estimate.frequency))) < 0.1


def test_segments_left_to_the_method_let_a_longer_record_tell_more(plant):
    errors = []
    for samples in (50_000, 800_000):
        estimate = welch(plant.open_loop(0, samples, noise=0.1))
        error = np.abs(estimate.response[:, 0, 0] / plant.response(estimate.frequency) - 1.0)
        errors.append(np.median(error))
    assert errors[1] < 0.7 * errors[0]  # 16 times the record: averages and resolution both about double
    assert len(welch(plant.open_loop(0, 50_000)).frequency) == pytest.approx(50_000 / 16, rel=0.01)


def test_the_result_shows_itself(plant):
    estimate = welch(plant.open_loop(0), 256)
    axes = estimate.plot()
    assert [a.get_ylabel() for a in axes] == ["magnitude [rad/V]", "phase [deg]", "coherence [-]"]
    assert axes[-1].get_xlabel() == "frequency [Hz]"
    values = estimate.to_dict()
    assert values["method"] == "welch"
    assert values["response"]["imag"].shape == (127, 1, 1)
    system = estimate.system
    np.testing.assert_allclose(system.frdata[0, 0], estimate.response[:, 0, 0])
    np.testing.assert_allclose(system.omega, 2 * np.pi * estimate.frequency)
    assert system.dt == plant.sample_time
    assert len(etfe(plant.open_loop(0)).plot()) == 2


def resonant(integrates=False, samples=6000, seed=0):
    """Velocity or position of an axis with a resonance at 12 Hz, every 5 ms, and its true response."""
    step, pole = 0.005, np.exp(0.005 * 2 * np.pi * 12.0 * (-0.05 + 1j))
    a = np.real(np.poly([pole, pole.conj(), *([1.0] if integrates else [])]))
    random = np.random.default_rng(seed)
    u = random.choice([-1.0, 1.0], samples)
    y = signal.lfilter([0.0, 1.0], a, u) + 0.1 * random.normal(size=samples)
    data = SampledData("axis", u[:, None], y[:, None], step)
    return data, lambda hz: signal.freqz([0.0, 1.0], a, worN=2 * np.pi * np.asarray(hz) * step)[1]


def test_the_usual_lag_window_shows_a_resonance_and_a_short_one_says_that_it_does_not():
    data, true = resonant()
    usual, short = spa(data), spa(data, 30)
    heights = [np.max(np.abs(one.response[:, 0, 0])) / np.max(np.abs(true(one.frequency))) for one in (usual, short)]
    assert heights[0] > 0.9
    assert heights[1] < 0.7
    assert not usual.notes
    assert len(short.notes) == 1
    assert "smoothed too much near 1" in short.notes[0]
    assert "window of 60 samples" in short.notes[0]


def test_the_usual_window_and_its_lines_grow_with_the_record():
    short, long = (spa(resonant(samples=n)[0]) for n in (3000, 12000))
    assert long.resolution == pytest.approx(short.resolution / 4, rel=0.02)
    for one in (short, long):
        assert np.max(np.diff(one.frequency)) <= 0.51 * one.resolution


def test_lines_by_one_transform_are_those_asked_for_by_frequency():
    data = resonant()[0]
    for window in (50, 400):
        all_lines = spa(data, window)
        some = spa(data, window, all_lines.frequency[10:90])
        np.testing.assert_allclose(some.response, all_lines.response[10:90], rtol=1e-8)


def test_an_axis_that_turns_on_does_not_hide_its_response_behind_low_frequencies():
    data, true = resonant(integrates=True)
    found = spa(data)
    seen = (found.frequency > 1.0) & (found.frequency < 30.0)
    error = np.abs(found.response[:, 0, 0] / true(found.frequency) - 1.0)[seen]
    assert np.median(error) < 0.1
    inside = np.abs(found.response[:, 0, 0] - true(found.frequency)) <= found.radius()[:, 0, 0]
    assert np.mean(inside) > 0.85


def test_the_resolution_is_the_width_of_the_window_at_half_its_height():
    data, segment, step = resonant()[0], 512, 0.005
    fine = np.abs(np.fft.rfft(signal.get_window("hann", segment), 64 * segment)) ** 2
    width = 2 * np.argmax(fine < 0.5 * fine[0]) / (64 * segment * step)
    assert welch(data, segment).resolution == pytest.approx(width, rel=0.03)
    lag = np.abs(np.fft.fft(signal.get_window("hann", 600), 64 * 600))
    width = 2 * np.argmax(lag < 0.5 * lag[0]) / (64 * 600 * step)
    assert spa(data, 300).resolution == pytest.approx(width, rel=0.03)
    assert etfe(data, 2.0).resolution == pytest.approx(2.0, rel=0.05)
    assert etfe(data).resolution is None
