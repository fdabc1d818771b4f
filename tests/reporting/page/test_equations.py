"""Equations of presets with every effect of the catalogue: whole, and every parameter has its symbol."""

from __future__ import annotations

import re
from xml.etree import ElementTree as ET

import pytest

from idloop.physics import load_model, trust
from idloop.physics.effect import built_in
from idloop.physics.model_file import from_text
from idloop.reporting.page.equations import equations, plain_words, to_mathml

SITES = {"input": "input", "body": "load1", "coupling": "motor-load1", "output": "position[load1]"}
EFFECTS = [(name, effect.site) for name, several in built_in().items() for effect in several]


def test_a_plain_axis_reads_as_in_a_textbook():
    lines, symbols = equations(load_model("emps"))
    assert [line.latex for line in lines] == [
        r"m\,\frac{dv}{dt} = K\,u - B\,v",
        r"y_{\text{axis.position}} = x + e",
    ]
    assert symbols == {"axis.inertia": "m", "axis.viscous_friction": "B", "drive.gain": "K"}


def test_a_chain_passes_its_torques_on():
    lines, symbols = equations(load_model("torsion"))
    written = [line.latex for line in lines]
    assert any(r"K\,u - T_{\text{motor-load1}}" in one for one in written)
    assert any(one.startswith(r"T_{\text{load2-load3}} = k_{\text{load2-load3}}") for one in written)
    assert len(set(symbols.values())) == len(symbols)


def test_what_an_effect_says_of_a_whole_coupling_replaces_the_plain_one():
    written = [
        line.latex for line in equations(load_model("torsion").with_effects(["backlash@motor-load1(gap=0.1)"]))[0]
    ]
    (one,) = (text for text in written if text.startswith(r"T_{\text{motor-load1}} ="))
    assert one.startswith(r"T_{\text{motor-load1}} = 0 \text{ while }")


def test_a_long_balance_is_cut_before_its_summands():
    """A browser breaks no line within a <math>; the fourth summand was cut off."""
    balance = next(one.latex for one in equations(load_model("torsion"))[0] if one.about.startswith("load1:"))
    cut = ET.fromstring(to_mathml(balance, block=True))
    assert len(cut) == balance.count(" - ") + 1 == 3
    assert [one.find(".//*[@form='infix']") is not None for one in cut] == [False, True, True]


def test_a_gain_that_the_loop_of_a_drive_does_not_have_is_not_written():
    text = load_model("axis").to_yaml().replace("field: effort, unit: N·m", "field: position, unit: rad")
    drive = "drive: {kind: position_loop, unit: V, gain: 0.2, proportional: 12.0, derivative: 0.3}"
    lines = [line for line in text.splitlines() if not line.startswith(("controller", "drive"))]
    (loop,) = (one.latex for one in equations(from_text("\n".join([*lines, drive]), None))[0] if one.effect == "drive")
    assert loop == r"u_d = K_p\,(u - \theta) - K_d\,\omega"


@pytest.mark.parametrize("name", ["cogging@motor", "load_torque@load1", "compliance@load3"])
def test_the_term_of_the_newest_effect_is_marked_in_its_balance(name):
    model = load_model("torsion").with_effects([name])
    plain, marked = (" ".join(one.latex for one in equations(model, newest)[0]) for newest in ("", name))
    assert marked.count(r"\class{new}{") == 1
    assert re.sub(r"\\class\{new\}\{(.*)\}", r"\1", marked).replace("}", "") == plain.replace("}", "")
    assert 'class="new"' in to_mathml(next(one.latex for one in equations(model, name)[0] if r"\class" in one.latex))


def test_what_acts_inside_a_body_is_written_with_the_spring_that_splits_it():
    inside = ["compliance@axis(stiffness=6)", "backlash@axis-axis_far(gap=0.05)", "slip@axis-axis_far(limit=2)"]
    lines, symbols = equations(load_model("axis").with_effects(inside))
    written = [line.latex for line in lines]
    assert any(one.startswith(r"T_{\text{axis-axis far}} = k_c\,\Delta \theta + d_c\,\Delta \omega") for one in written)
    assert any(r"\text{, else } k_c\left(\Delta \theta" in one for one in written)
    assert symbols["backlash@axis-axis_far.gap"] == r"\delta"
    assert "axis-axis_far.stiffness" not in symbols


@pytest.mark.parametrize(("name", "site"), EFFECTS, ids=[f"{n}@{s}" for n, s in EFFECTS])
def test_every_effect_of_the_catalogue_is_written_and_its_parameters_have_symbols(name, site):
    assert all(effect.equation is not None for effect in built_in()[name] if effect.site == site)
    at = SITES[site]
    if site == "output" and name == "velocity_filter":
        model, at = load_model("dc_motor"), "velocity[motor]"
    else:
        model = load_model("torsion")
    model = model.with_effect(name, at)
    lines, symbols = equations(model)
    own = [p.name for p in model.parameters if p.name.startswith(f"{name}@")]
    assert own
    assert set(own) <= set(symbols)
    text = " ".join(line.latex for line in lines)
    assert "@" not in text
    assert not re.search(r"\((\S+) - \1\)", text), "a difference of nothing"
    # Without a static level the velocity of its decay changes nothing.
    idle = {"presliding_friction.velocity"} if name == "presliding_friction" else set()
    for parameter in own:
        if "split" not in parameter and parameter.replace(f"@{at}", "") not in idle:
            assert symbols[parameter] in text
    for line in lines:
        ET.fromstring(to_mathml(line.latex, block=True))


def test_effects_of_the_command_act_one_after_the_other():
    model = load_model("dc_motor").with_effects(["dead_zone@input(width=0.1)", "input_delay@input(delay=0.01)"])
    lines, _ = equations(model)
    balance = next(line.latex for line in lines if "frac" in line.latex)
    terms = [line.latex.split(" = ")[0].replace("(t)", "") for line in lines if line.about == "command"]
    assert f"K\\,{terms[-1]}" in balance
    second = next(line.latex for line in lines if line.latex.startswith(terms[1]))
    assert terms[0] in second


def test_an_effect_of_the_users_own_is_a_function_of_what_it_depends_on(tmp_path):
    folder = tmp_path / "effects"
    folder.mkdir()
    (folder / "sticky.py").write_text(
        "from idloop.physics.effect import BODY, Effect, EffectParameter\n"
        "from idloop.physics.hooks import hook\n"
        "@hook\n"
        "def force(position, velocity, inertia, elapsed, state, parameters):\n"
        "    return -parameters[0] * velocity\n"
        "EFFECT = Effect(name='sticky', site=BODY, text='It sticks.', force=force,\n"
        "    parameters=(EffectParameter('much', '{force}'),))\n"
    )
    path = tmp_path / "axis.yaml"
    path.write_text(load_model("emps").to_yaml())
    trust.allow(folder)
    lines, symbols = equations(load_model(path).with_effects(["sticky@axis"]))
    assert any(line.latex == r"F_{\text{sticky}} = f(x, v)" for line in lines)
    assert symbols["sticky@axis.much"] == r"p_{\text{much}}"


def test_names_that_mean_something_in_latex_are_only_names():
    text = load_model("torsion").to_yaml().replace("load1", "load_1")
    lines, symbols = equations(from_text(text, None))
    assert r"J_{\text{load 1}}" in symbols.values()
    for latex in (*(line.latex for line in lines), *symbols.values()):
        ET.fromstring(to_mathml(latex))
    assert plain_words(r"50%_\a{b}") == "50   a b "
