import numpy as np
import pytest
from scipy.signal import lfilter

from idloop.errors import InputError
from idloop.validation.residual import autocorrelation, input_residual_test, ljung_box, residual_tests


def test_autocorrelation_of_an_alternating_series() -> None:
    r = autocorrelation(np.array([1.0, -1.0] * 50), 2)
    assert r == pytest.approx([1.0, -0.99, 0.98])


def test_whiteness_holds_its_level_on_white_noise() -> None:
    rng = np.random.default_rng(0)
    p = np.array([ljung_box(rng.normal(size=500), 20)[1] for _ in range(400)])
    # 5 % of 400 with three binomial standard deviations.
    assert abs(np.sum(p < 0.05) - 20) <= 13


def test_input_test_holds_its_level_when_both_are_coloured() -> None:
    rng = np.random.default_rng(1)
    p = []
    for _ in range(300):
        u, e = lfilter([1.0], [1.0, -0.9], rng.normal(size=(2, 2000)), axis=1)
        p.append(input_residual_test(u, e, 20)[2])
    assert np.sum(np.array(p) < 0.05) <= 15 + 14


def test_input_left_in_the_residual_is_found_at_its_lag() -> None:
    rng = np.random.default_rng(2)
    u = rng.normal(size=2000)
    e = rng.normal(size=2000)
    e[3:] += 0.3 * u[:-3]
    correlation, band, p, _ = input_residual_test(u, e, 10)
    assert p < 1e-6
    assert int(np.argmax(np.abs(correlation))) - 10 == 3
    assert np.max(np.abs(correlation)) > band[0]


def test_one_test_per_output_and_missing_samples_left_out() -> None:
    rng = np.random.default_rng(3)
    e = rng.normal(size=(1000, 2))
    e[::2, 1] = np.nan
    tests = residual_tests(e, rng.normal(size=1000), ("a", "b"))
    assert [t.name for t in tests] == ["a", "b"]
    assert tests[1].autocorrelation_band[0] > tests[0].autocorrelation_band[0]
    assert set(tests[0].to_dict()) >= {"white", "input_free"}


def test_too_few_samples() -> None:
    with pytest.raises(InputError, match="too few"):
        residual_tests(np.zeros((50, 1)), np.zeros(50))


def test_feedback_of_the_residual_into_the_command_is_no_finding() -> None:
    rng = np.random.default_rng(5)
    p = []
    for _ in range(200):
        e = rng.normal(size=1000)
        u = 0.3 * rng.normal(size=1000) - 0.8 * e  # the command of a stamp follows its measurement
        p.append(input_residual_test(u, e, 20)[2])
    # 5 % of 200 with three binomial standard deviations
    assert abs(np.sum(np.array(p) < 0.05) - 10) <= 10


def closed_loop(seed: int, *, missing: float = 0.0, n: int = 2000) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Coloured residual, command that carries it back, and the reference; part of the command may be left in it."""
    rng = np.random.default_rng(seed)
    reference = lfilter([1.0], [1.0, -0.8], rng.normal(size=n))
    noise = lfilter([1.0], [1.0, -0.9], rng.normal(size=n))
    command, residual = np.zeros(n), np.zeros(n)
    for i in range(1, n):
        residual[i] = noise[i] + missing * command[i - 1]
        command[i] = reference[i] - 0.5 * residual[i]
    return residual, command, reference


def test_coloured_residuals_in_a_closed_loop_are_tested_against_the_reference() -> None:
    loops = [closed_loop(seed) for seed in range(200)]
    p = [residual_tests(e, u, outside=[r], fed_back=True)[0].cross_p for e, u, r in loops]
    assert np.sum(np.array(p) < 0.05) <= 10 + 12
    # The command carries the residual: by it alone every one of them would be called wrong.
    assert all(residual_tests(e, u)[0].cross_p < 1e-6 for e, u, _ in loops)
    e, u, r = closed_loop(0, missing=0.3)
    found = residual_tests(e, u, outside=[r, np.arange(len(u)) % 7.0], fed_back=True)[0]
    assert found.against == "reference"
    assert not found.input_free
    assert found.freedom == "is correlated with the reference"


def test_where_feedback_hides_it_nothing_is_said() -> None:
    e, u, _ = closed_loop(0)
    found = residual_tests(e, u, fed_back=True)[0]
    assert found.input_free
    assert not found.decided
    assert found.to_dict()["input_correlation_p"] is None
    assert "record the reference" in found.freedom
    white = np.random.default_rng(1).normal(size=1000)
    assert residual_tests(white, np.roll(white, -1), fed_back=True)[0].decided


@pytest.mark.parametrize(("part", "worth"), ((0.05, False), (0.5, True)))
def test_a_part_that_makes_no_difference_is_significant_and_not_worth_an_effect(part, worth):
    rng = np.random.default_rng(3)
    u, e = rng.normal(size=20000), rng.normal(size=20000)
    (found,) = residual_tests(e + part * np.roll(u, 1), u)
    assert not found.input_free
    assert found.follows is worth
    # Of a unit variance and that of the part.
    assert found.cross_share == pytest.approx(part**2 / (1.0 + part**2), abs=0.003)
    (found,) = residual_tests(e + part * np.roll(e, 1), u)
    assert not found.white
    assert found.coloured is worth
