"""Every fault is named on a record that has it, with its evidence and its cure; a clean record has none."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from idloop.physics import load_model
from idloop.records import inspect_bag, make_stream
from idloop.records.bags.publishers import find_publishers
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults import drive_limits
from idloop.records.inspection.faults.checks import inspect_axis
from idloop.records.inspection.faults.command_sign import backward_travel


def kinds(axis: Axis) -> list[str]:
    return [one.kind for one in inspect_axis(axis) if one.level == "warning"]


def the(axis: Axis, kind: str):
    (found,) = (one for one in inspect_axis(axis) if one.kind == kind)
    assert found.text.endswith(found.cure)
    assert found.cure
    return found


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("rate", [20.0, 200.0, 5000.0])
def test_a_clean_record_has_no_fault(make_axis, rate, size):
    # The same axis in another unit of time: the motion of a sample is the same.
    axis = make_axis(size=size)
    time = axis.time * 200.0 / rate
    axis = replace(axis, time=time, input_time=time, velocity=axis.velocity * rate / 200.0)
    assert kinds(axis) == []


@pytest.mark.parametrize("seed", range(3))
def test_friction_cogging_and_play_are_no_faults(make_axis, seed):
    axis = make_axis(seed, drive=lambda u: u - 0.1 * np.sign(u))
    late = np.concatenate([axis.position[:1], axis.position[:-1]])
    playing = np.where(np.diff(axis.position, prepend=0.0) > 0.0, axis.position, np.maximum(late, axis.position - 0.01))
    assert kinds(replace(axis, position=playing, velocity=None)) == []


@pytest.mark.parametrize(
    ("factor", "words"),
    [
        (30 / np.pi, "in rpm"),
        (-1.0, "wrong sign"),
        (0.0, "stays at 0"),
        (7.0, "other side of a gear"),
        (1.989, "a sample time that is 1.989 times too long"),
        (0.4, "a sample time that is 2.5 times too short"),
    ],
)
def test_a_velocity_that_is_no_derivative(make_axis, factor, words):
    axis = make_axis()
    found = the(replace(axis, velocity=factor * axis.velocity), "wrong_velocity")
    assert words in found.text


@pytest.mark.parametrize("lost", [True, False])
def test_a_command_without_visible_effect_that_never_changes_its_sign_may_have_lost_it(make_axis, lost):
    """A pendulum that swings by a smooth force: no correlation shows the lost sign."""
    time = np.arange(6000) / 200
    command = sum(np.sin(turns * time + turns) for turns in (1.5, 3.8, 7.1, 11.9))
    swinging = make_axis(count=6000, command=command)
    unrelated = np.random.default_rng(3).normal(size=6000)
    found = the(replace(swinging, command=np.abs(unrelated) if lost else unrelated), "weak_excitation")
    assert ("check that the sign of j.effort was recorded" in found.cure) == lost


@pytest.mark.parametrize("seed", range(3))
def test_an_arm_whose_weight_is_far_larger_than_what_accelerates_it_is_excited(make_axis, seed):
    rng = np.random.default_rng(seed)
    time, size = np.arange(3000) / 200, np.array([1.5, 1.2, 0.9])
    turns, phases = np.array([1.3, 2.1, 3.4]), rng.uniform(0.0, 6.0, 3)
    angle = np.sin(np.outer(time, turns) + phases) @ size
    speed = np.cos(np.outer(time, turns) + phases) @ (turns * size)
    acceleration = -np.sin(np.outer(time, turns) + phases) @ (turns**2 * size)
    noise = 0.05 * rng.normal(size=time.size)
    torque = 0.1 * acceleration + 0.5 * speed + 0.5 * np.sign(speed) + 6.0 * np.sin(angle + 0.4) + noise
    arm = replace(make_axis(count=3000), position=angle, velocity=speed, command=torque)
    assert "weak_excitation" not in kinds(arm)


def test_a_late_velocity_is_measured_in_milliseconds(make_axis):
    axis = make_axis()
    slow = lfilter([0.1], [1.0, -0.9], axis.velocity)  # 9 samples of 5 ms late
    found = the(replace(axis, velocity=slow), "late_velocity")
    assert found.evidence["delay"] == pytest.approx(0.045, rel=0.15)
    # The cure can be copied into a model of the axis.
    (effect,) = re.findall(r"`(.*?)`", found.cure)
    assert load_model("axis").with_effects([effect.replace(f"[{axis.joint}]", "[axis]")]).effects


def test_a_command_without_its_sign(make_axis):
    axis = make_axis()
    found = the(replace(axis, command=np.abs(axis.command)), "sign_lost")
    assert found.spoils == ("identification",)
    assert "never negative" in found.text


def test_a_load_that_comes_back_by_itself_keeps_its_sign(make_axis):
    lifted = make_axis(
        drive=lambda u: u - 1.0, command=np.repeat(np.abs(np.random.default_rng(1).normal(1, 1, 75)), 40)
    )
    assert "sign_lost" not in kinds(lifted)


@pytest.mark.parametrize("lost", [True, False])
def test_a_load_that_is_moved_both_ways_has_two_levels_and_no_lost_sign(make_axis, lost):
    """A loop of the speed lifts and lowers a weight; another one without a weight lost the sign of its command."""
    rng, state, weight = np.random.default_rng(4), [0.0], 0.0 if lost else 0.8
    wanted = np.repeat(np.tile([1.0, 0.0, -1.0, 0.0], 15), 50)
    speed, rows = 0.0, []
    for target in wanted:
        state[0] += 0.05 * (target - speed)
        command = 0.3 * (target - speed) + state[0] + weight
        rows.append((speed, command))
        for _ in range(4):
            speed += 0.00125 * (50.0 * (command - weight) - 5.0 * speed - 4.0 * math.tanh(speed / 0.01))
    speed, command = np.array(rows).T
    axis = replace(
        make_axis(count=speed.size),
        position=None,
        velocity=speed + 2e-3 * rng.normal(size=speed.size),
        command=np.abs(command + 2e-3 * rng.normal(size=speed.size)),
    )
    assert (backward_travel(axis) > 0.0) == lost


def test_a_turned_command(make_axis):
    axis = make_axis()
    found = the(replace(axis, command=-axis.command), "turned_command")
    assert found.evidence["gain"] == pytest.approx(-50.0, rel=0.1)


@pytest.mark.parametrize("measured", ["position", "velocity"])
@pytest.mark.parametrize("load", [0.0, 1.0])
def test_a_command_against_a_motion_of_one_direction_is_turned_unless_a_load_drives_it(make_axis, load, measured):
    """Slow steps, at the end with the drive off, show no inertia; a weight that is lowered moves so as well."""
    levels = np.random.default_rng(2).uniform(0.2, 0.9, 12)
    command = np.repeat(np.append(levels, np.full(12, load)), 1000)
    axis = make_axis(count=command.size, command=command, drive=lambda u: u - load)
    rare = {name: getattr(axis, name)[::60] for name in ("time", "input_time", "position", "velocity")}
    unknown = dict.fromkeys({"position", "velocity"} - {measured})
    sent = command if load else -np.repeat(np.tile(levels, 2), 1000)
    axis = replace(axis, **(rare | unknown), command=sent[::60])
    assert np.nanmean(axis.grid.command * axis.grid.speed) < 0.0
    assert ("turned_command" in kinds(axis)) == (load == 0.0)


def test_simulated_time_beside_receive_time(make_axis):
    axis = make_axis()
    receive = 1_700_000_000_000_000_000 + (1e9 * axis.time).astype(np.int64)
    simulated = 12_000_000_000 + (1e9 * axis.time).astype(np.int64)
    found = the(
        replace(
            axis,
            measured_stream=make_stream("joint_states", simulated, {"j": {"position": axis.position}}, receive),
            command_stream=make_stream("joint_command", receive, {"j": {"effort": axis.command}}),
        ),
        "two_clocks",
    )
    assert "simulated time" in found.text
    assert found.spoils == ("identification",)


def test_two_publishers(make_axis):
    axis = make_axis()
    other = np.arange(0, 3000, 5)
    stamps = (1e9 * np.concatenate([axis.time, axis.time[other] + 0.002])).astype(np.int64) + 10**9
    values = np.concatenate([axis.position, np.full(other.size, 99.0)])
    order = np.argsort(stamps)
    both = find_publishers(make_stream("joint_states", stamps[order], {"j": {"position": values[order]}}))
    assert the(replace(axis, publishers=(both,)), "two_publishers").evidence["second"] == 600


def test_stamps_of_reception(make_axis):
    axis = make_axis()
    late = np.random.default_rng(0).exponential(0.001, size=3000)
    found = the(replace(axis, time=axis.time + np.minimum(late, 0.0045)), "wrong_stamps")
    assert found.evidence["jitter"] == pytest.approx(0.001, rel=0.2)
    assert abs(found.evidence["shown"]) < 0.1


def test_uneven_stamps_that_are_true(make_axis):
    axis = make_axis(rate=1000.0, count=12000)
    rows = np.flatnonzero(np.random.default_rng(0).uniform(size=12000) < 0.3)
    uneven = replace(axis, time=axis.time[rows], position=axis.position[rows], velocity=axis.velocity[rows])
    assert "wrong_stamps" not in kinds(uneven)


@pytest.mark.parametrize(("old", "share"), [(lambda k: k % 4 != 0, 0.75), (lambda k: k % 20 == 7, 0.05)])
def test_repeated_values(make_axis, old, share):
    axis = make_axis()
    fresh = np.maximum.accumulate(np.where([old(k) for k in range(3000)], 0, np.arange(3000)))
    found = the(replace(axis, position=axis.position[fresh], velocity=None), "repeated_samples")
    assert found.evidence["share"] == pytest.approx(share, rel=0.2)
    assert found.places


def test_missed_pulses(make_axis):
    axis = make_axis()
    shift = np.zeros(3000)
    shift[[400, 900, 1700, 2500]] = 0.02 * np.ptp(axis.position)
    found = the(replace(axis, position=axis.position - np.cumsum(shift)), "missed_pulses")
    assert found.evidence["jumps"] == 4
    # They make more acceleration than the motion has.
    assert {"inertia and friction", "delays"} <= set(found.spoils)


@pytest.mark.parametrize("again", [True, False])
def test_samples_recorded_again_or_left_out_are_no_missed_pulses(make_axis, again):
    """A robot whose state is read too late or twice: the position stands for a sample, or makes a double step."""
    time = np.arange(3000) / 200
    position = np.sin(2.0 * time)
    odd = np.array([150, 300, 600, 770, 1100, 1250, 1500, 1800, 2600])
    order = np.arange(3000)
    for k in odd:
        order[k:] += -1 if again else 1
    axis = replace(make_axis(command=np.cos(2.0 * time)), position=position[np.clip(order, 0, 2999)], velocity=None)
    assert "missed_pulses" not in kinds(axis)
    found = the(axis, "lost_samples")
    assert found.evidence["jumps"] == pytest.approx(odd.size, abs=1)
    assert found.evidence["repeated"] == again * found.evidence["jumps"]
    assert found.spoils == ("delays",)


@pytest.mark.parametrize("seed", range(3))
def test_samples_left_out_spoil_the_inertia_where_the_missing_time_moves_it_out_of_its_interval(make_axis, seed):
    """Also where more are left out than an encoder would miss pulses: each piece of the motion looks faster."""
    rng = np.random.default_rng(seed)
    axis = make_axis(seed, drive=lambda u: u + 0.5 * rng.normal())
    chosen = rng.uniform(size=3000)
    for share, spoilt in ((0.003, ("delays",)), (0.05, ("inertia and friction", "delays"))):
        kept = chosen >= share
        stamps = axis.time[: kept.sum()]
        short = {"time": stamps, "input_time": stamps, "command": axis.command[kept]}
        found = the(replace(axis, position=axis.position[kept], velocity=axis.velocity[kept], **short), "lost_samples")
        assert found.spoils == spoilt
        assert 0.2 * share < found.evidence["share"] < 1.3 * share


@pytest.mark.parametrize("seed", range(3))
def test_a_motion_of_which_pieces_were_left_out_under_even_stamps_is_told_from_pulses_counted_twice(make_axis, seed):
    """The command changes every 40 samples, with the time constant of the axis; each piece begins shortly before."""
    axis = make_axis(seed)
    moved = np.abs(np.diff(axis.position[::40]))
    begins = np.sort(np.argsort(moved)[-6:]) * 40 + 35
    kept = np.ones(3000, dtype=bool)
    for begin in begins:
        kept[begin : begin + 25] = False
    count = int(kept.sum())
    short = {"time": axis.time[:count], "input_time": axis.time[:count], "command": axis.command[kept]}
    for velocity in (axis.velocity[kept], None):
        cut = replace(axis, position=axis.position[kept], velocity=velocity, **short)
        assert "missed_pulses" not in kinds(cut)
        found = the(cut, "lost_samples")
        assert found.evidence["jumps"] >= 3
    twice = np.zeros(3000)
    twice[begins] = 0.3 * np.sign(axis.velocity[begins]) * np.ptp(axis.position[begins])
    found = the(replace(axis, position=axis.position + np.cumsum(twice)), "missed_pulses")
    assert found.evidence["missed"] == 0


def test_pulses_missed_above_a_speed(data_dir, tmp_path):
    from idloop.records.tables.importing import import_bag

    folder = data_dir / "failing_inputs" / "04_step_from_rest"
    import_bag(folder / "ubc_12V_missed_pulses.csv", tmp_path / "fast", folder / "ubc_csv.yaml")
    found = inspect_bag(tmp_path / "fast")
    assert found.grade == "not usable for identification"
    assert "above some speed pulses of the encoder are missed" in found.grade_reason
    import_bag(folder / "ubc_8V.txt", tmp_path / "slow", folder / "ubc_8V.yaml")
    assert "missed_pulses" not in {one.kind for one in inspect_bag(tmp_path / "slow").findings}


def test_the_motor_that_lost_its_sign(data_dir, tmp_path):
    from idloop.records.tables.importing import import_bag

    folder = data_dir / "failing_inputs" / "06_sign_lost"
    import_bag(folder / "eggdrop.csv", tmp_path / "egg", folder / "map.yaml")
    found = inspect_bag(tmp_path / "egg")
    assert [one.kind for one in found.faults] == ["sign_lost"]
    assert found.grade == "not usable for identification"


def test_spikes_are_found_where_they_are(make_axis):
    axis = make_axis()
    position = axis.position.copy()
    position[[700, 1400]] += 0.05 * np.ptp(position)
    found = the(replace(axis, position=position), "spikes")
    assert found.count == 2
    assert found.places[0][0] <= axis.time[700] <= found.places[0][1]


def test_a_coarse_sensor(make_axis):
    axis = make_axis()
    step = np.ptp(axis.position) / 50
    found = the(replace(axis, position=step * np.round(axis.position / step), velocity=None), "coarse")
    assert found.evidence["step"] == pytest.approx(step)


def test_a_command_that_is_cut_off(make_axis):
    wave = 1.5 * np.sin(np.arange(3000) / 60) + 0.7 * np.sin(np.arange(3000) / 23)
    found = the(make_axis(command=np.clip(wave, -1.0, 1.0)), "saturated_command")
    assert found.evidence["limit"] == 1.0
    assert "limit (1 V)" in found.text
    assert "saturated_command" not in kinds(make_axis(command=wave))
    unitless = make_axis(command=np.clip(wave, -1.0, 1.0), units={"j.effort": "-"})
    assert "limit (1 command units)" in the(unitless, "saturated_command").text


def test_a_command_that_the_drive_does_not_follow(make_axis):
    axis = make_axis(drive=lambda u: float(np.clip(u, -0.6, 0.6)))
    assert the(axis, "not_followed").evidence["gain_beyond"] < 0.35


def test_a_set_point_of_the_position(make_axis):
    axis = make_axis()
    target = np.concatenate([axis.position[4:], np.full(4, axis.position[-1])])
    found = the(replace(axis, command=target), "inner_loop")
    assert "set-point of the position" in found.text
    by_unit = replace(axis, units={**axis.units, "j.effort": "rad/s"})
    assert "set-point of the velocity: it is given in rad/s" in the(by_unit, "inner_loop").text


@pytest.mark.parametrize("recorded", [True, False])
def test_a_loop_without_its_reference(recorded):
    rng = np.random.default_rng(2)
    time, p, v = np.arange(4000) / 500, 0.0, 0.0
    position, velocity, command = np.empty((3, 4000))
    for k in range(4000):
        position[k], velocity[k] = p + 1e-4 * rng.normal(), v + 1e-2 * rng.normal()
        command[k] = 40.0 * (np.sin(2.0 * time[k]) + np.sin(5.1 * time[k]) - position[k]) - 5.0 * velocity[k]
        v += 0.002 * (command[k] - 2.0 * v - 0.5 * math.tanh(v / 0.01))
        p += 0.002 * v
    axis = Axis("j", time, position, velocity, time, command, "j.effort", has_reference=recorded)
    assert ("unrecorded_reference" in kinds(axis)) == (not recorded)


@pytest.mark.parametrize("how", ["not measured", "not recorded"])
def test_missing_samples_are_no_loop(make_axis, how):
    time = np.arange(3000) / 200
    axis = make_axis(2, command=np.sin(2.0 * time) + np.sin(5.1 * time + 1.0))
    rows = np.arange(3000) % 37 > 0
    if how == "not measured":
        axis = replace(axis, position=np.where(rows, axis.position, np.nan))
    else:
        axis = replace(axis, time=axis.time[rows], position=axis.position[rows], velocity=axis.velocity[rows])
    assert "unrecorded_reference" not in kinds(axis)


def test_two_levels_and_a_motion_that_is_lost_in_noise(make_axis):
    axis = make_axis(command=np.where(np.random.default_rng(3).normal(size=75) > 0, 1.0, -1.0).repeat(40))
    assert the(axis, "two_levels").spoils == ("dead zone", "limits of the drive")
    noise = np.std(axis.position) * np.random.default_rng(0).normal(size=3000)
    found = the(replace(axis, position=axis.position + noise, velocity=None), "small_motion")
    assert "the motion is lost in the noise" in found.text
    # A coarse sensor says nothing of an axis at rest. Rounding to 15 steps is the noise of a usable sensor.
    rounded = {count: np.ptp(axis.velocity) / count for count in (5, 15)}
    coarse, fine = (np.round(axis.velocity / step) * step for step in rounded.values())
    found = kinds(replace(axis, position=None, velocity=fine))
    assert "coarse" in found
    assert "small_motion" not in found
    found = the(replace(axis, position=None, velocity=coarse), "small_motion")
    assert "steps of the sensor" in found.text
    assert "too coarse" in found.text
    assert "finer sensor" in found.cure


def test_a_wrapped_position_is_named_with_its_range(make_axis):
    axis = make_axis()
    found = the(replace(axis, position=np.mod(10.0 * axis.position, 360.0), velocity=None), "wrapped_position")
    assert found.evidence["span"] == pytest.approx(360.0, rel=0.01)
    assert "`wrap: 360`" in found.cure


@pytest.mark.parametrize("limit", ["force", "speed"])
def test_a_limit_of_the_speed_is_none_of_the_force(limit):
    """Near the speed that the axis does not exceed the acceleration does not grow with the command either."""
    rng = np.random.default_rng(0)
    count, rate = 5000, 250.0
    command = np.repeat(rng.uniform(-7.0, 7.0, count // 150 + 1), 150)[:count]
    position, velocity, p, v = np.empty(count), np.empty(count), 0.0, 0.0
    for k in range(count):
        position[k], velocity[k] = p, v
        force = float(np.clip(command[k], -3.0, 3.0)) if limit == "force" else float(command[k])
        for _ in range(4):
            driven = limit == "force" or abs(v) < 2.0 or v * force < 0.0
            v += (force * driven - v - 0.5 * math.tanh(v / 0.01)) / (1.2 * rate)
            p += 0.25 * v / rate
    time = np.arange(count) / rate
    position, velocity = position + 3e-4 * rng.normal(size=count), velocity + 0.01 * rng.normal(size=count)
    units = {"j.position": "rad", "j.velocity": "rad/s", "j.effort": "N·m"}
    axis = Axis("j", time, position, velocity, time, command, "j.effort", units)
    assert drive_limits.limited_force(axis), "alone either seems one of the force"
    assert ("speed" in the(axis, "not_followed").evidence) == (limit == "speed")


def test_a_limit_of_the_drive_needs_values_below_it():
    """A drive that coasts at 0 V and brakes at 5 V: of two levels no gain between them is known."""
    count, v = 3000, 0.0
    command = np.random.default_rng(1).choice([0.0, 5.0], count // 10).repeat(10)
    velocity = np.empty(count)
    for k in range(count):
        velocity[k] = v
        for _ in range(4):
            v += 0.0025 * (600.0 * command[k] - 10.0 * (0.3 if command[k] == 0.0 else 1.0) * v - 10.0)
    time = 0.01 * np.arange(count)
    velocity += np.random.default_rng(2).normal(size=count)
    assert not drive_limits.limited_force(Axis("j", time, None, velocity, time, command, "j.effort"))


def test_a_limit_of_the_drive_with_few_levels(make_axis):
    command = np.random.default_rng(5).choice([0.0, 0.4, 0.8, 2.5, 5.0], 400).repeat(30)
    axis = make_axis(count=command.size, command=command, drive=lambda u: min(u, 1.0), gain=300.0)
    assert drive_limits.limited_force(axis)


def test_a_position_that_stands_still_and_then_jumps_is_named_without_a_velocity(make_axis):
    axis = make_axis()
    axis.position[1200:1500] = axis.position[1200]
    found = the(replace(axis, velocity=None), "stuck_sensor")
    assert found.places == ((6.0, 7.495),)


def test_an_axis_that_rests_between_its_moves_has_no_stuck_sensor(make_axis):
    moves = np.repeat(np.tile([1.0, 0.0, -1.0, 0.0], 19), 40)[:3000]
    axis = make_axis(command=moves, size=1.0)
    step = 2e-3 * np.ptp(axis.position)
    for every in (1, 4, 16):
        rounded = step * np.round(axis.position[::every] / step)
        slow = replace(axis, time=axis.time[::every], position=rounded, velocity=None)
        assert "stuck_sensor" not in kinds(slow)


@pytest.mark.parametrize("share", [0.5, 0.7])
def test_a_reading_of_the_command_that_is_cut_off_is_told_from_a_command_that_is(make_axis, share):
    turns = np.array([0.4, 1.1, 2.3])[:, None] * np.arange(3000) / 200
    whole = np.sin(turns + np.arange(3)[:, None]).sum(axis=0)
    cut = np.clip(whole, -share * np.max(whole), share * np.max(whole))
    found = the(replace(make_axis(command=whole), command=cut), "clipped_reading")
    assert found.evidence["limit"] == pytest.approx(share * np.max(whole))
    assert "inertia and friction" in found.spoils
    assert "saturated_command" not in kinds(replace(make_axis(command=whole), command=cut))
    assert "clipped_reading" not in kinds(make_axis(command=cut))


def test_a_thrust_that_grows_faster_than_a_command_of_few_levels_is_no_reading_that_is_cut_off(make_axis):
    levels = np.repeat(np.random.default_rng(3).choice(np.linspace(0.1, 1.5, 14), 60), 50)
    levels[levels == levels.max()] = 1.5
    assert "clipped_reading" not in kinds(make_axis(command=levels, drive=lambda u: u * u - 0.7))


@pytest.mark.parametrize("filter_time", [0.03, 0.06])
def test_a_late_velocity_of_an_axis_that_stops_shows_no_stuck_sensor(filter_time):
    time = 0.002 * np.arange(2000)
    speed = np.where(time % 2.0 < 0.9, 3.0 * np.minimum(time % 2.0 / 0.3, 1.0), 0.0) * np.where(time % 4.0 < 2.0, 1, -1)
    share = 0.002 / filter_time
    late = lfilter([share], [1.0, share - 1.0], speed)
    axis = Axis("j", time, np.round(0.002 * np.cumsum(speed), 5), late, time, np.sign(speed), "j.effort")
    assert "stuck_sensor" not in kinds(axis)


def test_a_noisy_velocity_of_an_axis_at_rest_shows_no_stuck_sensor(make_axis):
    axis = make_axis(command=np.concatenate([np.zeros(400), np.repeat(np.random.default_rng(2).normal(size=65), 40)]))
    position = np.where(axis.time < 2.0, 0.0, axis.position)
    velocity = axis.velocity + 0.3 * np.std(axis.velocity) * np.random.default_rng(5).normal(size=3000)
    assert "stuck_sensor" not in kinds(replace(axis, position=position, velocity=velocity))


def test_samples_that_were_left_out_at_one_speed_are_no_pulses_counted_twice():
    """A fine log of a coarse sensor: only what is lost at the top speed stands out."""
    time = np.arange(6000) / 1000.0
    position = np.round(5.0 * np.sin(3.0 * time), 3)
    kept = np.delete(np.arange(6000), [2, 1043, 1045 + 1047, 3145, 4188, 5236])
    short = time[: kept.size]
    axis = Axis("j", short, position[kept], None, short, np.cos(3.0 * time[kept]), "j.effort")
    assert "missed_pulses" not in kinds(axis)
    assert "lost_samples" in kinds(axis)
