"""The noise of the model file is believed until a model misses less than it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from idloop.diagnosis import Ladder, Step
from idloop.reporting.page.contents import gather
from idloop.reporting.page.page import page_words
from idloop.reporting.page.page_figures import page_figures
from idloop.reporting.panel import make_panel
from idloop.reporting.residual_findings import FEWEST, believed_noise, least_error, refuted_noise
from idloop.validation import compare


def with_noise(model, *noise):
    """The model with other sensors in its file."""
    return replace(model, outputs=tuple(replace(o, noise=n) for o, n in zip(model.outputs, noise, strict=True)))


@pytest.fixture(scope="module")
def loud(story):
    """A ladder whose file says twenty times the noise that the position has."""
    steps = tuple(replace(s, model=with_noise(s.model, 2e-2, 5e-3)) for s in story["ladder"].steps)
    return gather(replace(story["ladder"], steps=steps), [story["train"]], [story["unseen"]])


def test_noise_that_a_model_goes_below_is_refuted(story, loud):
    (most,) = loud.refuted_noise.values()
    assert set(loud.refuted_noise) == {"motor.position"}
    # Of two sensors of 1 mrad and 5 mrad/s, the first was said to have 20.
    assert 0.9e-3 < most < 3e-3
    assert set(believed_noise(loud.ladder.model, loud.refuted_noise)) == {"motor.velocity"}


@pytest.mark.slow
def test_refuted_noise_is_no_floor_and_no_band_and_the_table_says_so(loud):
    assert set(loud.floor) == {"motor.velocity"}
    for one in loud.judged:
        assert np.isnan(one.panel.band[0])
        assert one.panel.band[1] == pytest.approx(1.96 * 5e-3)
    entries = [item.label.value for plot in page_figures(loud)["ladder"] for item in plot.legend[0].items]
    assert [text for text in entries if "noise" in text] == ["motor.velocity, noise floor"]
    said = page_words(loud)["noise"]
    assert said["motor.position"].startswith("at most 0.00")
    assert said["motor.position"].endswith(" rad on this data; the model file says 0.02 rad")
    assert said["motor.velocity"] == "0.005 rad/s"


def test_a_figure_of_the_command_line_has_no_band_of_refuted_noise_and_no_perfect_fit(loud, story):
    train = story["train"]
    model = with_noise(loud.ladder.model, 2e-2, 5e-3)
    nearly = compare(model, train).simulated * (1.0 + 1e-6)
    comparison = compare(model, replace(train, output=nearly))
    assert 99.9995 < comparison.fit["motor.position"] < 100.0
    panel = make_panel("fitted data", [("fitted", comparison)])
    assert np.isnan(panel.band).all()
    assert all(float(note.split()[1]) < 100.0 for note in panel.notes["fitted"])


def test_true_noise_is_believed(contents, story):
    assert contents.refuted_noise == {}
    assert set(contents.floor) == {"motor.position", "motor.velocity"}
    silent = with_noise(contents.ladder.model, None, None)
    assert refuted_noise([compare(silent, story["unseen"])]) == {}
    assert page_words(gather(Ladder((Step(None, silent),)), [story["train"]], []))["noise"] == {
        "motor.position": "from the data", "motor.velocity": "from the data",
    }  # fmt: skip


def test_a_few_samples_refute_nothing(loud, story):
    model, one = loud.ladder.model, story["unseen"]
    few = slice(0, FEWEST - 1)
    short = replace(
        one, time=one.time[few], output=one.output[few], input_time=one.input_time[few], input=one.input[few]
    )  # fmt: skip
    assert refuted_noise([compare(model, one)])
    assert refuted_noise([compare(model, short)]) == {}


def test_the_least_error_is_that_of_any_step_and_data(story):
    steps = story["ladder"].steps
    every = [part["nrmse"]["motor.position"] for s in steps for part in (s.train, s.validation)]
    assert least_error(story["ladder"], "motor.position") == min(every)
    assert least_error(Ladder((Step(None, steps[0].model),)), "motor.position") == np.inf
