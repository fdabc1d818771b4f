"""The page of effects is written from the effects."""

import re
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from idloop.physics import load_model
from idloop.physics.document import PLACES, page
from idloop.physics.effect import Effect, built_in
from idloop.reporting.page.equations import equations, to_mathml

DOCS = Path(__file__).parents[2] / "docs"


def test_the_page_of_effects_is_current() -> None:
    assert (DOCS / "effects.md").read_text(encoding="utf-8") == page()


def test_the_worked_example_of_an_own_effect_loses_the_sign_of_the_speed() -> None:
    import numpy as np

    from idloop.physics import simulate

    model = load_model(DOCS / "examples" / "own_effect" / "belt_drive.yaml", allow_effects=True)
    time = np.arange(0.0, 4.0, 0.02)
    command = np.sign(np.sin(2.0 * time))
    blind = simulate(model, time, command, time).output
    seeing = simulate(model.without_effect("sign_blind_sensor@velocity[pulley]"), time, command, time).output
    assert seeing.min() < -1.0
    np.testing.assert_array_equal(blind, np.abs(seeing))


@pytest.mark.parametrize(
    "effect", [one for several in built_in().values() for one in several], ids=lambda one: f"{one.name}@{one.site}"
)
def test_every_effect_has_an_equation_that_names_its_parameters(effect: Effect) -> None:
    assert effect.equation is not None
    symbols = effect.equation.symbols
    assert list(symbols) == [spec.name for spec in effect.parameters]
    assert len(set(symbols.values())) == len(symbols)
    for symbol in symbols.values():
        assert symbol in effect.equation.term + effect.equation.text
    at = page().index(f"### Equations at {PLACES[effect.site]}\n")
    written = page()[page().index(f"\n`{effect.name}`\n\n```math\n", at) :].split("\n\n")
    assert written[1].count("\n") == 2
    for name in symbols:
        assert f"is `{name}`" in written[2]


def test_github_reads_the_equations() -> None:
    blocks = re.findall(r"```math\n(.*?)\n```", page(), re.DOTALL)
    assert len(blocks) == sum(len(several) for several in built_in().values())
    for latex in blocks + re.findall(r"\$`(.*?)`\$", page()):
        assert "@" not in latex
        assert "operatorname" not in latex
        ET.fromstring(to_mathml(latex, block=True))


@pytest.mark.parametrize("given", [True, False])
def test_an_own_effect_is_on_the_page_with_its_equation_if_it_gives_one(given, tmp_path, monkeypatch) -> None:
    text = (DOCS / "examples" / "own_effect" / "effects" / "sign_blind_sensor.py").read_text(encoding="utf-8")
    lines = [line for line in text.splitlines(keepends=True) if given or "equation=" not in line]
    (tmp_path / "sign_blind_sensor.py").write_text("".join(lines), encoding="utf-8")
    monkeypatch.setenv("IDLOOP_EFFECTS", str(tmp_path))
    assert "| `sign_blind_sensor` |" in page()
    assert (r"y_b = \left|y\right|" in page()) == given


def test_the_report_shows_the_equation_of_an_own_effect() -> None:
    lines, _ = equations(load_model(DOCS / "examples" / "own_effect" / "belt_drive.yaml", allow_effects=True))
    assert any(line.latex.startswith(r"y_b = \left|\omega") for line in lines)
