"""Friction that depends on a temperature and a drive that depends on the supply, where these are recorded."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.diagnosis.warming import Machine, record_of

from idloop.diagnosis import Diagnosis, diagnose
from idloop.diagnosis.screening.proposals import proposals
from idloop.errors import InputError
from idloop.estimation import fit
from idloop.physics import Model, load_model
from idloop.validation import compare

SECONDS = 20.0
# What the machine hides, the channel that tells it, the effect and its coefficient.
HIDDEN = (
    (Machine(viscous_slope=-0.0006), "temperature", "thermal_viscosity@axis", "coefficient", -0.0006),
    (Machine(dry_slope=-0.0015), "temperature", "thermal_dry_friction@axis", "slope", -0.0015),
    (Machine(share=1.0), "supply", "supply_sag@input", "share", 1.0),
)


@pytest.fixture(scope="module")
def dry() -> Model:
    """The axis with dry friction, off from the machine's."""
    return load_model("axis").with_effect("coulomb_friction", "axis", level=0.1)


def named(found: Diagnosis) -> list[str]:
    return [one.name for one in found.candidates[:1]] if found.verdict == "missing" else []


@pytest.mark.slow
@pytest.mark.parametrize(("machine", "channel", "name", "parameter", "truth"), HIDDEN, ids=lambda one: str(one)[:24])
@pytest.mark.parametrize("criterion", ["force", "prediction", "simulation"])
def test_it_is_named_with_its_coefficient(
    dry: Model, criterion: str, machine: Machine, channel: str, name: str, parameter: str, truth: float
) -> None:
    found = diagnose(dry, [record_of(machine, 1, SECONDS, of=(channel,))], criterion=criterion)
    assert named(found) == [name]
    value = found.candidates[0].parameters[parameter]
    assert abs(value["value"] - truth) < 3.3 * value["stderr"]
    assert value["stderr"] < 0.02 * abs(truth)


@pytest.mark.slow
@pytest.mark.parametrize("machine", [Machine(), Machine(dry=0.0)], ids=["dry", "smooth"])
def test_where_friction_and_drive_are_steady_nothing_is_named(dry: Model, machine: Machine) -> None:
    model = dry if machine.dry else load_model("axis")
    records = [record_of(machine, seed, SECONDS, of=("temperature", "supply")) for seed in range(3)]
    assert [named(diagnose(model, [one], criterion="force")) for one in records] == [[], [], []]


def test_without_the_channel_the_effect_is_no_candidate(dry: Model) -> None:
    record = record_of(HIDDEN[0][0], 2, SECONDS)
    bare = replace(record, conditions=())
    found = diagnose(dry, [bare, record], criterion="force")  # only where all records have it
    evaluated = {one.name.partition("@")[0] for one in found.candidates} | {
        n.partition("@")[0] for n in found.untestable
    }
    assert not evaluated & {"thermal_viscosity", "thermal_dry_friction", "supply_sag"}
    with pytest.raises(InputError, match="depends on the condition 'temperature' in °C, which not all records hold"):
        diagnose(dry, [bare], effects=["thermal_viscosity"])


def test_a_channel_of_one_site_serves_that_site(dry: Model) -> None:
    torsion = load_model("torsion")
    bodies = torsion.bodies
    own = {f"{bodies[1]}.temperature": "°C"}
    thermal = [one.at for one in proposals(torsion, ["thermal_viscosity"], own)]
    assert thermal == [bodies[1]]
    assert [one.at for one in proposals(torsion, ["thermal_viscosity"], {"temperature": "°C"})] == list(bodies)
    assert proposals(dry, None, {"temperature": "K"}) == proposals(dry)


@pytest.mark.slow
def test_fit_and_comparison_take_the_channel() -> None:
    machine, _, _, _, truth = HIDDEN[0]
    record, unseen = (record_of(machine, seed, SECONDS) for seed in (3, 4))
    model = load_model("axis").with_effect("coulomb_friction", "axis", level=0.1)
    warm = model.with_effect("thermal_viscosity", "axis", coefficient=-1e-4, reference=20.0)
    for method in ("prediction", "simulation"):
        fitted = fit(warm, [record], criterion=method).model
        assert fitted.values["thermal_viscosity@axis.coefficient"] == pytest.approx(truth, rel=0.01)
        assert fitted.values["thermal_viscosity@axis.reference"] == 20.0
        assert fitted.values["axis.viscous_friction"] == pytest.approx(0.05, rel=0.01)
    plain = fit(model, [record], criterion="simulation").model
    with_it, without = (compare(one, unseen).nrmse["axis.velocity"] for one in (fitted, plain))
    assert with_it < 0.1 * without
    assert np.isfinite(with_it)
