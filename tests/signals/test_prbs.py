"""Maximum-length sequences: primitivity, period, autocorrelation, band."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.signals import build_signal
from idloop.signals.prbs import TAPS, maximum_length_bits

# Prime factors of 2^n - 1.
FACTORS = {
    2: (3,), 3: (7,), 4: (3, 5), 5: (31,), 6: (3, 7), 7: (127,), 8: (3, 5, 17), 9: (7, 73), 10: (3, 11, 31),
    11: (23, 89), 12: (3, 5, 7, 13), 13: (8191,), 14: (3, 43, 127), 15: (7, 31, 151), 16: (3, 5, 17, 257),
    17: (131071,), 18: (3, 7, 19, 73), 19: (524287,), 20: (3, 5, 11, 31, 41), 21: (7, 127, 337),
    22: (3, 23, 89, 683), 23: (47, 178481), 24: (3, 5, 7, 13, 17, 241), 25: (31, 601, 1801),
    26: (3, 2731, 8191), 27: (7, 73, 262657), 28: (3, 5, 29, 43, 113, 127), 29: (233, 1103, 2089),
    30: (3, 7, 11, 31, 151, 331), 31: (2147483647,),
}  # fmt: skip


def power_of_x(exponent: int, polynomial: int, order: int) -> int:
    """x to a power, modulo a polynomial over GF(2), bits as coefficients."""

    def times(a: int, b: int) -> int:
        product = 0
        while b:
            if b & 1:
                product ^= a
            a, b = a << 1, b >> 1
            if a >> order & 1:
                a ^= polynomial
        return product

    result, square = 1, 2
    while exponent:
        if exponent & 1:
            result = times(result, square)
        square, exponent = times(square, square), exponent >> 1
    return result


@pytest.mark.parametrize("order", sorted(TAPS))
def test_feedback_polynomial_is_primitive(order):
    # The recurrence b[k] = sum of b[k - tap] has the characteristic polynomial x^n + sum of x^(n - tap).
    polynomial = (1 << order) | sum(1 << (order - tap) for tap in TAPS[order])
    length = 2**order - 1
    remaining = length
    for prime in FACTORS[order]:
        while remaining % prime == 0:
            remaining //= prime
        assert order == 2 or power_of_x(length // prime, polynomial, order) != 1
    assert remaining == 1
    assert power_of_x(length, polynomial, order) == 1


def test_all_orders_are_there():
    assert sorted(TAPS) == list(range(2, 32))


@pytest.mark.parametrize("order", [2, 3, 5, 8, 11, 14])
def test_bits_follow_the_register(order):
    start = 2 ** (order - 1) + 1
    bits = [(start >> i) & 1 for i in range(order)]
    while len(bits) < 3 * 2**order:
        bits.append(sum(bits[len(bits) - tap] for tap in TAPS[order]) % 2)
    assert maximum_length_bits(order, len(bits), start).tolist() == bits


@pytest.mark.parametrize("order", [2, 3, 4, 7, 10, 12])
def test_period_balance_and_autocorrelation(order):
    length = 2**order - 1
    signal = build_signal("prbs", sample_time=0.01, duration=0.02 * length, order=order, seed=7)
    assert signal.period_samples == length
    one = signal.value[:length]
    assert np.array_equal(signal.value[length:], one)
    assert np.sum(one) == pytest.approx(1.0)
    assert len({tuple(np.roll(one, -k)[:order]) for k in range(length)}) == length
    correlation = np.fft.irfft(np.abs(np.fft.rfft(one)) ** 2, length)
    assert correlation[0] == pytest.approx(length)
    assert np.allclose(correlation[1:], -1.0)


def test_clock_divider_holds_each_bit():
    fast = build_signal("prbs", sample_time=0.01, duration=None, order=6)
    slow = build_signal("prbs", sample_time=0.01, duration=None, order=6, clock_divider=5)
    assert fast.value.size == 63
    assert slow.period_samples == slow.value.size == 315
    assert np.array_equal(slow.value, np.repeat(fast.value, 5))


def test_band_of_the_torsion_thesis():
    # Section 4.1: band 0 to 10 Hz at 1 kHz; idinput([0 0.02]) holds 50 samples.
    signal = build_signal("prbs", sample_time=0.001, duration=80.0, amplitude=36.0, band_hz=10.0, seed=1)
    edges = np.flatnonzero(np.diff(signal.value)) + 1
    assert signal.derived["clock_divider"] == 50
    assert np.all(edges % 50 == 0)
    assert set(np.unique(signal.value)) == {-36.0, 36.0}
    frequency, amplitude = signal.spectrum()
    power = amplitude[1:] ** 2
    assert np.sum(power[frequency[1:] < 20.0]) > 0.89 * np.sum(power)


def test_inverse_repeat_has_odd_harmonics_only():
    signal = build_signal("prbs", sample_time=0.01, duration=None, order=7, inverse_repeat=True)
    assert signal.period_samples == 254
    assert np.array_equal(signal.value[127:], -signal.value[:127])
    _, amplitude = signal.spectrum()
    assert np.allclose(amplitude[0::2], 0.0, atol=1e-12)


def test_order_is_the_longest_that_fits_and_a_cut_period_is_reported():
    assert build_signal("prbs", sample_time=0.01, duration=10.0).derived["order"] == 9
    assert build_signal("prbs", sample_time=0.01, duration=10.0).notes == ()
    assert "one period" in build_signal("prbs", sample_time=0.01, duration=10.0, order=12).notes[0]
    assert build_signal("prbs", sample_time=0.01, duration=0.01).value.size == 1
