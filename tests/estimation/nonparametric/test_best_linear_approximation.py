from dataclasses import replace

import numpy as np
import pytest

from idloop.errors import InputError
from idloop.estimation.nonparametric import (
    fast_best_linear_approximation,
    robust_best_linear_approximation,
)

PERIOD = 512


def test_a_linear_plant_has_noise_only(plant):
    inside, noise, total, square = [], [], [], []
    for trial in range(30):
        data = [plant.periodic(10 * trial + i)[0] for i in range(5)]
        estimate = robust_best_linear_approximation(data, PERIOD)
        error = np.abs(estimate.response[:, 0, 0] - plant.response(estimate.frequency))
        inside.append(error <= estimate.radius()[:, 0, 0])
        noise.append(np.mean(estimate.distortion.noise**2))
        total.append(np.mean(estimate.stderr**2))
        square.append(np.mean(error**2))
    assert 0.93 < np.mean(inside) < 0.97
    assert np.mean(noise) / np.mean(total) == pytest.approx(1.0, abs=0.05)
    assert np.mean(square) / np.mean(total) == pytest.approx(1.0, abs=0.1)


def told(estimate):
    (shares,) = estimate.distortion.shares(estimate.response[:, :, 0])
    return shares


@pytest.mark.slow
@pytest.mark.parametrize(("realisations", "periods"), [(7, 5), (2, 2)])
def test_of_a_linear_plant_the_robust_method_sees_no_nonlinearity_but_by_chance(plant, realisations, periods):
    shares = []
    for trial in range(300):
        data = [plant.periodic(100 * trial + i, periods=periods + 1)[0] for i in range(realisations)]
        shares.append(told(robust_best_linear_approximation(data, PERIOD)))
    # Of 300 at 5 %, 6 to 26 by chance (three standard deviations and more).
    assert 6 <= np.sum([one["p_stochastic"] < 0.05 for one in shares]) <= 26
    # Noise and nonlinearity are both of one experiment, and about half of the averages are cut at 0.
    assert 0.4 < np.mean([one["stochastic"] == 0.0 for one in shares]) < 0.6
    assert np.max([one["stochastic"] / one["noise"] for one in shares]) < 1.0


@pytest.mark.parametrize("periods", [5, 2])
def test_of_a_linear_plant_the_fast_method_sees_no_nonlinearity_but_by_chance(plant, periods):
    shares = []
    for trial in range(400):
        data, _ = plant.periodic(trial, "odd_random", periods=periods + 1)
        shares.append(told(fast_best_linear_approximation(data, PERIOD)))
    for kind in ("odd", "even"):
        assert 7 <= np.sum([one[f"p_{kind}"] < 0.05 for one in shares]) <= 34
        assert 0.4 < np.mean([one[kind] == 0.0 for one in shares]) < 0.6
    np.testing.assert_array_equal([one["p_stochastic"] for one in shares], [one["p_odd"] for one in shares])


@pytest.mark.parametrize(("kind", "size"), [("cubic", 0.15), ("square", 0.1)])
def test_a_nonlinearity_that_is_there_is_seen_every_time(plant, kind, size):
    shown = "odd" if kind == "cubic" else "even"
    for trial in range(50):
        data = [plant.periodic(100 * trial + i, **{kind: size})[0] for i in range(4)]
        assert told(robust_best_linear_approximation(data, PERIOD))["p_stochastic"] < 1e-3
        data, _ = plant.periodic(trial, "odd_random", noise=0.005, **{kind: size})
        estimate = fast_best_linear_approximation(data, PERIOD)
        assert told(estimate)[f"p_{shown}"] < 1e-3
        assert estimate.to_dict()["distortion"]["p_values"][shown][0] == told(estimate)[f"p_{shown}"]


def test_rounding_is_no_nonlinearity(plant):
    data = [plant.periodic(seed, noise=0.0)[0] for seed in range(3)]
    assert told(robust_best_linear_approximation(data, PERIOD, skip=3))["p_stochastic"] > 0.05
    data, _ = plant.periodic(3, "odd_random", noise=0.0)
    assert (
        min(told(fast_best_linear_approximation(data, PERIOD, skip=3))[f"p_{kind}"] for kind in ("odd", "even")) > 0.05
    )


def test_a_cube_changes_the_gain_and_adds_distortion_that_is_no_noise(plant):
    data = [plant.periodic(seed, cubic=0.2, noise=0.001)[0] for seed in range(30)]
    estimate = robust_best_linear_approximation(data, PERIOD)
    # Of u + c u³ under a Gaussian input: 1 + 3 c var(u) (Bussgang).
    gain = 1 + 3 * 0.2 * np.mean([np.var(one.input) for one in data])
    true = plant.response(estimate.frequency)
    assert np.mean(estimate.response[:, 0, 0] / true) == pytest.approx(gain, abs=0.005)
    relative = estimate.distortion.stochastic[:, 0] / np.abs(true)
    assert np.sqrt(np.mean(relative**2)) == pytest.approx(0.038, rel=0.1)
    (shares,) = estimate.distortion.shares(estimate.response[:, :, 0])
    assert shares["stochastic"] > 10.0 * shares["noise"] > 0.0
    assert np.isnan(shares["even"])  # no line was left empty
    # At the highest lines, where the plant hardly answers, noise comes near.
    assert np.median(estimate.distortion.stochastic / estimate.distortion.noise) > 5


@pytest.mark.parametrize(
    ("kind", "odd", "even"), [("cubic", True, False), ("square", False, True), (None, False, False)]
)
def test_empty_lines_tell_odd_from_even(plant, kind, odd, even):
    data, sent = plant.periodic(3, "odd_random", noise=0.001, **({kind: 0.2} if kind else {}))
    estimate = fast_best_linear_approximation(data, PERIOD, lines=sent.lines)
    levels = estimate.distortion
    for lines, shows, harmonics in (
        (levels.odd, odd, sent.lines.odd_detection),
        (levels.even, even, sent.lines.even_detection),
    ):
        ratio = np.sqrt(np.mean(lines.level**2) / np.mean(lines.noise**2))
        assert (ratio > 5) if shows else (ratio < 2)
        inside = (harmonics > sent.lines.excited[0]) & (harmonics < sent.lines.excited[-1])
        np.testing.assert_allclose(lines.frequency, sent.lines.fundamental * harmonics[inside])
    assert np.median(levels.excited.level / levels.excited.noise) > 100


def test_fast_and_robust_agree(plant):
    data = [plant.periodic(seed, "odd_random", noise=0.001, cubic=0.2)[0] for seed in range(20)]
    robust = robust_best_linear_approximation(data, PERIOD)
    fast = fast_best_linear_approximation(data[0], PERIOD)
    size = [
        np.sqrt(np.mean((one.distortion.stochastic[:, 0] / np.abs(plant.response(one.frequency))) ** 2))
        for one in (robust, fast)
    ]
    assert size[0] == pytest.approx(size[1], rel=0.25)
    shared = np.isin(fast.frequency, robust.frequency)
    assert np.mean(shared) > 0.95


@pytest.mark.parametrize("cubic", [0.0, 0.2])
def test_bands_of_the_fast_method(plant, cubic):
    inside = []
    for seed in range(60):
        data, _ = plant.periodic(seed, "odd_random", cubic=cubic, noise=0.003)
        estimate = fast_best_linear_approximation(data, PERIOD)
        gain = 1 + 3 * cubic * np.var(data.input)
        error = np.abs(estimate.response[:, 0, 0] - gain * plant.response(estimate.frequency))
        inside.append(np.mean(error <= estimate.radius()[:, 0, 0]))
    # The larger of two estimates is taken for the error, so the bands are a little wide.
    assert 0.93 < np.mean(inside) < 0.99


def test_lines_are_read_off_the_excitation(plant):
    data, sent = plant.periodic(3, "odd_random")
    told, read = (fast_best_linear_approximation(data, PERIOD, lines=lines) for lines in (sent.lines, None))
    np.testing.assert_array_equal(told.response, read.response)
    np.testing.assert_array_equal(told.distortion.even.level, read.distortion.even.level)


def test_realisations_with_other_empty_lines_go_together(plant):
    data, sent = zip(*[plant.periodic(seed, "odd_random") for seed in range(4)], strict=True)
    estimate = robust_best_linear_approximation(data, PERIOD, lines=[one.lines for one in sent])
    count = sum(np.isin(np.rint(estimate.frequency * 5.12).astype(int), one.lines.excited) for one in sent)
    np.testing.assert_allclose(estimate.degrees, 2.0 * (count - 1))
    assert count.min() == 2
    error = np.abs(estimate.response[:, 0, 0] - plant.response(estimate.frequency))
    assert np.mean(error <= estimate.radius()[:, 0, 0]) > 0.85


def test_drift_from_period_to_period_is_taken_off(plant):
    still, moving = ([plant.periodic(seed, drift=drift)[0] for seed in range(3)] for drift in (0.0, 1e-2))
    one, other = (robust_best_linear_approximation(data, PERIOD) for data in (still, moving))
    np.testing.assert_allclose(other.response, one.response, atol=1e-9)
    kept = robust_best_linear_approximation(moving, PERIOD, drift=False)
    assert np.max(np.abs(kept.response - one.response)) > 0.1


def behind_feedback(plant, trial, amplitude):
    sent = [plant.multisine(10 * trial + i) for i in range(4)]
    return [plant.closed_loop(10 * trial + i, noise=0.3, reference=amplitude * one.value) for i, one in enumerate(sent)]


def test_behind_feedback_the_reference_is_needed(plant):
    inside, error, direct = [], [], []
    lines = plant.multisine(0).lines
    for trial in range(16):
        data = behind_feedback(plant, trial, 2.0)
        estimate = robust_best_linear_approximation(data, PERIOD, lines=lines, by_reference=True)
        true = plant.response(estimate.frequency)
        error.append(estimate.response[:, 0, 0] - true)
        inside.append(np.mean(np.abs(error[-1]) <= estimate.radius()[:, 0, 0]))
        direct.append(robust_best_linear_approximation(data, PERIOD, lines=lines).response[:, 0, 0] - true)
    assert 0.92 < np.mean(inside) < 0.97
    # Each experiment's ratio is biased by the noise in its command, and averaging does not help.
    bias, unbiased = (np.mean(np.mean(values, axis=0).real) for values in (direct, error))
    scatter = np.std(np.mean(error, axis=1).real) / np.sqrt(16)
    assert abs(unbiased) < 3 * scatter < abs(bias)


def test_an_input_that_noise_drowns_is_told(plant):
    lines = plant.multisine(0).lines
    faint = robust_best_linear_approximation(behind_feedback(plant, 0, 0.1), PERIOD, lines=lines, by_reference=True)
    assert "the input does not exceed its noise clearly" in faint.notes[0]
    assert robust_best_linear_approximation([plant.periodic(i)[0] for i in range(2)], PERIOD).notes == ()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda d, s: robust_best_linear_approximation([d], PERIOD), "one realisation"),
        (lambda d, s: robust_best_linear_approximation([d, d], 3000), "hold 0 periods"),
        (lambda d, s: robust_best_linear_approximation([d, d], 2), "period of 2"),
        (lambda d, s: robust_best_linear_approximation([d, d], PERIOD, by_reference=True), "no reference"),
        (lambda d, s: robust_best_linear_approximation([d, d], 500, lines=s.lines), "do not belong"),
        (lambda d, s: robust_best_linear_approximation([d, d], PERIOD, lines=[s.lines]), "1 line grids"),
        (lambda d, s: robust_best_linear_approximation([d, d], 500), r"after 500 samples .* after 512 .* 5.12 s"),
        (lambda d, s: fast_best_linear_approximation(d, 511), "not repeat after 511 .* after 512 samples"),
        (lambda d, s: fast_best_linear_approximation(d, 256), "not repeat after 256 .* after 512 samples"),
        (lambda d, s: fast_best_linear_approximation(d, PERIOD), "even harmonics"),
    ],
)
def test_bad_input_is_one_line(plant, call, message):
    data, sent = plant.periodic(0)
    with pytest.raises(InputError, match=message) as caught:
        call(data, sent)
    assert "\n" not in str(caught.value)


def test_an_odd_grid_without_empty_lines_is_refused(plant):
    with pytest.raises(InputError, match="no odd harmonic is left empty"):
        fast_best_linear_approximation(plant.periodic(0, "odd")[0], PERIOD)


def test_the_results_show_themselves(plant):
    data = plant.periodic(3, "odd_random", cubic=0.1)[0]
    estimate = fast_best_linear_approximation(data, PERIOD)
    axes = estimate.plot()
    assert axes[0].get_ylabel() == "magnitude [rad/V]"
    assert estimate.distortion.plot().get_ylabel() == "amplitude of y [rad]"
    values = estimate.to_dict()["distortion"]
    assert set(values["odd"]) == {"frequency", "level", "noise"}
    robust = robust_best_linear_approximation([data, plant.periodic(4, "odd_random")[0]], PERIOD)
    assert robust.distortion.to_dict()["odd"] is None
    assert robust.distortion.plot().get_xlabel() == "frequency [Hz]"


def test_a_multiple_of_the_period_of_an_odd_grid_is_told(plant):
    data, _ = plant.periodic(0, grid="odd_random", periods=8)
    with pytest.raises(InputError, match="repeats after 512 samples already, 2 times in a period of 1024"):
        fast_best_linear_approximation(data, 2 * PERIOD)


def test_noise_in_the_command_is_no_excitation(plant):
    clean, _ = plant.periodic(0, grid="odd_random", periods=8)
    noise = 0.05 * np.random.default_rng(0).normal(size=clean.input.shape)
    noisy = replace(clean, input=clean.input + noise)
    exact, found = (fast_best_linear_approximation(one, PERIOD) for one in (clean, noisy))
    np.testing.assert_array_equal(found.frequency, exact.frequency)
    with pytest.raises(InputError, match=r"even harmonics are excited, by [45][0-9] %"):
        fast_best_linear_approximation(plant.periodic(0, periods=8)[0], PERIOD)
