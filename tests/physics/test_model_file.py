"""Model files: round trips, and one line for everything that is wrong."""

from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from idloop.errors import InputError
from idloop.physics import load_model, parse_effect, preset_names
from idloop.physics.model_file import build_model, with_joints
from idloop.physics.schema import read_model_file

GOOD = """\
schema: idloop/model/1
name: dc_motor
input: {topic: joint_command, joint: motor, field: effort, unit: V}
outputs:
  - {topic: joint_states, joint: motor, field: position, unit: rad}
  - {topic: joint_states, joint: motor, field: velocity, unit: rad/s}
bodies:
  - {name: motor, inertia: 1.0, viscous_friction: {value: 2.0, min: 0.0}}
couplings: []
drive: {gain: {value: 8.0}}
effects:
  - {effect: dead_zone, at: input, width: {value: 0.12}}
controller: null
"""


def read(text: str):
    return build_model(read_model_file(text, "m.yaml"), "m.yaml")


def test_waves_keep_their_names_when_one_of_them_goes() -> None:
    model = load_model("axis").with_effects([f"cogging@axis(harmonic={n},amplitude={0.1 * n})" for n in (2, 3, 5)])
    left = model.without_effect("cogging@axis")
    assert left.effect_names == ("cogging#2@axis", "cogging#3@axis")
    assert left.values["cogging#3@axis.harmonic"] == 5
    again = read(left.to_yaml())
    assert (again.effect_names, again.values) == (left.effect_names, left.values)
    assert left.to_yaml().count("number:") == 2
    assert model.to_yaml().count("number:") == 0
    back = left.with_effects(["cogging@axis(harmonic=7)"])
    assert back.values["cogging@axis.harmonic"] == 7
    assert read(back.to_yaml()).values == back.values
    assert model.without_effects(model.effect_names).parameters == load_model("axis").parameters


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("{effect: dead_zone, at: input, number: 2}", "acts once"),
        ("{effect: cogging, at: motor, number: 0}", "number"),
        (
            "{effect: cogging, at: motor}, {effect: cogging, at: motor, number: 1}",
            "has the effect cogging@motor already",
        ),
    ],
)
def test_a_number_that_is_none_is_refused_in_one_line(line: str, why: str) -> None:
    with pytest.raises(InputError, match=why) as caught:
        read(GOOD.replace("  - {effect: dead_zone, at: input, width: {value: 0.12}}", f"  [{line}]"))
    assert "\n" not in str(caught.value)


def test_an_effect_of_angles_is_refused_along_a_length() -> None:
    linear = read(load_model("axis").to_yaml().replace("N·m", "N").replace("rad", "m"))
    assert linear.units.position == "m"
    for effect in ("gravity@axis(moment=1)", "cogging@axis(amplitude=1)"):
        with pytest.raises(InputError, match="needs an angle"):
            linear.with_effects([effect])


def test_a_measured_input_stays_one(tmp_path: Path) -> None:
    text = GOOD.replace("field: effort, unit: V}", "field: effort, unit: V, kind: measured}")
    model = read(text)
    assert model.input.kind == "measured"
    model.save(tmp_path / "again.yaml")
    assert load_model(tmp_path / "again.yaml").input.kind == "measured"
    assert read(GOOD).input.kind == "held"
    with pytest.raises(InputError, match="kind"):
        read(text.replace("kind: measured", "kind: guessed"))


def test_the_example_of_the_contract_loads() -> None:
    model = read(GOOD)
    assert model.free == ("motor.viscous_friction", "drive.gain", "dead_zone@input.width")
    assert model.values["motor.inertia"] == 1.0
    assert model.parameter("dead_zone@input.width").unit == "V"
    assert model.parameter("drive.gain").unit == "N·m/V"


def test_a_drive_with_a_loop_of_its_own_is_told_a_place_or_a_speed() -> None:
    for unit, gain in (("rad", "N·m/rad"), ("rad/s", "N·m/(rad/s)")):
        model = read(GOOD.replace("unit: V}", f"unit: {unit}}}"))
        assert model.parameter("drive.gain").unit == gain
        assert model.parameter("dead_zone@input.width").unit == unit


@pytest.mark.parametrize("name", preset_names())
def test_presets_survive_a_round_trip(name: str) -> None:
    model = load_model(name)
    again = read(model.to_yaml())
    assert again.parameters == model.parameters
    assert again.outputs == model.outputs
    assert again.controller == model.controller


@pytest.mark.slow
@given(
    value=st.floats(0.0, 1e6),
    error=st.none() | st.floats(0.0, 10.0),
    gain=st.floats(-1e9, 1e9, allow_subnormal=False),
)
def test_numbers_survive_a_round_trip_exactly(value: float, error: float | None, gain: float) -> None:
    model = read(GOOD).with_values(
        {"motor.viscous_friction": value, "drive.gain": gain},
        {} if error is None else {"motor.viscous_friction": error},
    )
    again = read(model.to_yaml())
    assert again.values == model.values
    assert again.parameter("motor.viscous_friction").stderr == error


@pytest.mark.parametrize("bounds", ["", ", min: 0.0", ", min: 0.2", ", max: 9.0", ", min: 0.2, max: 9.0"])
def test_bounds_are_written_as_they_were_stated(bounds: str) -> None:
    text = GOOD.replace("inertia: 1.0", f"inertia: {{value: 1.0{bounds}}}").replace(", min: 0.0}}", "}}")
    text = text.replace("value: 0.12", f"value: 0.12{bounds.replace('0.2', '0.05')}")
    fitted = read(text).with_values({"motor.inertia": 3.0, "motor.viscous_friction": 1.0}, {"motor.inertia": 0.1})
    written = yaml.safe_load(read(fitted.to_yaml()).to_yaml())
    stated = yaml.safe_load(f"{{value: 3.0{bounds}, stderr: 0.1}}")
    assert written["bodies"][0]["inertia"] == stated
    assert written["bodies"][0]["viscous_friction"] == {"value": 1.0}
    assert {**written["effects"][0]["width"], "value": 1.0} == yaml.safe_load(
        f"{{value: 1.0{bounds.replace('0.2', '0.05')}}}"
    )


WRONG = [
    ("schema: idloop/model/1", "schema: idloop/model/9", "schema: must be 'idloop/model/1'"),
    ("unit: V}", "unit: Volt}", "input.unit: unknown unit 'Volt'"),
    ("unit: rad/s}", "unit: rds}", "outputs[1].unit: unknown unit 'rds'"),
    ("unit: rad/s}", "unit: rad}", "outputs[1].unit: unknown unit 'rad' of a velocity (did you mean 'rad/s'?)"),
    ("unit: rad/s}", "unit: m/s}", "do not fit one axis"),
    ("inertia: 1.0", "inertia: -1.0", "motor.inertia: must be > 0 kg·m² (got -1)"),
    ("inertia: 1.0", "inertia: 0", "motor.inertia: must be > 0"),
    ("inertia: 1.0", "inertia: 1,5", "bodies[0][5]: 5 in the place of a key; the decimal separator is a point: 0.02"),
    ("inertia: 1.0", "inertia: heavy", "bodies[0].inertia: a number or a mapping"),
    ("inertia: 1.0", "inertia: .nan", "not a number"),
    ("inertia: 1.0", "inertia: {valeu: 1.0}", "unknown key 'valeu' (did you mean 'value'?)"),
    ("inertia: 1.0, ", "", "the key 'bodies[0].inertia' is missing"),
    ("viscous_friction: {value: 2.0, min: 0.0}", "viscuos_friction: 2.0", "did you mean 'viscous_friction'?"),
    ("viscous_friction: {value: 2.0, min: 0.0}", "viscous_friction: {value: 2.0, max: 1.0}", "value 2 is above max 1"),
    ("effect: dead_zone", "effect: dead_zoen", "effects[0]: unknown effect 'dead_zoen' (did you mean 'dead_zone'?)"),
    ("at: input", "at: inptu", "did you mean 'input'?"),
    ("at: input", "at: motor", "dead_zone does not act at the site kind 'body': it acts at input"),
    ("width: {value: 0.12}", "with: 0.12", "no parameter 'with' (did you mean 'width'?)"),
    ("width: {value: 0.12}", "width: -0.1", "dead_zone@input.width: -0.1 is outside 0"),
    ("joint: motor, field: position", "joint: rotor, field: position", "there is no body 'rotor'"),
    ("field: velocity", "field: speed", "outputs[1].field"),
    ("drive:", "driev:", "unknown key 'driev' (did you mean 'drive'?)"),
    ("couplings: []", "couplings: [{from: motor, to: load, stiffness: 1.0}]", "does not join neighbours"),
    ("name: dc_motor", "name: [", "not valid YAML"),
    ("name: dc_motor", "name: " + "n" * 10**6, "name: String should have at most 255 characters"),
    ("joint: motor, field: position", f"joint: {'j' * 10**6}, field: position", "outputs[0].joint: String should have"),
    ("topic: joint_states", f"topic: {'t' * 10**6}", "outputs[0].topic: String should have at most 255 characters"),
    ("effect: dead_zone", f"effect: {'e' * 10**6}", "effects[0].effect: String should have at most 255 characters"),
    ("couplings: []", "couplings: [" + "{from: a, to: b, stiffness: 1.0}, " * 101 + "]", "at most 100 items"),
    ("inertia: 1.0", "inertia: 0x" + "f" * 300, "a number of more than 250 digits"),
    ("controller: null", "controller: {type: p, output: motor.position, pk: 1.0}", "controller"),
]


@pytest.mark.parametrize(("old", "new", "message"), WRONG, ids=[row[2][:40] for row in WRONG])
def test_what_is_wrong_is_said_in_one_line_that_names_the_file(old: str, new: str, message: str) -> None:
    assert old in GOOD
    with pytest.raises(InputError) as caught:
        read(GOOD.replace(old, new, 1))
    line = str(caught.value)
    assert message in line
    assert line.startswith("m.yaml")
    assert "\n" not in line


def test_the_same_effect_twice_is_refused() -> None:
    with pytest.raises(InputError, match="dead_zone@input already"):
        read(GOOD).with_effect("dead_zone", "input")


def test_a_folder_is_no_model_and_the_one_in_it_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"is a folder$"):
        load_model(tmp_path)
    (tmp_path / "metadata.yaml").touch()
    with pytest.raises(InputError, match=r"is a folder; a recording comes after MODEL$"):
        load_model(tmp_path)
    (tmp_path / "model.yaml").touch()
    with pytest.raises(InputError, match=r"is a folder; its model is .*model\.yaml$"):
        load_model(tmp_path)


def test_a_missing_file_is_named_with_the_presets() -> None:
    with pytest.raises(InputError, match="presets are axis, dc_motor"):
        load_model(Path("nowhere.yaml"))


@given(width=st.floats(0.0, 1e3))
def test_effects_are_read_from_text(width: float) -> None:
    assert parse_effect(f"dead_zone@input(width={width!r})") == ("dead_zone", "input", {"width": width})


@pytest.mark.parametrize("text", ["dead_zone", "dead_zone@", "@input", "dead_zone@input(width)"])
def test_text_that_is_no_effect_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="write NAME@SITE"):
        parse_effect(text)


def test_a_value_that_is_no_number_is_named() -> None:
    with pytest.raises(InputError, match="width = a is no number"):
        parse_effect("dead_zone@input(width=a)")


def test_site_names_with_brackets_are_read() -> None:
    model = load_model("dc_motor").with_effects(["backlash@position[motor](gap=0.1)"])
    assert model.effect_names == ("backlash@position[motor]",)


def test_adding_and_removing_an_effect_leaves_the_model_as_it_was() -> None:
    model = load_model("dc_motor")
    assert model.with_effect("dead_zone", "input").without_effect("dead_zone@input").parameters == model.parameters


def test_joints_of_other_names_keep_bodies_effects_and_controller():
    model = load_model("axis").with_effects(["backlash@position[axis](gap=0.1)", "coulomb_friction@axis(level=0.2)"])
    renamed = with_joints(model, {"axis": "elbow_joint"})
    assert renamed.input.joint == "elbow_joint"
    assert renamed.output_names == ("elbow_joint.position", "elbow_joint.velocity")
    assert renamed.bodies == model.bodies
    assert renamed.effect_names == ("backlash@position[elbow_joint]", "coulomb_friction@axis")
    assert renamed.values["backlash@position[elbow_joint].gap"] == 0.1
    assert renamed.controller["output"] == "elbow_joint.position"
    assert with_joints(renamed, {"elbow_joint": "axis"}).to_yaml().replace(", body: axis", "") == model.to_yaml()
    with pytest.raises(InputError, match=r"no joint 'axs' in the model \(did you mean 'axis'"):
        with_joints(model, {"axs": "elbow"})
