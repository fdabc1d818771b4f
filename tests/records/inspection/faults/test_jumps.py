"""A jump of the position may be samples that were lost, or records that were joined."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from idloop.records.inspection.faults import jumps


def _without(axis, start, stop):
    """The axis without some samples, its stamps as even as before."""
    kept = np.delete(np.arange(axis.time.size), np.arange(start, stop))
    time = axis.time[: kept.size]
    return replace(
        axis, time=time, position=axis.position[kept], velocity=None, input_time=time, command=axis.command[kept]
    )


def test_along_the_motion_it_is_said_how_many_samples_may_be_lost(make_axis):
    axis = make_axis(command=np.repeat([1.0, 0.0, -1.0, 0.0], 750))
    found = jumps.spliced(_without(axis, 500, 600))
    assert (
        ": samples were lost (about 100 at the speed there), two recordings were joined, or its zero was set;"
        in found.text
    )


def test_a_jump_against_the_motion_is_no_loss_first(make_axis):
    axis = make_axis(command=np.repeat([1.0, 0.0, -1.0, 0.0], 750))
    position = axis.position - np.where(axis.time > 2.5, 0.5 * np.ptp(axis.position), 0.0)
    found = jumps.spliced(replace(axis, position=position))
    assert ": two recordings were joined, samples were lost, or its zero was set;" in found.text
