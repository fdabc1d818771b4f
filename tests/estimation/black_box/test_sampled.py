import numpy as np
import pytest

from idloop.errors import InputError
from idloop.estimation.black_box.sampled import sampled, together
from idloop.records import Record


def record(time, output, input_time=None, command=None, **more):
    input_time = time if input_time is None else input_time
    command = np.sin(input_time) if command is None else command
    output = np.asarray(output, dtype=float).reshape(len(time), -1)
    names = tuple(f"y{i}" for i in range(output.shape[1]))
    return Record("bag", input_time, command, time, output, "u", "V", names, ("rad",) * len(names), **more)


def test_samples_on_a_grid_are_taken_as_they_are():
    time = 0.01 * np.arange(100)
    (data,) = sampled(record(time, np.cos(time)))
    np.testing.assert_array_equal(data.output[:, 0], np.cos(time))
    np.testing.assert_allclose(data.input[:, 0], np.sin(time))
    assert data.sample_time == pytest.approx(0.01)
    np.testing.assert_allclose(data.time, time)


def test_a_command_between_two_samples_counts_by_its_mean():
    time = 0.1 * np.arange(50)
    command_time = 0.05 * np.arange(100)
    (data,) = sampled(record(time, np.cos(time), command_time, np.tile([0.0, 1.0], 50)))
    np.testing.assert_allclose(data.input[:-1, 0], 0.5)


def test_holes_split_the_record():
    time = 0.01 * np.arange(300)
    y = np.cos(time)
    y[100:150] = np.nan
    first, second = sampled(record(time, y))
    assert (len(first), len(second)) == (100, 150)
    assert second.start == pytest.approx(1.5)


def test_what_the_controller_follows_holds_the_excitation():
    time = 0.01 * np.arange(100)
    both = np.column_stack([np.ones(100), np.full(100, np.nan)])
    (data,) = sampled(
        record(time, np.cos(time), reference_time=time, reference=both, excitation_time=time, excitation=0.5 * both)
    )
    np.testing.assert_allclose(data.reference, 1.5)
    assert sampled(record(time, np.cos(time)))[0].reference is None
    # A loop of speed is given a speed alone.
    speed = np.column_stack([np.full(100, np.nan), np.full(100, 0.7)])
    (data,) = sampled(record(time, np.cos(time), reference_time=time, reference=speed))
    np.testing.assert_allclose(data.reference, 0.7)


def test_an_integrator_stays_one_on_a_coarser_grid():
    rng = np.random.default_rng(3)
    time = 0.001 * np.arange(5001)
    command = rng.normal(size=5001)
    position = 0.001 * np.concatenate([[0.0], np.cumsum(command[:-1])])
    (data,) = sampled(record(time, position, time, command), 0.01)
    assert data.sample_time == 0.01
    steps = np.diff(data.output[:, 0])
    # Away from the ends, where a filter without phase lacks one side.
    np.testing.assert_allclose(steps[30:-30], 0.01 * data.input[30:-31, 0], atol=2e-3 * np.abs(steps).max())


@pytest.mark.parametrize("samples", [3, 15])
def test_too_short(samples):
    time = 0.01 * np.arange(samples)
    with pytest.raises(InputError, match="no stretch of 20 samples"):
        sampled(record(time, np.cos(time)))


def test_experiments_of_other_rates_do_not_go_together():
    (a,) = sampled(record(0.01 * np.arange(100), np.ones(100)))
    (b,) = sampled(record(0.02 * np.arange(100), np.ones(100)))
    with pytest.raises(InputError, match="sample time"):
        together([a, b])
    with pytest.raises(InputError, match="no data"):
        together([])
