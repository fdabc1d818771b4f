from dataclasses import replace

import numpy as np
import pytest

from idloop.estimation.dataset import Data, prepare
from idloop.physics import Model, load_model
from idloop.records import Record
from idloop.validation.operating_state import (
    direction_of,
    error_share,
    motion_regions,
    operating_state,
    since_reversal,
)

STEP = 1e-3
TIME = np.arange(0.0, 10.0, STEP)


def data_of(model: Model, output: np.ndarray) -> Data:
    units = tuple(o.unit for o in model.outputs)
    command = np.round(np.sin(TIME), 2)
    record = Record("r", TIME, command, TIME, output, model.input.name, "V", model.output_names, units)
    return prepare(model, [record])[0]


def swinging(position_noise: float = 0.0, velocity_noise: float = 0.0) -> np.ndarray:
    """Position and velocity of a motion that turns every 2.5 s."""
    random = np.random.default_rng(0)
    w = 2.0 * np.pi / 5.0
    motion = np.column_stack([-np.cos(w * TIME) / w, np.sin(w * TIME)])
    return motion + random.normal(size=motion.shape) * [position_noise, velocity_noise]


@pytest.mark.parametrize("hidden", (None, 0, 1))
@pytest.mark.parametrize("noise", (0.0, 1e-3))
def test_direction_and_reversals_are_read_off_either_sensor(hidden: int | None, noise: float) -> None:
    output = swinging(noise, 30.0 * noise)
    if hidden is not None:
        output[:, hidden] = np.nan
    model = load_model("dc_motor")
    state = operating_state(model, data_of(model, output), "motor")
    assert state.velocity is not None
    assert state.direction is not None
    assert state.since is not None
    inner = (TIME > 0.5) & (TIME < 9.5)
    np.testing.assert_allclose(state.velocity[inner], np.sin(0.4 * np.pi * TIME)[inner], atol=0.1)
    clear = np.abs(np.sin(0.4 * np.pi * TIME)) > 0.2
    np.testing.assert_array_equal(state.direction[clear], np.sign(np.sin(0.4 * np.pi * TIME))[clear])
    # Turns at 2.5, 5 and 7.5 s: half a second later so much has gone by.
    for turn in (2.5, 5.0, 7.5):
        at = int((turn + 0.5) / STEP)
        assert state.since[at] == pytest.approx(0.5, abs=0.1)
    assert (state.position is None) == (hidden == 0)


def test_noise_at_rest_is_no_motion() -> None:
    output = swinging(1e-4)
    output[:, 1] = np.nan
    still = TIME > 5.0
    output[still, 0] = output[still, 0][0] + 1e-4 * np.random.default_rng(1).normal(size=int(np.sum(still)))
    model = load_model("dc_motor")
    state = operating_state(model, data_of(model, output), "motor")
    assert state.direction is not None
    assert np.mean(state.direction[TIME > 5.5] == 0.0) > 0.95


def test_a_body_without_a_sensor_borrows_the_nearest() -> None:
    model = load_model("torsion")
    output = np.full((len(TIME), len(model.outputs)), np.nan)
    column = model.output_names.index("load2.position")
    output[:, column] = swinging()[:, 0]
    data = data_of(model, output)
    assert operating_state(model, data, "motor").body == "load2"
    assert operating_state(model, data, "load3").body == "load2"


def test_gaps_are_bridged_and_uneven_stamps_resampled() -> None:
    model = load_model("dc_motor")
    output = swinging()
    output[2000:2100] = np.nan
    keep = np.ones(len(TIME), dtype=bool)
    keep[4000:4200] = False
    data = data_of(model, output)
    data = replace(data, time=data.time[keep], output=data.output[keep])
    state = operating_state(model, data, "motor")
    assert state.velocity is not None
    assert state.velocity.shape == data.time.shape
    inner = (data.time > 0.5) & (data.time < 9.5)
    np.testing.assert_allclose(state.velocity[inner], np.sin(0.4 * np.pi * data.time)[inner], atol=0.05)


def test_nothing_measured_says_nothing() -> None:
    model = load_model("dc_motor")
    output = np.full((len(TIME), 2), np.nan)
    output[:20] = 0.0
    state = operating_state(model, data_of(model, output), "motor")
    assert state.velocity is None
    assert state.position is None
    assert state.since is None


def test_other_instants_take_the_nearest_sample() -> None:
    model = load_model("dc_motor")
    state = operating_state(model, data_of(model, swinging()), "motor")
    times = np.array([0.0, 1.2344, 1.2346, 9.999, 20.0])
    picked = state.at(times)
    assert picked.position is not None
    assert state.position is not None
    np.testing.assert_array_equal(picked.position, state.position[[0, 1234, 1235, 9999, 9999]])
    np.testing.assert_array_equal(state.at(times, np.arange(5.0)).command, np.arange(5.0))


def test_standing_between_two_moves_of_one_direction_is_no_reversal() -> None:
    direction = direction_of(np.array([1.0, 1.0, 0.0, 1.0, -1.0, 0.0, -1.0]))
    np.testing.assert_array_equal(direction, [1.0, 1.0, 0.0, 1.0, -1.0, 0.0, -1.0])
    since, turns = since_reversal(np.arange(7.0), direction)
    np.testing.assert_array_equal(turns, [4])
    np.testing.assert_array_equal(since, [np.inf] * 4 + [0.0, 1.0, 2.0])


def test_every_sample_is_in_exactly_one_region() -> None:
    time = np.linspace(0.0, 10.0, 1001)
    regions = motion_regions(time, np.sign(np.sin(time)) * (np.abs(np.sin(time)) > 0.2))
    assert np.all(np.sum(list(regions.values()), axis=0) == 1)
    assert np.any(regions["standing"])
    assert np.any(regions["after a reversal"])


def test_error_is_found_where_it_was_put() -> None:
    time = np.linspace(0.0, 20.0, 2001)
    velocity = np.sin(time)
    regions = motion_regions(time, velocity)
    share = error_share(np.where(regions["backward"], 1.0, 0.0), regions)
    assert share["backward"]["error"] == 1.0
    assert sum(s["error"] for s in share.values()) == pytest.approx(1.0)
    assert sum(s["time"] for s in share.values()) == pytest.approx(1.0)
