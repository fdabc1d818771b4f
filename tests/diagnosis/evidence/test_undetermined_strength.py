"""Effects that the data do not determine, and effects beside which others are not determined any more."""

import re

import pytest

from idloop.diagnosis.evidence.undetermined_strength import is_none, undetermined_with
from idloop.diagnosis.screening.proposals import proposals
from idloop.physics import load_model

COMPLIANCE = {"stiffness": 68.0, "damping": 0.8, "split": 0.04, "viscous_split": 0.5}


@pytest.mark.parametrize(
    ("effect", "values", "errors", "refused"),
    [
        ("sensor_offset@position[axis]", {"offset": -3.7}, {"offset": 8.5}, True),
        ("sensor_offset@position[axis]", {"offset": 0.02}, {"offset": 0.001}, False),
        ("compliance@axis", COMPLIANCE, {"stiffness": 4e4, "damping": 5e2, "split": 17.0, "viscous_split": 9.0}, True),
        ("compliance@axis", COMPLIANCE, {"stiffness": 2.0, "damping": 2.0, "split": 17.0, "viscous_split": 1.0}, True),
        ("compliance@axis", COMPLIANCE, {"stiffness": 2.0, "damping": 2.0, "split": 0.1, "viscous_split": 1.0}, False),
    ],
)  # fmt: skip
def test_what_the_data_do_not_determine_is_not_named(
    effect: str, values: dict[str, float], errors: dict[str, float], refused: bool
) -> None:
    (proposal,) = proposals(load_model("axis"), [effect])
    named = {f"{proposal.name}.{name}": error for name, error in errors.items()}
    text = undetermined_with(proposal.base, proposal.model(values).with_values({}, named), proposal)
    assert bool(text) is refused
    if refused:
        assert text.startswith("the data do not determine its ")
        assert not re.search(r"\d[eE][+-]?\d|inf\b", text)


@pytest.mark.parametrize(
    ("error", "said"), [(4e5, "a standard error of 4 · 10⁵ N·m"), (None, "no finite standard error")]
)
def test_its_numbers_have_units_and_no_programmers_powers(error: float | None, said: str) -> None:
    (proposal,) = proposals(load_model("axis"), ["load_torque"])
    errors = {} if error is None else {f"{proposal.name}.torque": error}
    fitted = proposal.model({"torque": -4930.0}).with_values({}, errors)
    assert undetermined_with(proposal.base, fitted, proposal).endswith(f"its torque: −4.93 · 10³ N·m with {said}")


@pytest.mark.parametrize(
    ("level", "error", "refused"),
    [
        pytest.param(0.4, 9.0, True, id="none or what it was"),
        pytest.param(0.1, 0.01, False, id="as certain as before"),
        pytest.param(0.01, 0.02, False, id="superfluous: none with certainty"),
        pytest.param(0.5, 0.2, False, id="less certain, yet not none"),
    ],
)
def test_an_effect_beside_which_another_one_is_not_determined_any_more(
    level: float, error: float, refused: bool
) -> None:
    friction = "coulomb_friction@axis.level"
    parent = load_model("axis").with_effects(["coulomb_friction@axis(level=0.12)"])
    parent = parent.with_values({}, {friction: 0.01})
    (proposal,) = proposals(parent, ["load_torque"])
    fitted = proposal.model({"torque": 0.1}).with_values(
        {friction: level}, {friction: error, "load_torque@axis.torque": 0.01}
    )
    text = undetermined_with(parent, fitted, proposal)
    assert ("coulomb_friction@axis any more, its level" in text) is refused
    assert bool(text) is refused


@pytest.mark.parametrize(("level", "refused"), [(4000.0, True), (0.3, False)])
def test_two_effects_that_cancel_each_other_are_determined_by_their_difference_only(
    level: float, refused: bool
) -> None:
    friction = "coulomb_friction@axis.level"
    parent = load_model("axis").with_effects(["coulomb_friction@axis(level=0.12)"]).with_values({}, {friction: 0.01})
    (proposal,) = proposals(parent, ["load_torque"])
    errors = {friction: 0.1 * level, "load_torque@axis.torque": 0.1 * level}
    fitted = proposal.model({"torque": level}).with_values({friction: level}, errors)
    assert ("only their difference shows" in undetermined_with(parent, fitted, proposal)) is refused


@pytest.mark.parametrize(("stderr", "refused"), [((0.01, 0.5), False), ((0.1, 0.5), True), ((None, None), True)])
def test_an_effect_whose_addition_to_a_simpler_one_is_not_determined(
    stderr: tuple[float | None, float | None], refused: bool
) -> None:
    parent = load_model("axis").with_effects(["coulomb_friction@axis(level=0.12)"])
    (proposal,) = (one for one in proposals(parent, ["stribeck_friction"]) if one.replaces)
    name = proposal.name
    values = {f"{name}.coulomb": 0.1, f"{name}.static": 0.15, f"{name}.velocity": 0.4}
    errors = {f"{name}.coulomb": 0.001, f"{name}.static": stderr[0], f"{name}.velocity": stderr[1]}
    fitted = proposal.model({}).with_values(values).with_values({}, {k: v for k, v in errors.items() if v is not None})
    text = undetermined_with(parent, fitted, proposal)
    assert ("what it adds to coulomb_friction@axis" in text) is refused


def test_an_effect_at_its_neutral_value_is_none() -> None:
    model = load_model("axis").with_effects(["input_delay@input(delay=0.0)", "coulomb_friction@axis(level=0.1)"])
    assert is_none(model, "input_delay@input")
    assert not is_none(model, "coulomb_friction@axis")


@pytest.mark.parametrize(("error", "refused"), [(6e7, True), (1e6, False)])
def test_an_effect_of_which_only_what_a_simpler_one_has_is_determined_is_that_one(error: float, refused: bool) -> None:
    (proposal,) = proposals(load_model("axis"), ["presliding_friction"])
    errors = {f"{proposal.name}.level": 0.01, f"{proposal.name}.stiffness": error}
    fitted = proposal.model({"level": 0.4, "stiffness": 6e6}).with_values({}, errors)
    text = undetermined_with(proposal.base, fitted, proposal)
    assert ("what it adds to coulomb_friction, its stiffness" in text) is refused
    assert bool(text) is refused
