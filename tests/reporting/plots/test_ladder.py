"""The ladder figure: errors by step, the noise floor, names with ties in brackets, the unknown curve."""

from __future__ import annotations

import numpy as np
import pytest

from idloop import drawing
from idloop.diagnosis import Candidate, Ladder, Step, UnknownStructure
from idloop.p_values import p_text
from idloop.physics import load_model
from idloop.reporting.plots.diagnosis import plot_ladder, plot_unknown, step_label

MODEL = load_model("dc_motor")
UNKNOWN = UnknownStructure(
    "motor.velocity", "rad/s", "N·m", np.linspace(-2, 2, 9), np.linspace(-1, 1, 9) ** 3, np.full(9, 0.1), 0.4, "a curve"
)


def measures(error: float, force: float | None = 0.1) -> dict:
    return {"nrmse": {"motor.position": error, "motor.velocity": 2 * error}, "force": force}


def step(name: str = "", error: float = 0.1, force: float | None = 0.1, **changes) -> Step:
    candidate = None
    if name:
        effect, _, at = name.partition("@")
        candidate = Candidate(effect, at, "yes", "", "Some physics.")
    given = {"train": measures(error, force), "validation": measures(1.2 * error, force), "set": (name,), **changes}
    return Step(candidate, MODEL, **given)


def ladder(**changes) -> Ladder:
    steps = (
        step(error=0.3, force=0.2),
        step("dead_zone@input", 0.05, 0.04, p_value=1e-4, set=("dead_zone@input", "coulomb_friction@motor")),
    )
    return Ladder(steps, **{"verdict": "adequate", **changes})


def test_the_errors_of_every_step_are_drawn_by_output_for_train_and_validation():
    axes = plot_ladder(ladder(), {"motor.position": 0.01}).axes[0]
    lines = {line.get_label(): line for line in axes.lines}
    assert set(lines) == {
        "motor.position, fitted data",
        "motor.position, unseen data",
        "motor.position, noise floor",
        "motor.velocity, fitted data",
        "motor.velocity, unseen data",
    }
    np.testing.assert_allclose(lines["motor.position, unseen data"].get_ydata(), [0.36, 0.06])
    assert set(lines["motor.position, noise floor"].get_ydata()) == {0.01}
    assert axes.get_ylabel() == "NRMSE of the free run [-]"
    assert axes.get_yscale() == "log"


def test_the_force_error_has_its_own_row_where_it_is_known():
    figure = plot_ladder(ladder())
    assert [axes.get_ylabel() for axes in figure.axes] == ["NRMSE of the free run [-]", "force error [%]"]
    np.testing.assert_allclose(figure.axes[1].lines[0].get_ydata(), [20.0, 4.0])
    by_force = plot_ladder(ladder(criterion="force"))
    assert [axes.get_ylabel() for axes in by_force.axes] == ["force error [%]", "NRMSE of the free run [-]"]
    assert [text.get_text() for text in by_force.axes[0].texts] == ["20 %", "4 %"]
    without = Ladder((step(force=None), step("dead_zone@input", force=None)), verdict="adequate")
    assert len(plot_ladder(without).axes) == 1


def test_a_step_stands_below_itself_where_the_error_of_the_force_ends_before_the_ladder():
    steps = (*ladder().steps, step("compliance@motor", 0.04, None))
    errors, force = plot_ladder(Ladder(steps, "adequate")).axes
    assert errors.get_xlim() == force.get_xlim()
    assert force.get_xlim()[1] > 2.0


def test_steps_are_named_with_evidence_and_ties_in_brackets():
    figure = plot_ladder(ladder())
    labels = [text.get_text() for text in figure.axes[-1].get_xticklabels()]
    assert labels == ["start", "+ dead zone\n@ input\np < 0.001\n[or Coulomb friction @ motor]"]
    assert step_label(step("dead_zone@input", chosen_by="user"), ladder()).endswith("chosen by the user")
    assert p_text(0.0321) == "p = 0.032"


def test_the_title_says_how_it_ended():
    assert plot_ladder(ladder()).axes[0].get_title(loc="left") == "dc_motor: nothing significant is left"
    stopped = plot_ladder(ladder(verdict="missing")).axes[0].get_title(loc="left")
    assert "stopped" in stopped


def test_the_unknown_curve_has_its_band_and_units():
    for axes in (plot_ladder(ladder(unknown=UNKNOWN)).axes[-1], plot_unknown(UNKNOWN).axes[0]):
        assert axes.get_xlabel() == "motor.velocity [rad/s]"
        assert axes.get_ylabel() == "remaining force [N·m]"
        (band,) = axes.collections
        reach = band.get_paths()[0].vertices
        assert np.max(reach[:, 1]) == pytest.approx(1.1)


def test_training_alone_is_called_by_the_name_of_the_output():
    alone = Ladder((step(validation={}),), verdict="adequate")
    assert [line.get_label() for line in plot_ladder(alone).axes[0].lines] == ["motor.position", "motor.velocity"]


def test_equal_figures_are_equal_files(tmp_path):
    files = [drawing.save(plot_ladder(ladder(unknown=UNKNOWN)), tmp_path / f"{name}.png") for name in "ab"]
    assert files[0].read_bytes() == files[1].read_bytes()
    assert files[0].stat().st_size > 10_000
