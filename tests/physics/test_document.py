"""The page of effects is written from the effects."""

from pathlib import Path

from idloop.physics.document import page

DOCS = Path(__file__).parents[2] / "docs"


def test_the_page_of_effects_is_current() -> None:
    assert (DOCS / "effects.md").read_text(encoding="utf-8") == page()


def test_the_worked_example_of_an_own_effect_loses_the_sign_of_the_speed() -> None:
    import numpy as np

    from idloop.physics import load_model, simulate

    model = load_model(DOCS / "examples" / "own_effect" / "belt_drive.yaml")
    time = np.arange(0.0, 4.0, 0.02)
    command = np.sign(np.sin(2.0 * time))
    blind = simulate(model, time, command, time).output
    seeing = simulate(model.without_effect("sign_blind_sensor@velocity[pulley]"), time, command, time).output
    assert seeing.min() < -1.0
    np.testing.assert_array_equal(blind, np.abs(seeing))
