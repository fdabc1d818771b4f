"""A push from outside and another machine from some time on are named; effects that a model lacks are not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from idloop.records.inspection.faults import outside_force


def found(axis):
    return [one.kind for one in (outside_force.push(axis) or outside_force.changed_machine(axis),) if one]


def pushing(axis_rate, begin, end, force):
    """A drive that adds a force for a while."""
    sample = -1

    def drive(command):
        nonlocal sample
        sample += 1
        return command + (force if begin <= sample / axis_rate < end else 0.0)

    return drive


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("force", [1.0, -1.0])
def test_a_push_is_named_with_its_time_and_size(make_axis, seed, force):
    one = outside_force.push(make_axis(seed=seed, drive=pushing(200.0, 8.0, 8.25, force)))
    assert one.kind == "outside_force"
    ((begin, end),) = one.places
    assert begin < 8.25
    assert end > 8.0
    assert end - begin < 1.0
    assert one.evidence["force"] == pytest.approx(force, rel=0.4)


def test_a_push_that_comes_again_is_an_effect(make_axis):
    """What always comes back with the position or the time is one of the machine."""
    drives = [pushing(200.0, when, when + 0.25, 1.0) for when in range(1, 15)]
    assert found(make_axis(drive=lambda command: command + sum(drive(0.0) for drive in drives))) == []


@pytest.mark.parametrize("ratio", [0.5, 1.0, 2.0])
def test_a_gain_that_changes_is_another_machine(make_axis, ratio):
    axis = make_axis()
    later = axis.time > 6.0
    one = outside_force.changed_machine(replace(axis, command=axis.command / np.where(later, ratio, 1.0)))
    assert (one is None) == (ratio == 1.0)
    if one is not None:
        assert one.kind == "changed_machine"
        assert one.evidence["ratio"] == pytest.approx(ratio, rel=0.1)
        ((begin, end),) = one.places
        assert begin < 6.0 < end


def test_an_amplitude_that_changes_is_no_other_machine(make_axis):
    levels = np.repeat(np.random.default_rng(5).normal(size=75), 40)
    assert found(make_axis(command=levels * np.where(np.arange(3000) < 1500, 1.0, 0.4))) == []
