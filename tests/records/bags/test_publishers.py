"""Two publishers on one topic are told from one publisher with jitter, losses, delays or changing joints."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from idloop.records.bags.publishers import find_publishers
from idloop.records.bags.stream import JointStream
from idloop.records.bags.write import make_stream

START = 1_700_000_000_000_000_000
Random = np.random.Generator
SEEDS = range(12)


def motion(time: np.ndarray, rng: Random) -> np.ndarray:
    phase, speed = rng.uniform(0, 6), rng.uniform(0.5, 6)
    return np.sin(speed * time + phase) + 1e-4 * rng.normal(size=time.size)


def stream(time: np.ndarray, receive: np.ndarray, **fields: np.ndarray) -> JointStream:
    order = np.argsort(receive, kind="stable")
    stamps, received = (START + np.round(one[order] * 1e9).astype(np.int64) for one in (time, receive))
    return make_stream("/joint_states", stamps, {"j": {name: value[order] for name, value in fields.items()}}, received)


def grid(rng: Random, rate: float = 200.0, seconds: float = 5.0, jitter: float = 0.01) -> np.ndarray:
    count = int(rate * seconds)
    return rng.uniform(0, 1 / rate) + (np.arange(count) + jitter * rng.normal(size=count)) / rate


# ------------------------------------------------------------------ one publisher


def steady(rng: Random) -> JointStream:
    time = np.sort(grid(rng, jitter=rng.choice([0.0, 0.05, 0.3])))
    return stream(time, time + rng.exponential(1e-3, time.size), position=motion(time, rng))


def random_steps(rng: Random) -> JointStream:
    time = grid(rng, jitter=0.0)
    return stream(time, time, effort=rng.choice([-1.0, 1.0], time.size))


def throttled(rng: Random) -> JointStream:
    time = np.arange(0.0, 5.0, 0.002)[np.cumsum(np.tile([2, 3], 400))]
    return stream(time, time, position=motion(time, rng), effort=rng.choice([-1.0, 1.0], time.size))


def lossy_and_quantised(rng: Random) -> JointStream:
    time = grid(rng)
    time = np.sort(time[rng.random(time.size) > 0.2])
    position = np.round(motion(time, rng) * 100) / 100
    return stream(time, time, position=position, velocity=np.gradient(position, time))


def late_messages(rng: Random) -> JointStream:
    time = grid(rng, jitter=0.0)
    delay = np.where(rng.random(time.size) < 0.1, 0.08, 0.001)
    return stream(time, time + delay, position=motion(time, rng))


def fields_now_and_then(rng: Random) -> JointStream:
    time = grid(rng)
    time.sort()
    position = motion(time, rng)
    velocity = np.where(np.arange(time.size) % 4 == 0, np.gradient(position, time), np.nan)
    return stream(time, time, position=position, velocity=velocity)


def clock_set_back(rng: Random) -> JointStream:
    receive = grid(rng, jitter=0.0)
    time = np.where(np.arange(receive.size) < receive.size // 2, receive, receive - rng.uniform(0.5, 2.4))
    return stream(time, receive, position=motion(receive, rng))


def with_spikes(rng: Random) -> JointStream:
    time = grid(rng, jitter=0.0)
    position = np.where(rng.random(time.size) < 0.05, 0.0, motion(time, rng))
    return stream(time, time, position=position)


ONE = [steady, random_steps, throttled, lossy_and_quantised, late_messages, fields_now_and_then, clock_set_back]
ONE += [with_spikes]

# ------------------------------------------------------------------ two publishers


def merged(
    rng: Random, first: np.ndarray, second: np.ndarray, clock: float = 0.0, *, velocity: bool = False
) -> JointStream:
    """A moving joint, and a second publisher that leaves it at rest."""
    receive = np.concatenate([first, second])
    time = np.concatenate([first, second + clock])
    values = np.concatenate([motion(first, rng), np.full(second.size, 0.3)])
    fields = {"position": values}
    if velocity:
        fields["velocity"] = np.concatenate([np.gradient(values[: first.size], first), np.full(second.size, np.nan)])
    return stream(time, receive, **fields)


def two_clocks(rng: Random) -> JointStream:
    return merged(rng, grid(rng), grid(rng, rng.choice([10.0, 50.0, 200.0])), rng.choice([-1.7e9, 37.0, 0.4]))


def other_fields(rng: Random) -> JointStream:
    return merged(rng, grid(rng), grid(rng, 10.0), velocity=True)


def slower_grid(rng: Random) -> JointStream:
    return merged(rng, grid(rng, jitter=0.0), grid(rng, rng.choice([10.0, 50.0]), jitter=0.0))


def equal_grid(rng: Random) -> JointStream:
    first = grid(rng, jitter=0.0)
    return merged(rng, first, first + rng.uniform(0.2, 0.8) / 200)


def equal_stamps(rng: Random) -> JointStream:
    first = grid(rng, jitter=0.0)
    made = merged(rng, first, first)
    pair = np.arange(len(made)).reshape(-1, 2)
    swap = rng.random(first.size) < 0.5
    pair[swap] = pair[swap, ::-1]
    return made.take(pair.ravel())


TWO = {
    two_clocks: "clocks",
    other_fields: "fields",
    slower_grid: "stamps",
    equal_grid: "stamps",
    equal_stamps: "stamps",
}


@pytest.mark.parametrize("make", ONE)
def test_one_publisher_is_never_taken_for_two(make: Callable[[Random], JointStream]) -> None:
    named = [seed for seed in SEEDS if find_publishers(make(np.random.default_rng(seed))) is not None]
    assert named == []


@pytest.mark.parametrize(("make", "evidence"), TWO.items())
def test_two_publishers_are_found_with_what_tells_them_apart(
    make: Callable[[Random], JointStream], evidence: str
) -> None:
    found = [find_publishers(make(np.random.default_rng(seed))) for seed in SEEDS]
    hits = [one for one in found if one is not None]
    assert len(hits) >= len(SEEDS) - 1
    assert {one.evidence for one in hits} == {evidence}
    assert all("j.position" in one.contradicting for one in hits)


def test_the_messages_of_the_second_publisher_are_marked() -> None:
    rng = np.random.default_rng(1)
    first, second = grid(rng), grid(rng, 20.0)
    made = merged(rng, first, second, 37.0)
    found = find_publishers(made)
    assert found is not None
    assert found.counts == (first.size, second.size)
    assert found.clock_offset == pytest.approx(37.0)
    np.testing.assert_array_equal(made.position[found.second, 0], 0.3)


def test_two_publishers_of_different_joints_with_one_clock_are_no_fault() -> None:
    rng = np.random.default_rng(2)
    arm, hand = grid(rng), grid(rng, 50.0)
    time = np.concatenate([arm, hand])
    order = np.argsort(time)
    stamps = START + np.round(time[order] * 1e9).astype(np.int64)
    of_arm = (np.arange(time.size) < arm.size)[order]
    values = motion(time, rng)[order]
    joints = {
        "arm": {"position": np.where(of_arm, values, np.nan)},
        "hand": {"position": np.where(of_arm, np.nan, 1.0)},
    }
    assert find_publishers(make_stream("/joint_states", stamps, joints)) is None


def test_the_recording_that_failed(data_dir) -> None:
    from idloop.records.bags.read import read_streams

    folder = data_dir / "failing_inputs" / "07_bags" / "a2_two_publishers_own_stamps"
    if not folder.is_dir():
        pytest.skip(f"no {folder}")
    streams = read_streams(folder)
    found = find_publishers(streams["/joint_states"])
    assert found is not None
    assert (found.evidence, found.counts) == ("fields", (700, 35))
    assert find_publishers(streams["/joint_command"]) is None
