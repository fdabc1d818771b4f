"""Set-points, gains and a feed-forward of a loop in the drive, as in the protocol of the MIT mini cheetah."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from idloop.records.recognition.guess import Given
from idloop.records.recognition.recognise import recognise_table
from idloop.records.tables.table import Table

T = np.arange(2000) * 0.005
U = np.repeat(np.random.default_rng(1).uniform(-2.0, 2.0, 40), 50)
SPEED = np.cumsum(U) * 0.05
PLACE = np.cumsum(SPEED) * 0.005


def _log(kp=0.0, kd=0.0, fed=1.0, target=0.0):
    zero = np.zeros(T.size)
    wanted = {"p_des": target * np.sin(T), "v_des": target * np.cos(T), "kp": zero + kp, "kd": zero + kd}
    return {"timestamp": T, **wanted, "t_ff": fed * U, "position": PLACE, "velocity": SPEED, "torque": 0.9 * U}


def _found(columns, **given):
    return recognise_table(
        Table(Path("log.csv"), columns), {k: Given.parse(v, list(columns)) for k, v in given.items()}
    )


def _option(found):
    return [doubt.partition("--command ")[2] for doubt in found.doubts if "gains of a loop" in doubt]


def test_a_feed_forward_is_the_command_where_no_loop_acts():
    found = _found(_log())
    assert {role: found.of(role).column for role in ("command", "position", "velocity")} == {
        "command": "t_ff",
        "position": "position",
        "velocity": "velocity",
    }
    assert found.base.time.column == "timestamp"
    assert _option(found) == []


@pytest.mark.parametrize(
    ("log", "option"),
    [
        (_log(kp=40.0, kd=1.0, fed=0.0, target=0.5), "'kp * (p_des - position) + kd * (v_des - velocity)=N·m'"),
        (_log(kd=1.0), "'kd * (v_des - velocity) + t_ff=N·m'"),
    ],
)
def test_what_a_loop_adds_is_a_formula_that_can_be_given(log, option):
    (said,) = _option(_found(log))
    assert said == option
    again = _found(log, command=said.strip("'"))
    assert again.of("command").unit == "N·m"
    assert _option(again) == []
