"""A user's own effect takes part in a diagnosis as those of the catalogue do."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from idloop.diagnosis import Ladder
from idloop.diagnosis.design.next_experiment import suggest_next
from idloop.diagnosis.design.suggest import Limits
from idloop.diagnosis.equivalence.equivalent_effects import find_equivalent_effects
from idloop.diagnosis.evidence.quantisation import quantised_outputs, resolution_limits
from idloop.diagnosis.identifiability import gate
from idloop.diagnosis.ladder import Step
from idloop.diagnosis.screening.proposals import proposals
from idloop.diagnosis.screening.score_test import Screened, Trace
from idloop.diagnosis.screening.typical_sizes import command_limit, dry_level
from idloop.estimation.likelihood.estimation_problem import EstimationProblem, prepare_estimation
from idloop.physics import Model, load_model
from idloop.physics.document import page

from .conftest import record_of

HEAD = "import math\n\nfrom idloop.physics import Effect, EffectParameter, hook\n\n\n@hook\ndef "
FILES = {
    # A constant at the input, in its own place of the chain.
    "leak": """command(value, velocity, sent, elapsed, state, parameters):
    return value + parameters[0]


EFFECT = Effect(
    "leak", "input", "The amplifier leaks.", (EffectParameter("size", "{input}"),), command=command, order=45,
    looks_like=("input_offset",), same_as=("load_torque",), by_hand={"load_torque": "measure the leak"},
)
""",
    # The same under another name, by the fact in the file above.
    "creep": """command(value, velocity, sent, elapsed, state, parameters):
    return value + parameters[0]


EFFECT = Effect(
    "creep", "input", "It creeps.", (EffectParameter("size", "{input}"),), command=command, order=48,
    same_as=("leak",),
)
""",
    # A limit that is soft.
    "soft_limit": """command(value, velocity, sent, elapsed, state, parameters):
    return parameters[0] * math.tanh(value / parameters[0]) if parameters[0] < math.inf else value


EFFECT = Effect(
    "soft_limit", "input", "It gives less and less.",
    (EffectParameter("most", "{input}", start=math.inf, neutral=math.inf, min=1e-3),),
    command=command, order=20, odd=True, everyday=True, command_limit="most",
    trials=lambda s: [[{"most": s.command_most}]],
)
""",
    # Dry friction and more.
    "tapered_friction": """friction(direction, speed, arriving, elapsed, state, parameters):
    return parameters[0] / (1.0 + parameters[1] * speed)


EFFECT = Effect(
    "tapered_friction", "body", "It rubs less at speed.",
    (EffectParameter("level", "{force}", min=0.0), EffectParameter("taper", "s/{position}", min=0.0)),
    friction=friction, contains={"coulomb_friction": {"level": "level"}},
)
""",
    # A weight that shows over a turn only.
    "weight": """force(position, velocity, inertia, elapsed, state, parameters):
    return -parameters[0] * math.sin(position)


EFFECT = Effect(
    "weight", "body", "It hangs.", (EffectParameter("moment", "{force}"),), force=force, needs_angle=True,
    whole_turn=True, suggest_order=1,
)
""",
    # A sensor that cuts off what is below a step.
    "cut_off": """reading(value, position, velocity, elapsed, state, parameters):
    return parameters[0] * math.floor(value / parameters[0]) if parameters[0] > 0.0 else value


EFFECT = Effect(
    "cut_off", "output", "It cuts off.", (EffectParameter("step", "{output}", min=0.0),), reading=reading,
    final=True, resolution="step",
)
""",
}


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Model:
    """The axis from a file with own effects beside it."""
    folder = tmp_path_factory.mktemp("own")
    (folder / "effects").mkdir()
    for name, text in FILES.items():
        (folder / "effects" / f"{name}.py").write_text(HEAD + text)
    path = folder / "axis.yaml"
    path.write_text(load_model("axis").to_yaml())
    return load_model(path, allow_effects=True)


@pytest.fixture(scope="module")
def estimation(plain: Model) -> EstimationProblem:
    """A record whose command has one size."""
    steps = np.random.default_rng(0).choice([-1.0, 1.0], size=40)
    return prepare_estimation(plain, [record_of(plain, 0, command=steps.repeat(40))], "prediction")


def groups(model: Model, *names: str) -> list[tuple[str, ...]]:
    return [one.names for one in find_equivalent_effects(model, names)]


def test_its_look_alikes_are_on_the_page_of_effects(plain: Model, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("IDLOOP_EFFECTS", str(plain.effect_folders[0]))
    (row,) = (line for line in page().splitlines() if line.startswith("| `leak` |"))
    assert row.endswith("| `input_offset` |")


def test_its_equivalent_effects_are_known(plain: Model) -> None:
    leak, offset, load = "leak@input", "input_offset@input", "load_torque@axis"
    assert groups(plain, leak, offset) == [(leak, offset)]
    (twins,) = find_equivalent_effects(plain, [leak, load])
    assert twins.checks == ("measure the leak",)
    assert groups(plain, "creep@input", leak, load) == [("creep@input", leak, load)]
    # Behind a dead zone neither is a constant force; between the two there is one only where it stands between.
    behind = plain.with_effects(["dead_zone@input(width=0.1)"])
    assert groups(behind, leak, load) == []
    assert groups(behind, "creep@input", leak) == [("creep@input", leak)]
    # It is one of the constants that friction that differs by direction is spelt with.
    (alike,) = groups(plain, "asymmetric_friction@axis")
    assert f"coulomb_friction@axis + {leak}" in alike


def test_effects_that_name_each_other_are_equivalent(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, other in (("hum", "buzz"), ("buzz", "hum")):
        (tmp_path / f"{name}.py").write_text(
            "from idloop.physics import Effect\n" + f'EFFECT = Effect("{name}", "body", "", (), same_as=("{other}",))\n'
        )
    monkeypatch.setenv("IDLOOP_EFFECTS", str(tmp_path))
    assert groups(load_model("axis"), "hum@axis", "buzz@axis") == [("hum@axis", "buzz@axis")]


def test_it_replaces_an_effect_that_it_contains(plain: Model) -> None:
    dry = plain.with_effects(["coulomb_friction@axis(level=0.02)"])
    (found,) = proposals(dry, ["tapered_friction"])
    assert found.replaces == "coulomb_friction@axis"
    fuller = plain.with_effects(["tapered_friction@axis(level=0.03,taper=0.1)", "soft_limit@input(most=2)"])
    assert proposals(fuller, ["coulomb_friction"]) == []
    assert dry_level(fuller, "axis") == 0.03
    assert command_limit(fuller) == 2.0


def test_the_identifiability_check_uses_its_facts(plain: Model, estimation: EstimationProblem) -> None:
    trace = Trace([{"most": 1.0}], 0.0, np.zeros(1), 1e6, 1.0, np.zeros((1, 0)), np.zeros(0), 1e6, typical=1e6)
    (limit,) = (Screened(one, [trace]) for one in proposals(plain, ["soft_limit"]))
    one_size = gate(plain, estimation, [limit], 9.0)
    assert one_size.testable == {"soft_limit@input": "no"}
    assert one_size.poor
    several = prepare_estimation(plain, [record_of(plain, 0, seconds=4.0)], "prediction")
    assert gate(plain, several, [limit], 9.0).testable == {"soft_limit@input": "weak"}
    hung = replace(trace, trials=[{"moment": 0.01}])
    (weight,) = (Screened(one, [hung]) for one in proposals(plain, ["weight"]))
    still = replace(estimation, data=[replace(d, output=0.01 * d.output) for d in estimation.data])
    assert gate(plain, still, [weight], 9.0).testable == {"weight@axis": "weak"}


def test_its_step_is_read_off_the_data(plain: Model) -> None:
    only = replace(plain, outputs=plain.outputs[:1])
    record = record_of(only.with_effects(["cut_off@position[axis](step=0.02)"]), 1, seconds=4.0)
    found = prepare_estimation(only, [record], "prediction")
    assert proposals(only, ["cut_off"]) == []
    assert "cut_off@position[axis]" in resolution_limits(only, found)
    (candidate,) = quantised_outputs(only, found, ["cut_off"])
    assert candidate.name == "cut_off@position[axis]"
    assert candidate.parameters["step"]["value"] == pytest.approx(0.02, rel=1e-3)
    assert quantised_outputs(candidate.model, found) == []


def test_the_next_experiment_is_for_it_in_its_turn(plain: Model) -> None:
    record = record_of(plain, 2, seconds=4.0)
    low, high = np.min(record.output[:, 0]), np.max(record.output[:, 0])
    small = replace(record, output=record.output * [2.0 / (high - low), 1.0])
    ladder = Ladder((Step(None, plain),), untestable=("input_offset@input", "cut_off@velocity[axis]", "leak@input"))
    found = suggest_next(ladder, [small], Limits(position=(-8.0, 8.0)), duration=2.0)
    assert found is not None
    assert found.text.startswith(
        "this data cannot show weight@axis, input_offset@input, imbalance@axis and leak@input;"
    )
