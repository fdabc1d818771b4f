"""What a report is made of: unseen data first, characteristics of what was added, sines where they were stepped."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from idloop.diagnosis import Candidate, Ladder, Step
from idloop.diagnosis.design.experiment import Experiment
from idloop.diagnosis.model_errors import model_errors
from idloop.physics import load_model
from idloop.reporting.figures.curves import describing_figures
from idloop.reporting.page.contents import driven_step, gather, labelled_models, noise_floor
from idloop.reporting.page.page import page_words
from idloop.reporting.page.page_figures import page_figures, paper_figures
from idloop.reporting.terms import FITTED, UNSEEN


def test_unseen_data_come_first_and_every_record_is_held_against_both_ends_of_the_ladder(contents):
    assert [one.use for one in contents.judged] == [UNSEEN, FITTED]
    for one in contents.judged:
        assert [label for label, _ in one.rows] == ["start", "1 effect"]
        start, end = (comparison for _, comparison in one.rows)
        assert end.nrmse["motor.velocity"] < 0.2 * start.nrmse["motor.velocity"]
    assert contents.judged[0].title == "unseen data: unseen"


def test_the_numbers_are_those_of_the_ladder(contents):
    (_, start), (_, end) = contents.judged[0].rows
    first, last = contents.ladder.steps
    assert start.nrmse == pytest.approx(first.validation["nrmse"])
    assert end.nrmse == pytest.approx(last.validation["nrmse"])
    assert end.force.relative == pytest.approx(last.validation["force"])


def test_every_added_effect_has_its_characteristic(contents):
    one = contents.characteristics["coulomb_friction@motor"]
    assert one.variable == "velocity"
    np.testing.assert_allclose(np.abs(one.curve_y), 3.0)


def test_an_effect_is_drawn_on_what_the_last_model_leaves_without_it(story):
    """At its own step friction was still blurred by an offset; the last model has both."""
    start, name = story["ladder"].steps[0].model, "coulomb_friction@motor"
    true = start.with_effects([f"{name}(level=3)", "input_offset@input(offset=0.3)"])
    record = story["recorded"](true, 12.0, 5, "both")
    first, last = start.with_effects([f"{name}(level=2)"]), true
    steps = [Step(None, start)]
    for effect, at, model in (("coulomb_friction", "motor", first), ("input_offset", "input", last)):
        steps.append(Step(Candidate(effect, at, "yes", "", "", model=model), model))
    one = gather(Ladder(tuple(steps), "adequate"), [record], []).characteristics[name]
    np.testing.assert_allclose(np.abs(one.curve_y), 3.0)
    outer = np.abs(one.centre) > 1.0
    np.testing.assert_allclose(one.mean[outer], 3.0 * np.sign(one.centre[outer]), atol=0.3)


@pytest.fixture(scope="module")
def hidden_motion(story):
    """A ladder whose last step has a motion that is not measured: the force cannot be told any more."""
    name = "coulomb_friction@motor"
    friction = story["ladder"].model
    last = friction.with_effects(["compliance@motor(stiffness=40000,damping=5,split=0.5)"])
    assert set(last.effect_names) == {name, "compliance@motor"}
    added = Candidate("compliance", "motor", "yes", "", "It gives.", model=last, explains=0.01)
    records = [story["train"]], [story["unseen"]]
    step = Step(
        added, last, ("compliance@motor",), 2e-3, train=model_errors(last, records[0]),
        validation=model_errors(last, records[1]),
    )  # fmt: skip
    assert step.validation["force"] is None
    return gather(Ladder((*story["ladder"].steps, step), "adequate"), *records)


@pytest.mark.slow
def test_the_force_is_shown_up_to_the_last_step_that_tells_it(hidden_motion):
    assert driven_step(hidden_motion.ladder) == 1
    for one in hidden_motion.judged:
        assert [label for label, _ in one.rows] == ["start", "2 effects"]
        assert [label for label, _ in one.force_rows] == ["start", "1 effect"]
    drawn = page_figures(hidden_motion)
    said = [item.label.value for item in drawn["force-0"][0].legend[0].items]
    assert [text.partition(" (")[0] for text in said] == ["applied", "needed by start", "needed by 1 effect"]
    (over,) = drawn["where-drive force-velocity"]
    assert len(over.legend[0].items) == 2
    words = page_words(hidden_motion)
    tile = words["changes"][0]
    assert (tile["name"], tile["data"]) == ("error of the drive force", "unseen data, up to step 1")
    assert tile["trend"] == "better"
    assert words["no_force"].startswith("–: for a model with compliance @ motor, the measurements do not determine")
    where = {one["name"]: one for one in words["where"]}
    assert (where["drive force"]["end"], where["motor.position"]["end"]) == ("1 effect", "end of the ladder")
    assert where["drive force"]["after"]


@pytest.mark.slow
def test_the_figures_for_a_paper_show_the_force_up_to_the_same_step(hidden_motion):
    axes = paper_figures(hidden_motion)["where_1_unseen"].axes
    legends = [one.get_legend() for one in axes if one.get_legend() is not None]
    named = [[text.get_text().partition(" (")[0] for text in one.get_texts()][1:] for one in legends]
    outputs = ["error of start", "error of 2 effects"]
    assert named == [["error of start", "error of 1 effect"], outputs, outputs]


def test_an_effect_that_the_last_model_does_not_show_is_drawn_with_an_earlier_one(hidden_motion):
    assert hidden_motion.drawn_at == {"coulomb_friction@motor": 1}
    assert hidden_motion.characteristics["coulomb_friction@motor"].variable == "velocity"
    friction, compliance = page_words(hidden_motion)["steps"]
    assert friction["drawn"] == "Drawn with the model of step 1: the last one does not show it."
    assert compliance["drawn"] == ""
    assert compliance["place"] not in page_figures(hidden_motion)


def test_a_first_step_without_a_force_is_said_as_well(hidden_motion):
    first, _, last = hidden_motion.ladder.steps
    words = page_words(gather(Ladder((first, last), "adequate"), [hidden_motion.judged[1].record], []))
    assert driven_step(Ladder((first, last), "adequate")) is None
    assert "compliance @ motor" in words["no_force"]
    assert [row["name"] for row in words["changes"]] == ["FIT motor.position", "FIT motor.velocity"]


def test_a_ladder_that_tells_the_force_to_its_end_says_nothing_about_it(contents):
    assert driven_step(contents.ladder) is None
    assert page_words(contents)["no_force"] == ""
    assert contents.drawn_at == {}
    assert contents.judged[0].force_rows == contents.judged[0].rows


def test_noise_is_a_floor_where_the_model_states_it(contents, story):
    spread = np.std(story["unseen"].output[:, 1])
    assert contents.floor["motor.velocity"] == pytest.approx(5e-3 / spread)
    silent = load_model("dc_motor")
    silent = replace(silent, outputs=tuple(replace(o, noise=None) for o in silent.outputs))
    assert noise_floor(silent, [story["unseen"]]) == {}


def test_a_ladder_without_a_step_has_one_model(contents):
    alone = replace(contents.ladder, steps=contents.ladder.steps[:1])
    assert [label for label, _ in labelled_models(alone)] == ["start"]


def test_stepped_sines_give_describing_functions():
    model = load_model("dc_motor")
    records = []
    for amplitude in (0.5, 1.0, 2.0):
        signal = {
            "name": "stepped_sine", "sample_time": 0.005, "amplitude": amplitude, "frequencies": [1.0], "periods": 6,
            "settle_periods": 3,
        }  # fmt: skip
        records.append(Experiment(signal).run(model, noise=True, seed=1, name=f"sines {amplitude}"))
    found = gather(Ladder((Step(None, model),), verdict="adequate"), records, [])
    assert [one.target for one in found.describing] == list(records[0].output_names)
    size, phase, distortion = describing_figures(found.describing[1])
    assert size.yaxis[0].axis_label.startswith("size of N [")
    assert phase.yaxis[0].axis_label == "phase of N [°]"
    assert distortion.xaxis[0].axis_label == "amplitude [V]"
    drawn = size.renderers[1].data_source.data
    assert len(drawn["x"]) == 3
    # Linear: the gain is the same at every amplitude.
    np.testing.assert_allclose(drawn["size"], np.mean(drawn["size"]), rtol=0.05)
    assert {"describing-0", "describing-1"} <= set(page_figures(found))


def test_other_signals_are_no_sines(contents):
    assert contents.describing == ()


def test_the_figures_to_take_along_are_all_of_the_page(contents):
    """Characteristics, frequency responses and residual tests as well; each names its axes."""
    figures = paper_figures(contents)
    outputs = contents.ladder.model.output_names
    wanted = {f"{kind}_{name}" for kind in ("frequency", "residual") for name in outputs}
    wanted |= {f"effect_{name}" for name in contents.characteristics}
    assert wanted <= figures.keys()
    assert contents.characteristics
    for stem in wanted:
        assert all(axes.get_ylabel() for axes in figures[stem].axes)
        assert figures[stem].axes[0].get_title(loc="left")
