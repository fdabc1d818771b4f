"""A command without a unit that the motion follows one to one is a set-point, and no force is fitted to it."""

from __future__ import annotations

import numpy as np

import idloop


def test_a_set_point_in_the_unit_of_the_log_is_named_with_its_cure(tmp_path, set_point_log):
    log = set_point_log(60.0, "deg")
    begun = idloop.start(log, tmp_path / "begun")
    assert begun.fit is None
    assert "set-point of the position" in begun.not_fitted
    assert begun.set_point_unit == "deg"
    assert "run again with --command 'servo_cmd=deg'" in begun.summary()
    # With its unit the model has the loop of the drive.
    again = idloop.start(log, tmp_path / "again", {"command": "servo_cmd=deg"}, fitted=False)
    assert again.model.loop is not None


def test_a_log_of_set_point_and_motion_is_fitted_with_the_loop_of_the_drive(tmp_path):
    rate, inertia, stiffness, damping = 200.0, 1.0, 400.0, 30.0
    time = np.arange(3000) / rate
    wanted = np.repeat(np.random.default_rng(2).uniform(-1.0, 1.0, size=30), 100)
    angle, place, speed = np.empty(3000), 0.0, 0.0
    for k, target in enumerate(wanted):
        angle[k] = place
        for _ in range(20):
            speed += 0.05 / rate * (stiffness * (target - place) - damping * speed) / inertia
            place += 0.05 / rate * speed
    angle += 1e-4 * np.random.default_rng(3).normal(size=3000)
    rows = "\n".join(f"{t:.3f},{u:.4f},{q:.5f}" for t, u, q in zip(time, wanted, angle, strict=True))
    (tmp_path / "log.csv").write_text("time_s,goal_position_rad,position_rad\n" + rows + "\n")
    begun = idloop.start(tmp_path / "log.csv", tmp_path / "begun")
    assert begun.fit is not None
    values = begun.fit.model.values
    assert abs(values["drive.proportional"] / stiffness - 1.0) < 0.03
    # Of braking in the loop and friction of the axis only the sum shows.
    assert abs((values["drive.derivative"] + values["axis.viscous_friction"]) / damping - 1.0) < 0.03
    # The loop is in the model: it is no fault of the record any more.
    (inspection,) = begun.inspections
    assert inspection.grade == "usable"
    assert [one.level for one in inspection.findings if one.kind == "inner_loop"] == ["note"]
    assert "the set-point 'goal_position_rad' is taken as the command" in begun.summary()
