import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idloop.errors import InputError
from idloop.estimation.polynomial import Orders, Polynomials
from idloop.estimation.polynomial.polynomials import radius, reflect, stack

numbers = st.integers(0, 3)
orders = st.builds(
    Orders, na=numbers, nb=st.tuples(st.integers(1, 3), numbers), nc=numbers, nd=numbers,
    nf=st.tuples(numbers, numbers), nk=st.tuples(numbers, numbers),
)  # fmt: skip


def some(o, seed):
    vector = 0.3 * np.random.default_rng(seed).normal(size=o.size)
    return Polynomials.from_vector(o, vector, sample_time=0.1, input_names=("u", "v"), output_name="y")


@given(o=orders, seed=st.integers(0, 100))
def test_state_space_and_transfer_functions_are_the_same_system(o, seed):
    p = some(o, seed)
    form, z = p.realization, np.exp(0.7j)
    states = np.linalg.solve(z * np.eye(len(form.a)) - form.a, np.hstack([form.b, form.gain]))
    values = form.c @ states + np.hstack([form.d, np.ones((1, 1))])
    q = 1.0 / z
    for i in range(2):
        expected = np.polyval(p.numerator(i)[::-1], q) / np.polyval(p.a[::-1], q) / np.polyval(p.f[i][::-1], q)
        assert values[0, i] == pytest.approx(expected, rel=1e-8)
    noise = np.polyval(p.c[::-1], q) / np.polyval(p.a[::-1], q) / np.polyval(p.d[::-1], q)
    assert values[0, 2] == pytest.approx(noise, rel=1e-8)
    np.testing.assert_allclose(np.atleast_2d(p.system(z)), values[:, :2], rtol=1e-7, atol=1e-12)
    np.testing.assert_allclose(complex(p.noise_system(z)), noise, rtol=1e-7)


@given(o=orders, seed=st.integers(0, 100))
def test_vector_names_and_parts_belong_together(o, seed):
    p = some(o, seed)
    assert len(p.names) == len(set(p.names)) == o.size == len(p.vector)
    again = Polynomials.from_vector(p.orders, p.vector, sample_time=0.1, input_names=p.input_names, output_name="y")
    np.testing.assert_array_equal(again.vector, p.vector)
    value = {c.name: c.value for c in p.coefficients}
    # The number in a name is the lag.
    assert value[f"b{p.delay[0]}[u]"] == p.b[0][0]
    if o.nc:
        assert value["c1"] == p.c[1]


def test_side_by_side_outputs_keep_their_noise_apart():
    part = some(Orders(1, (1, 0), 1, 0, (1, 0), (1, 0)), 1).realization
    both = stack([part, part])
    assert both.gain.shape == (2 * len(part.a), 2)
    assert not np.any(both.gain[: len(part.a), 1])


@given(st.lists(st.floats(-3.0, 3.0), min_size=1, max_size=5))
def test_mirrored_roots_keep_the_shape_of_the_magnitude(tail):
    polynomial = np.array([1.0, *tail])
    inside = reflect(polynomial)
    assert inside[0] == 1.0
    assert radius(inside) <= 1.0 + 1e-4
    q = np.exp(-1j * np.linspace(0.1, 3.0, 7))
    before, after = np.abs(np.polyval(polynomial[::-1], q)), np.abs(np.polyval(inside[::-1], q))
    ratio = after[before > 1e-3] / before[before > 1e-3]
    np.testing.assert_allclose(ratio, ratio.mean() if len(ratio) else 1.0, rtol=1e-2)


def test_first_coefficients_must_be_one():
    with pytest.raises(InputError, match="polynomial A"):
        Polynomials(np.array([2.0]), (), np.ones(1), np.ones(1), (), (), 0.1, ())
    with pytest.raises(InputError, match="nothing to estimate"):
        Orders(0, (0,), 0, 0, (0,), (1,))
    with pytest.raises(InputError, match="na = -1"):
        Orders(-1, (1,), 0, 0, (0,), (1,))
