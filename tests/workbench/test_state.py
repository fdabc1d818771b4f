"""What the page says in words."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

pytest.importorskip("bokeh", reason="no Bokeh: launch_scripts/test installs it")

from idloop.workbench import state


def error(mean=0.0, rms=1.0, **variables):
    """An error of the force along variables: how much of it follows each, and whether it stands out."""
    breakdowns = {
        name: SimpleNamespace(variable=name, follows=follows, stands_out=loud)
        for name, (follows, loud) in variables.items()
    }
    return SimpleNamespace(
        name="drive force", basis="force", unit="N", mean=mean, rms=rms, breakdowns=tuple(breakdowns.values()),
        along=breakdowns.get,
    )  # fmt: skip


class Where(dict):
    """Errors by name, as an assessment has them."""

    @property
    def maps(self):
        return tuple(self.values())


def first_shown(one):
    return state._telling(SimpleNamespace(where=Where({one.name: one})))


def test_what_stands_out_is_shown_before_what_only_varies():
    one = error(velocity=(0.1, False), position=(0.2, False), command=(0.15, True), frequency=(0.9, True))
    assert first_shown(one) == {"error": "drive force", "variable": "command"}


def test_what_the_error_follows_most_is_shown_of_several():
    one = error(velocity=(0.3, True), position=(0.6, True), command=(0.5, False))
    assert first_shown(one) == {"error": "drive force", "variable": "position"}


def test_velocity_is_shown_where_nothing_says_anything():
    assert first_shown(error(velocity=(0.01, False), position=(0.02, False)))["variable"] == "velocity"
    assert first_shown(error(command=(0.01, False), position=(0.02, False)))["variable"] == "position"


def test_an_error_of_one_sign_is_said_to_be_the_same_everywhere():
    assert state._everywhere(error(mean=-2.5, rms=2.6)) == "Most of it is the same everywhere: −2.5 N on average."
    assert state._everywhere(error(mean=0.3, rms=2.6)) == ""


def test_a_parameter_has_as_many_digits_as_its_interval_lets_stand():
    found = state.parameter_words({
        "width": {"value": 0.29812, "stderr": 0.00139, "unit": "V"},
        "rest_position": {"value": -1.22e4, "stderr": None, "unit": "rad"},
        "ratio": {"value": 2.0, "stderr": 0.1, "unit": "-"},
    })  # fmt: skip
    assert found == ["width 0.2981 ± 0.0027 V", "rest position −1.22 · 10⁴ rad", "ratio 2.00 ± 0.20"]
