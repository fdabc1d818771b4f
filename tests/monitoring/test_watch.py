"""What is watched, as people name it."""

from __future__ import annotations

import pytest

from idloop.errors import InputError
from idloop.monitoring import choose_watches, parse_watch
from idloop.monitoring.watch import may_vary
from idloop.physics import load_model

LEVEL = "coulomb_friction@motor.level"


@pytest.mark.parametrize(
    ("text", "growth"),
    (
        ("coulomb_friction@motor", 0.16),
        (LEVEL, 0.16),
        (f"{LEVEL}=50%", 0.4),
        (f" {LEVEL} = 0.05 ", 0.05),
        (f"{LEVEL}=-0.05", -0.05),
    ),
)
def test_a_growth_is_a_share_or_a_number(model, text, growth):
    watch = parse_watch(model, text)
    assert (watch.parameter, watch.value, watch.unit) == (LEVEL, 0.8, "N·m")
    assert watch.growth == pytest.approx(growth)


@pytest.mark.parametrize(
    ("text", "word"),
    (
        ("coulomb_frictoin@motor", "coulomb_friction@motor"),
        ("backlash@motor", "--effect"),
        ("motor.viscous_frction", "motor.viscous_friction"),
        (f"{LEVEL}=much", "20%"),
        (f"{LEVEL}=inf", "finite"),
        (f"{LEVEL}=-2.0", "outside"),
    ),
)
def test_a_wrong_one_is_refused_with_the_cure(model, text, word):
    with pytest.raises(InputError, match=word):
        parse_watch(model, text)


def test_a_share_of_nothing_is_nothing(model):
    fresh = model.with_values({LEVEL: 0.0})
    with pytest.raises(InputError, match=r"level=0\.01"):
        parse_watch(fresh, LEVEL)
    assert parse_watch(fresh, f"{LEVEL}=0.1").growth == 0.1


def test_without_a_name_friction_and_couplings_are_watched():
    model = load_model("torsion").with_effects(["backlash@motor-load1(gap=0.01)", "coulomb_friction@load3(level=0.01)"])
    found = choose_watches(model.with_effects(["dead_zone@input(width=0.1)"]), [])
    assert [watch.parameter for watch in found] == ["backlash@motor-load1.gap", "coulomb_friction@load3.level"]
    with pytest.raises(InputError, match="no dry friction"):
        choose_watches(load_model("torsion"), [])


def test_one_parameter_is_watched_once(model):
    with pytest.raises(InputError, match="twice"):
        choose_watches(model, [LEVEL, f"{LEVEL}=50%"])


def test_viscous_friction_may_vary_unless_it_is_watched(model):
    watches = choose_watches(model, [LEVEL])
    assert may_vary(model, watches) == ("motor.viscous_friction",)
    assert may_vary(model, watches, ["drive.gain"]) == ("motor.viscous_friction", "drive.gain")
    assert may_vary(model, choose_watches(model, ["motor.viscous_friction"])) == ()
    with pytest.raises(InputError, match="gain"):
        may_vary(model, watches, ["drive.gian"])
