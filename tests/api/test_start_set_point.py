"""A command without a unit that the motion follows one to one is a set-point, and no force is fitted to it."""

from __future__ import annotations

import numpy as np

import idloop


def test_a_set_point_in_the_unit_of_the_log_is_named_with_its_cure(tmp_path):
    time = np.arange(1500) / 100.0
    wanted = np.repeat(np.random.default_rng(1).uniform(-60.0, 60.0, size=15), 100)
    angle, place = np.empty(1500), 0.0
    for k, target in enumerate(wanted):
        angle[k] = place
        place += 0.3 * (target - place)
    rows = "\n".join(f"{t:.2f},{u:.2f},{q:.3f}" for t, u, q in zip(time, wanted, angle, strict=True))
    (tmp_path / "log.csv").write_text("t_s,servo_cmd,angle_deg\n" + rows + "\n")
    begun = idloop.start(tmp_path / "log.csv", tmp_path / "begun")
    assert begun.fit is None
    assert "set-point of the position" in begun.not_fitted
    assert begun.set_point_unit == "deg"
    assert "run again with --command 'servo_cmd=deg'" in begun.summary()
    # With its unit the model has the loop of the drive.
    again = idloop.start(tmp_path / "log.csv", tmp_path / "again", {"command": "servo_cmd=deg"}, fitted=False)
    assert again.model.loop is not None
