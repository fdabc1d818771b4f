"""What the bridge's parameters allow, and which of them contradict one another."""

from __future__ import annotations

from dataclasses import FrozenInstanceError

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop.errors import InputError
from idloop_nodes.excitation.experiment import Limits
from idloop_nodes.safety.command_limiter import CommandLimits
from idloop_nodes.safety.safety_gate import GateSettings, gate_settings

VALUES = {
    "limit.command": 2.0, "limit.command_rate": 3.0, "limit.rms": 1.5, "limit.rms_time": 4.0, "limit.energy_time": 5.0,
    "limit.position_min": -1.0, "limit.position_max": 1.0, "limit.velocity": 6.0, "limit.energy": 7.0,
    "limit.coast_time": 0.2, "soft_start": 0.3, "watchdog": 0.03, "latch_watchdog": True,
    "interface": "effort", "neutral": "auto", "fields": ("position", "velocity"),
}  # fmt: skip


def test_every_limit_lands_where_it_belongs():
    found = gate_settings(VALUES)
    assert found.command == CommandLimits(2.0, 3.0, 1.5, 4.0, 5.0, 0.3, 0.03)
    assert found.motion == Limits(None, -1.0, 1.0, 6.0)
    assert (found.neutral, found.energy, found.coast_time) == ("zero", 7.0, 0.2)
    assert (found.watchdog, found.latch_watchdog) == (0.03, True)


def test_what_is_not_said_limits_little_and_watches_at_once():
    assert GateSettings(CommandLimits(1.0)) == GateSettings(
        CommandLimits(1.0, None, None, 10.0, 10.0, 1.0, 0.05), Limits(), "zero", None, 0.0, 0.04, False
    )


def test_nothing_can_widen_them_afterwards():
    with pytest.raises(FrozenInstanceError):
        gate_settings(VALUES).energy = None


@pytest.mark.parametrize(
    ("interface", "neutral", "expected"),
    [
        ("effort", "auto", "zero"),
        ("velocity", "auto", "zero"),
        ("effort", "zero", "zero"),
        ("position", "auto", "hold_measured"),
        ("position", "hold_measured", "hold_measured"),
        ("position", "hold_command", "hold_command"),
    ],
)
def test_the_neutral_command_goes_with_the_interface(interface, neutral, expected):
    assert gate_settings(VALUES | {"interface": interface, "neutral": neutral}).neutral == expected


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"limit.command": None}, "limit.command is not set"),
        ({"neutral": "hold_measured"}, "neutral hold_measured does not go with the interface effort; give zero"),
        ({"neutral": "hold_command"}, "give zero"),
        ({"interface": "position", "neutral": "zero"}, "give hold_measured or hold_command"),
        ({"limit.position_min": 1.0}, "limit.position_min 1 is not below limit.position_max 1"),
        ({"limit.position_min": 2.0}, "is not below"),
        ({"interface": "position", "limit.position_min": None}, "needs limit.position_min and limit.position_max"),
        ({"interface": "position", "limit.position_max": None}, "needs limit.position_min and limit.position_max"),
        ({"fields": ("velocity",), "limit.position_min": None}, "a position limit needs position among fields"),
        ({"fields": ("velocity",), "limit.position_max": None}, "a position limit needs position among fields"),
        (
            {"fields": ("effort",), "limit.position_min": None, "limit.position_max": None},
            "limit.velocity needs position or velocity among fields",
        ),
    ],
)
def test_what_contradicts_is_refused(change, said):
    with pytest.raises(InputError, match=said):
        gate_settings(VALUES | change)


NO_POSITION = {"limit.position_min": None, "limit.position_max": None}


@pytest.mark.parametrize(
    "change",
    [
        {"limit.position_min": 0.999},
        {"limit.position_min": None},
        {"limit.position_max": None},
        NO_POSITION | {"fields": ("velocity",)},
        NO_POSITION | {"fields": ("position",)},
        NO_POSITION | {"fields": ("effort",), "limit.velocity": None},
    ],
)
def test_what_does_not_is_taken(change):
    assert gate_settings(VALUES | change).command.command == 2.0
