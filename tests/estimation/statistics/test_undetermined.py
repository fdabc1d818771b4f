"""Parameters of which the motion determines only a combination."""

import json

import numpy as np
import pytest

from idloop.diagnosis import diagnose, refine
from idloop.estimation import fit
from idloop.estimation.dataset import prepare
from idloop.estimation.optimisation.caching_engine import CachingEngine
from idloop.estimation.statistics.undetermined import (
    common_factor,
    common_scale,
    effect_scales,
    exactly_tied,
    standard_errors,
)
from idloop.physics import Model, load_model
from idloop.physics.simulation import simulate
from idloop.records import Record
from idloop.validation import compare

BASE = ("axis.inertia", "axis.viscous_friction", "drive.gain")
# True ratios of the preset to its inertia of 0.01 kg·m².
FRICTION, GAIN = 5.0, 100.0


def moved(model: Model, seconds: float = 8.0, seed: int = 0) -> Record:
    """Random steps of the command, measured with the sensors' noise."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, seconds, 0.005)
    command = rng.normal(size=int(4 * seconds) + 1)[(4.0 * time).astype(int)]
    noise = np.column_stack([rng.normal(size=len(time)) * float(o.noise or 0.0) for o in model.outputs])
    output = simulate(model, time, command, time, noise=noise).output
    names, units = tuple(o.name for o in model.outputs), tuple(o.unit for o in model.outputs)
    return Record("run", time, command, time, output, model.input.name, model.input.unit, names, units)


@pytest.fixture(scope="module")
def record() -> Record:
    return moved(load_model("axis"))


@pytest.fixture(scope="module")
def unknown() -> Model:
    """Nothing of the drive is known, and everything is guessed too small."""
    return load_model("axis").with_values(dict(zip(BASE, (0.004, 0.06, 0.5), strict=True))).with_free(BASE)


@pytest.mark.parametrize("criterion", ["auto", "prediction", "simulation", "force"])
def test_only_ratios_of_free_forces_are_determined(unknown: Model, record: Record, criterion: str) -> None:
    found = fit(unknown, [record], criterion)
    assert found.names == BASE
    assert np.all(np.isnan(found.stderr))
    assert found.values[0] == unknown.values["axis.inertia"]
    assert all(found.model.parameter(name).free and found.model.parameter(name).stderr is None for name in BASE)
    friction, gain = found.ratios
    assert abs(friction.value - FRICTION) < 4.0 * friction.stderr
    assert abs(gain.value - GAIN) < 4.0 * gain.stderr
    assert gain.stderr < 0.02 * GAIN
    (warning,) = (text for text in found.warnings if "ratios" in text)
    assert all(name in warning for name in BASE)
    assert "fix one" in warning


def test_a_fit_of_ratios_is_that_with_the_inertia_known(unknown: Model, record: Record) -> None:
    known = fit(unknown.with_free(BASE[1:]), [record])
    found = fit(unknown, [record])
    assert (found.criterion, found.why) == (known.criterion, known.why)
    assert [ratio.value * found.values[0] for ratio in found.ratios] == pytest.approx(known.values)
    assert [ratio.stderr * found.values[0] for ratio in found.ratios] == pytest.approx(known.stderr)


def test_ratios_are_printed_and_given_as_json(unknown: Model, record: Record) -> None:
    found = fit(unknown, [record])
    document = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    low, high = document["ratios"]["drive.gain / axis.inertia"]["interval"]
    assert low < document["ratios"]["drive.gain / axis.inertia"]["value"] < high
    assert all(document["parameters"][name]["interval"] == [None, None] for name in BASE)
    assert "drive.gain / axis.inertia" in found.summary()
    assert found.summary().count("not determined") == 3


@pytest.mark.parametrize("known", [*BASE, "load_torque@axis.torque"])
def test_one_known_force_sets_the_scale(unknown: Model, record: Record, known: str) -> None:
    model = unknown.with_effect("load_torque", "axis", torque=0.1)
    assert common_scale(CachingEngine(model), prepare(model, [record])) is not None
    model = model.with_free(name for name in model.free if name != known)
    assert common_scale(CachingEngine(model), prepare(model, [record])) is None


def test_parameters_that_are_no_forces_are_not_scaled(unknown: Model, record: Record) -> None:
    model = unknown.with_effect("dead_zone", "input", width=0.1).with_effect("coulomb_friction", "axis", level=0.02)
    found = common_scale(CachingEngine(model), prepare(model, [record]))
    assert found is not None
    assert set(found.names) == {*BASE, "coulomb_friction@axis.level"}


@pytest.mark.parametrize("criterion", ["simulation", "force"])
def test_one_of_two_effects_with_the_same_equation_is_held(record: Record, criterion: str) -> None:
    found = fit(_one_equation_twice(), [record], criterion)
    errors = dict(zip(found.names, found.stderr, strict=True))
    assert np.isnan(errors["input_offset@input.offset"])
    assert np.isnan(errors["load_torque@axis.torque"])
    assert found.model.values["load_torque@axis.torque"] == 0.02
    assert any("input_offset@input.offset" in text and "held" in text for text in found.warnings)
    for name, true in (("axis.inertia", 0.01), ("axis.viscous_friction", 0.05)):
        assert abs(found.model.values[name] - true) < 4.0 * errors[name]


def test_a_constant_force_is_determined_beside_a_random_walk() -> None:
    free = load_model("axis").with_effect("input_offset", "input", offset=0.01)
    drifting = moved(load_model("axis").with_effect("load_torque", "axis", torque=0.05), seconds=4.0)
    found = fit(free, [drifting])
    offset = found.names.index("input_offset@input.offset")
    assert abs(found.values[offset] - 0.05) < 4.0 * found.stderr[offset]
    assert compare(found.model, drifting).fit["axis.position"] > 99.0


def _one_equation_twice() -> Model:
    model = load_model("axis").with_effect("input_offset", "input", offset=0.01)
    return model.with_effect("load_torque", "axis", torque=0.02)


def test_a_diagnosis_reports_that_only_ratios_are_determined(unknown: Model, record: Record) -> None:
    effects = ["coulomb_friction", "dead_zone"]
    found = diagnose(unknown, [record], effects=effects)
    ladder = refine(unknown, [record], effects=effects)
    assert any("only the ratios" in line for line in found.gate.findings)
    assert any("only the ratios" in line for line in ladder.to_dict()["findings"])
    assert ladder.model.values["axis.inertia"] == unknown.values["axis.inertia"]
    assert found.verdict == ladder.verdict != "missing"


LIMIT = "speed_limit_voltage@input"


def test_only_ratios_of_a_supply_without_its_resistance_are_determined() -> None:
    cut = load_model("axis").with_effect("speed_limit_voltage", "input", supply=1.0, back_emf=0.1)
    cut = cut.with_free(name for name in cut.free if name != f"{LIMIT}.resistance")
    record = moved(cut)
    (scale,) = effect_scales(cut, [record])
    assert scale.names == (f"{LIMIT}.supply", f"{LIMIT}.back_emf", f"{LIMIT}.resistance")
    assert f"only the ratios of {LIMIT}.supply" in scale.text
    assert f"{LIMIT}.resistance from the data sheet; here it is held at 1 Ω" in scale.text
    assert scale.text.count("\n") == 0
    # A resistance from the data sheet, and one that nothing depends on.
    assert effect_scales(cut.with_values({f"{LIMIT}.resistance": 1.2}), [record]) == []
    assert effect_scales(cut.with_values({f"{LIMIT}.supply": 1e6}), [record]) == []


def test_a_held_parameter_without_a_ratio_is_not_reported_as_one() -> None:
    name = "presliding_friction@axis"
    model = load_model("axis").with_effect("presliding_friction", "axis", level=0.05, stiffness=50.0)
    model = model.with_free(free for free in model.free if free != f"{name}.velocity")
    assert effect_scales(model, [moved(model, 2.0)]) == []


def _friction_and_gain(relative: list[list[float]]) -> tuple[Model, np.ndarray]:
    """A model of which friction and gain are estimated, and their covariance as parts of the values."""
    model = load_model("axis").with_free(BASE[1:])
    return model, np.array(relative) * np.outer(model.theta, model.theta)


def test_a_factor_that_hardly_shows_leaves_the_ratios() -> None:
    model, covariance = _friction_and_gain([[4.0, 4.0], [4.0, 4.0001]])
    found = common_factor(model, covariance)
    assert found is not None
    assert (found.names, found.held, found.ratios, found.exact) == (BASE[1:], "drive.gain", True, False)
    errors = standard_errors(model, covariance)
    assert errors["drive.gain"] is None
    # Beside a gain that is held, what is left of the friction's uncertainty.
    assert errors["axis.viscous_friction"] == pytest.approx(0.01 * model.values["axis.viscous_friction"], rel=0.01)


@pytest.mark.parametrize(
    "relative",
    [
        pytest.param([[0.01, 0.01], [0.01, 0.0101]], id="certain enough"),
        pytest.param([[4.0, 0.0], [0.0, 0.01]], id="one of them alone"),
        pytest.param([[4.0, -3.9], [-3.9, 4.0]], id="a common product"),
    ],
)
def test_other_uncertainties_are_no_common_factor(relative: list[list[float]]) -> None:
    model, covariance = _friction_and_gain(relative)
    assert common_factor(model, covariance) is None
    deviations = np.sqrt(np.diag(covariance))
    assert list(standard_errors(model, covariance).values()) == pytest.approx(list(deviations))


@pytest.mark.parametrize(("second", "shared"), [(-1.0, True), (1.0, False)])
def test_exactly_tied_parameters_that_share_a_factor_leave_their_ratio(second: float, shared: bool) -> None:
    """Where the search ran away along it, the inertia no longer shows, and the covariance is that of rounding."""
    model = load_model("axis").with_free(BASE[1:])
    values = 1e6 * model.theta
    errors = np.random.default_rng(0).normal(size=200)
    jacobian = np.column_stack([errors, second * errors]) / values
    found = exactly_tied(model, jacobian, values)
    assert found is not None
    assert (found.held, found.value) == ("drive.gain", model.values["drive.gain"])
    assert (found.ratios, found.exact) == (shared, not shared)


def test_slow_motion_determines_ratios_of_forces_only() -> None:
    """The inertia is known and does not show; friction over gain does."""
    true = load_model("axis")
    time = np.arange(0.0, 400.0, 0.2)
    command = 0.02 * np.sin(0.03 * time)
    noise = 2.0 * np.random.default_rng(3).normal(size=(len(time), len(true.outputs)))
    output = simulate(true, time, command, time, noise=noise).output
    names, units = tuple(o.name for o in true.outputs), tuple(o.unit for o in true.outputs)
    slow = Record("slow", time, command, time, output, true.input.name, true.input.unit, names, units)
    found = fit(true.with_free(BASE[1:]), [slow], "prediction")
    (ratio,) = found.ratios
    assert ratio.name == "axis.viscous_friction / drive.gain"
    assert abs(ratio.value - FRICTION / GAIN) < 4.0 * ratio.stderr
    assert ratio.stderr < 0.1 * ratio.value
    assert np.all(np.isnan(found.stderr))
    (warning,) = (text for text in found.warnings if "ratios" in text)
    assert "hardly more than" in warning
