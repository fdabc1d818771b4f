"""A velocity computed from the position is recognised; a sensor of its own never is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, lfilter

from idloop.records import Record, inspect_bag
from idloop.records.inspection.checks import check_record
from idloop.records.inspection.differenced import KIND, difference, differenced

STEP = 0.01
TIME = np.arange(1500) * STEP


def motion(count: int, step: float, constant: float, hold: int, random: np.random.Generator) -> tuple[np.ndarray, ...]:
    """Exact position and velocity of a body with viscous friction under a held random command."""
    ratio, settled = step / constant, 1.0 - np.exp(-step / constant)
    command = np.repeat(random.normal(size=count // hold + 1), hold)[:count]
    before = np.concatenate([[0.0], command[:-1]])
    velocity = lfilter([settled], [1.0, settled - 1.0], before)
    travelled = constant * settled * velocity + constant * (ratio - settled) * command
    return np.concatenate([[0.0], np.cumsum(travelled[:-1])]), velocity


def tracking_loop(position: np.ndarray) -> np.ndarray:
    """What a drive's tracking loop says of the speed."""
    place = speed = 0.0
    found = []
    for one in position:
        place += STEP * speed
        error = one - place
        place, speed = place + 0.5 * error, speed + 0.2 * error / STEP
        found.append(speed)
    return np.array(found)


@pytest.fixture(scope="module")
def counts() -> np.ndarray:
    """Position by an encoder of 1320 lines."""
    line = 2 * np.pi / 1320
    return np.round(motion(TIME.size, STEP, 0.3, 40, np.random.default_rng(1))[0] * 20 / line) * line


def backward(position: np.ndarray) -> np.ndarray:
    return np.concatenate([[0.0], np.diff(position)]) / STEP


@pytest.mark.parametrize(
    ("computed", "delay"),
    [
        (backward, 0.5),
        (lambda p: np.concatenate([np.diff(p), [0.0]]) / STEP, -0.5),
        (lambda p: np.gradient(p, STEP), 0.0),
        (lambda p: np.concatenate([[0.0], backward(p)[:-1]]), 1.5),
        (lambda p: lfilter(np.ones(5) / 5, 1.0, backward(p)), 2.5),
        (lambda p: np.round(backward(p), 1), 0.5),
        (lambda p: backward(p).astype(np.float32).astype(float), 0.5),
        (lambda p: -backward(p) * 30 / np.pi, 0.5),
        (lambda p: lfilter([0.1], [1.0, -0.9], backward(p)), 9.5),
        (lambda p: np.round(lfilter([0.2], [1.0, -0.8], backward(p)), 2), 4.5),
        (lambda p: lfilter(*butter(1, 0.2), backward(p)), None),
        (lambda p: lfilter(*butter(2, 0.1), backward(p)), None),
        (tracking_loop, None),
    ],
)  # fmt: skip
def test_what_a_driver_computes_is_recognised(
    counts: np.ndarray, computed: Callable[[np.ndarray], np.ndarray], delay: float | None
) -> None:
    found = difference(TIME, counts, computed(counts))
    assert found is not None
    if delay is not None:
        assert found.delay == pytest.approx(delay * STEP, abs=0.01 * STEP)


def test_lost_messages_turns_of_the_encoder_and_stamps_that_jitter_hide_nothing(counts: np.ndarray) -> None:
    random = np.random.default_rng(2)
    velocity = backward(counts)
    lost = velocity.copy()
    lost[random.integers(0, TIME.size, 15)] = 0.0
    assert difference(TIME, counts, lost) is not None
    assert difference(TIME, np.mod(counts, 20 * np.pi), velocity) is not None
    stamps = TIME + random.normal(0.0, 0.05 * STEP, TIME.size)
    assert difference(stamps, counts, velocity) is not None
    assert difference(stamps, counts, np.concatenate([[0.0], np.diff(counts) / np.diff(stamps)])) is not None


@pytest.mark.slow
def test_a_sensor_of_its_own_is_never_taken_for_a_difference() -> None:
    random = np.random.default_rng(3)
    taken = []
    for number in range(300):
        count, step = int(random.integers(200, 1000)), float(10 ** random.uniform(-3, -1))
        position, velocity = motion(
            count, step, float(10 ** random.uniform(-2.5, 1)), int(random.integers(1, 40)), random
        )
        places = [
            position,
            position + 10 ** random.uniform(-7, -2) * np.std(position) * random.normal(size=count),
            *(np.round(position / q) * q for q in 10 ** random.uniform(-6, -1, 1) * np.std(position)),
        ]
        share = float(np.exp(-1 / random.uniform(0.2, 8)))
        filtered = lfilter([1 - share], [1, -share], velocity)
        speeds = [
            velocity,
            velocity + 10 ** random.uniform(-6, -1) * np.std(velocity) * random.normal(size=count),
            *(np.round(velocity / q) * q for q in 10 ** random.uniform(-5, -1, 1) * np.std(velocity)),
            filtered,
            filtered + 1e-4 * np.std(velocity) * random.normal(size=count),
            np.concatenate([[0.0], velocity[:-1]]),
        ]
        place, speed = places[number % len(places)], speeds[number % len(speeds)]
        if difference(np.arange(count) * step, place, speed) is not None:
            taken.append(number)
    assert taken == []


@pytest.mark.slow
@pytest.mark.parametrize("several", [1, 2, 6])
def test_sines_obey_many_sums_and_are_no_differences(several: int) -> None:
    taken = []
    for number in range(12):
        random = np.random.default_rng([several, number])
        rates, phases = 2 * np.pi * 10 ** random.uniform(-2.5, -0.32, several), random.uniform(0, 6, several)
        angles = np.outer(np.arange(600), rates) + phases
        sizes = random.uniform(0.2, 1, several) / rates
        position, velocity = np.sin(angles) @ sizes, np.cos(angles) @ (sizes * rates) / STEP
        unit = float(10 ** random.uniform(-6, -2) * np.std(position))
        places = [position, np.round(position / unit) * unit, position + unit * random.normal(size=600)]
        noise = 1e-4 * np.std(velocity) * random.normal(size=600)
        speeds = [velocity, velocity + noise, velocity.astype(np.float32).astype(float), np.roll(velocity, 1)]
        for place in places:
            taken += [number for speed in speeds if difference(TIME[:600], place, speed) is not None]
    assert taken == []


def test_two_sensors_with_noise_of_their_own_are_kept_for_every_seed() -> None:
    for seed in range(100):
        random = np.random.default_rng([7, seed])
        position, velocity = motion(
            800, STEP, float(10 ** random.uniform(-2, 0.5)), int(random.integers(1, 200)), random
        )
        share = 10 ** random.uniform(-6, -1, 2)
        place = position + share[0] * np.std(position) * random.normal(size=800)
        speed = velocity + share[1] * np.std(velocity) * random.normal(size=800)
        assert difference(TIME[:800], place, speed) is None, seed


def test_every_difference_of_a_rounded_position_is_found_for_every_seed() -> None:
    for seed in range(30):
        random = np.random.default_rng([8, seed])
        position = motion(900, STEP, float(10 ** random.uniform(-1.5, 0.5)), int(random.integers(5, 100)), random)[0]
        line = 10 ** random.uniform(-5, -2.5) * np.std(position)
        computed = backward(np.round(position / line) * line)
        pole = random.uniform(0.3, 0.95)
        for velocity in (computed, lfilter([1 - pole], [1, -pole], computed)):
            assert difference(TIME[:900], np.round(position / line) * line, velocity) is not None, seed


@pytest.mark.parametrize("hold", [20, 50, 200])
def test_an_observer_that_knows_the_command_is_no_difference(hold: int) -> None:
    random = np.random.default_rng(hold)
    command = np.repeat(random.normal(size=TIME.size // hold + 1), hold)[: TIME.size]
    position, _ = motion(TIME.size, STEP, 0.2, hold, np.random.default_rng(hold))
    place = speed = 0.0
    told = []
    measured = position + 1e-4 * np.std(position) * random.normal(size=TIME.size)
    for one, drive in zip(measured, command, strict=True):
        error = one - place
        place, speed = place + 0.3 * error, speed + 0.03 * error / STEP
        told.append(speed)
        place, speed = place + STEP * speed, speed + STEP / 0.2 * (drive - speed)
    assert difference(TIME, measured, np.array(told)) is None


def test_nothing_is_said_of_what_stands_still_or_is_too_short(counts: np.ndarray) -> None:
    velocity = backward(counts)
    assert difference(TIME, np.zeros(TIME.size), np.zeros(TIME.size)) is None
    assert difference(TIME[:100], counts[:100], velocity[:100]) is None
    assert difference(TIME, counts, np.full(TIME.size, np.nan)) is None
    resting = np.where(TIME < 14.0, counts[1400], counts)
    assert difference(TIME, resting, backward(resting)) is None


def test_a_record_keeps_the_finding_when_it_is_processed(counts: np.ndarray) -> None:
    record = Record(
        "servo", TIME, np.sin(TIME), TIME, np.column_stack([counts, backward(counts)]), "axis.effort", "V",
        ("axis.position", "axis.velocity"), ("rad", "rad/s"),
    )  # fmt: skip
    checked = check_record(record)
    (said,) = [one for one in checked.findings if one.kind == KIND]
    assert said.where == "axis.velocity"
    assert said.level == "warning"
    assert "over 1 sample, 5 ms late" in said.text
    thinned = checked.decimate(4)
    assert differenced(replace(thinned, findings=())) == ()
    assert [one.where for one in differenced(thinned)] == ["axis.velocity"]
    assert [one for one in check_record(checked).findings if one.kind == KIND] == [said]


def test_the_look_at_a_bag_says_so(make_bag) -> None:
    random = np.random.default_rng(4)
    position = motion(200, STEP, 0.05, 20, random)[0] * 1e2 + 0.01 * random.normal(size=200)
    command = random.normal(size=200)
    honest = inspect_bag(make_bag(position=position, velocity=np.cumsum(command), command=command))
    assert not [one for one in honest.findings if one.kind == KIND]
    found = inspect_bag(make_bag(position=position, velocity=np.gradient(position, STEP), command=command))
    assert [one.where for one in found.findings if one.kind == KIND] == ["motor.velocity"]
