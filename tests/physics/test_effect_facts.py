"""What is known of an effect stands in its own file: no other module names one."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

import idloop
from idloop.errors import InputError
from idloop.physics import Effect, EffectParameter, catalogue, load_model
from idloop.physics.effect import built_in, parameter_as, unknown_effect

PACKAGE = Path(idloop.__file__).parent
WORKSPACE = Path(__file__).parents[2] / "ros_ws" / "src"
# Modules, or folders of them, that may name effects, and why.
EXCEPTIONS = {
    "cli/verbs/demo.py": "the demonstration hides effects that it knows",
    "cli/_demo_loop.py": "so does its closed loop",
    "estimation/describing_functions/elements.py": "describing functions of single elements",
    "exporters/mechanics.py": "rigid-body formats have fields for Coulomb friction, a constant force and limits",
    "exporters/mujoco.py": "MJCF has fields for the range, the bias and the lag of a drive, and for a gap",
    "exporters/usd.py": "a USD joint has a level of friction at rest",
    "exporters/ros2_control.py": "a PID has fields for a limit and for viscous friction; a law's own `velocity_filter`",
    "robots/identify.py": "the rigid bodies of an arm have dry friction and a constant force at each joint",
    "robots/joint_models.py": "they have the weight of the links as well",
    "robots/words.py": "they have viscous friction",
    "records/recognition/roles.py": "a word in the name of a column",
    "records/recognition/model_start.py": "the first model of a log has a body with its own viscous friction",
    "physics/controller_section.py": "a law's own setting is called `velocity_filter`, too",
    "control/packing.py": "a law's own setting is called `velocity_filter`, too",
}
# An effect alone or at a site, such as "dead_zone", "dead_zone@", "dead_zone@input.width"; not within a sentence.
NAMED = re.compile(rf"({'|'.join(built_in())})(@.*)?", re.DOTALL)
OURS = [effect for several in built_in().values() for effect in several]


def named(text: str) -> list[str]:
    """String constants of a module that name effects, docstrings left out."""
    tree = ast.parse(text)
    prose = {
        id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    }
    constants = (n for n in ast.walk(tree) if isinstance(n, ast.Constant) and id(n) not in prose)
    return [n.value for n in constants if isinstance(n.value, str) and NAMED.fullmatch(n.value)]


def modules() -> dict[str, list[str]]:
    """Effects that modules name, by the modules' paths."""
    paths = [(path, path.relative_to(PACKAGE).as_posix()) for path in PACKAGE.rglob("*.py")]
    paths += [(path, path.relative_to(WORKSPACE).as_posix()) for path in WORKSPACE.rglob("*.py")]
    assert len(paths) > 300
    return {
        where: names
        for path, where in paths
        if not where.startswith("physics/effects/") and (names := named(path.read_text(encoding="utf-8")))
    }


def excepted(where: str) -> set[str]:
    return {one for one in EXCEPTIONS if where == one or where.startswith(f"{one}/")}


def test_names_of_effects_are_seen() -> None:
    text = '"""dead_zone"""\nA = "dead_zone"\nB = f"load_torque@{A}"\nC = "such as dead_zone@input"\nD = "slippery"'
    assert named(text) == ["dead_zone", "load_torque@"]


def test_no_module_names_an_effect_but_the_stated_ones() -> None:
    found = modules()
    assert {where: names for where, names in found.items() if not excepted(where)} == {}
    assert set().union(*map(excepted, found)) == set(EXCEPTIONS)


@pytest.mark.parametrize("effect", OURS, ids=lambda one: f"{one.name}@{one.site}")
def test_what_an_effect_says_of_others_names_effects_of_the_catalogue(effect: Effect) -> None:
    others = (*effect.looks_like, *effect.same_as, *effect.by_hand, *effect.contains, *effect.degenerates_to)
    assert set(others) <= set(built_in()) - {effect.name}
    for other, shared in effect.contains.items():
        inner = next(one for one in built_in()[other] if one.site == effect.site)
        for its, mine in shared.items():
            assert inner.spec(its).unit.startswith(("{", "-"))
            assert effect.spec(mine).name == mine


def test_a_fact_of_a_contained_effect_is_one_of_the_effect_that_contains_it() -> None:
    levels = {one.name: parameter_as(one, lambda effect: effect.dry_level) for one in OURS}
    assert {name: level for name, level in levels.items() if level} == {
        "coulomb_friction": "level",
        "asymmetric_friction": "level",
        "presliding_friction": "level",
        "stribeck_friction": "coulomb",
    }


def test_a_parameter_of_a_body_has_its_like_among_the_effects_there() -> None:
    model = load_model("torsion").with_effects(["viscous_friction@motor(coefficient=0.1)"])
    own = "motor.viscous_friction"
    assert model.equivalent_parameters(own) == (own, "viscous_friction@motor.coefficient")
    assert model.equivalent_parameters("motor.inertia") == ("motor.inertia",)


@pytest.mark.parametrize("fact", ["delay", "lost_motion", "resolution", "dry_level", "command_limit"])
def test_a_fact_about_a_parameter_that_there_is_not_is_refused(fact: str) -> None:
    with pytest.raises(InputError, match=r"no parameter 'sise'.*size"):
        Effect("lean", "body", "It leans.", (EffectParameter("size", "{force}"),), **{fact: "sise"})


@pytest.mark.parametrize("fact", ['same_as=("load_torqe",)', 'contains={"load_torqe": {"torque": "size"}}'])
def test_an_own_effect_that_is_said_to_be_one_that_there_is_not_is_refused(
    fact: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "lean.py").write_text(
        "from idloop.physics import Effect, EffectParameter\n"
        f'EFFECT = Effect("lean", "body", "It leans.", (EffectParameter("size", "{{force}}"),), {fact})\n'
    )
    monkeypatch.setenv("IDLOOP_EFFECTS", str(tmp_path))
    with pytest.raises(InputError, match=r"effect lean .*'load_torqe'.*load_torque") as caught:
        catalogue()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("word", "names"),
    [("deadband", "'dead_zone'"), ("Dry Friction", "'coulomb_friction'"), ("play", "'backlash'"),
     ("stiction", "'coulomb_friction' or 'stribeck_friction'"), ("delay", "'input_delay'")],
)  # fmt: skip
def test_everyday_words_point_to_the_name_in_the_catalogue(word, names):
    assert f"(here: {names})" in str(unknown_effect(word, catalogue()))


def test_every_effect_has_everyday_words_and_none_is_the_name_of_another():
    known = catalogue()
    for several in known.values():
        for effect in several:
            assert effect.also_called
            assert not set(effect.also_called) & known.keys()
