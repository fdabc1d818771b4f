"""What a report is made of: unseen data first, characteristics of what was added, sines where they were stepped."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from idloop.diagnose import Candidate, Ladder, Step
from idloop.diagnose.experiment import Experiment
from idloop.physics import load_model
from idloop.report.contents import gather, labelled_models, noise_floor
from idloop.report.figures.describing import describing_figures
from idloop.report.page_figures import page_figures
from idloop.report.use import FITTED, UNSEEN


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
