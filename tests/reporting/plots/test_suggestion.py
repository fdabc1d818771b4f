"""The figure of a suggested experiment: what is sent in, what each rival shows, differences beside the noise."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgba

from idloop import drawing
from idloop.diagnosis.design.expected_outcome import Outcome
from idloop.diagnosis.design.suggest import Limits, Suggestion
from idloop.physics import load_model
from idloop.reporting.next_experiment import predicted_motion
from idloop.reporting.plots.suggestion import plot_suggestion

MOTOR = load_model("dc_motor")
SQUARE = {"name": "square", "sample_time": 0.01, "duration": 4.0, "amplitude": 1.5, "frequency": 0.5}
CHIRP = {"name": "chirp", "sample_time": 0.01, "duration": 20.0, "amplitude": 1.5}
CHIRP |= {"frequency_start": 0.1, "frequency_end": 10.0}
NOISE = (0.01, 0.05)
EFFECTS = {"dead_zone@input": "width=0.4", "coulomb_friction@motor": "level=0.4"}


def rivals(*names: str) -> tuple:
    return tuple((name, MOTOR.with_effects([f"{name}({EFFECTS[name]})"])) for name in names or EFFECTS)


def suggestion(**changes) -> Suggestion:
    known = changes.get("rivals", rivals())
    labels = [label for label, _ in known]
    outcomes = tuple(Outcome(label, 40.0 * (i + 1), labels[0], {}, f"if {label}") for i, label in enumerate(labels))
    given = {
        "signal": SQUARE,
        "adds_to": "command",
        "duration": changes.get("signal", SQUARE)["duration"],
        "discrimination": 123.4,
        "outcomes": outcomes,
        "text": "expected to tell them apart",
        "limits": Limits(2.0, (-3.0, 4.0), 90.0),
        "start": 0.0,
        "controller": None,
        "sample_time": 0.01,
        "rivals": known,
        "noise": NOISE,
        **changes,
    }
    return Suggestion(**given)


def test_the_predicted_motion_is_that_of_the_curves_over_all_rivals_beside_every_limit() -> None:
    found = {one["name"]: one for one in predicted_motion(suggestion())}
    assert list(found) == ["motor.effort", "motor.position", "motor.velocity"]
    command, position, velocity = found.values()
    assert (command["low"], command["high"], command["unit"]) == (-1.5, 1.5, "V")
    assert command["limits"] == [-2.0, 2.0]
    assert position["limits"] == [-3.0, 4.0]
    assert velocity["limits"] == [-90.0, 90.0], "far ones too, which no figure draws"
    runs = [suggestion().experiment.run(model).output[:, 0] for _, model in rivals()]
    assert (position["low"], position["high"]) == (min(map(np.min, runs)), max(map(np.max, runs)))


def curves(axes) -> list:
    """Lines that are no limits."""
    return [line for line in axes.lines if len(line.get_xdata()) > 2]


def limits(axes) -> list[float]:
    return [line.get_ydata()[0] for line in axes.lines if len(line.get_xdata()) == 2]


def legend(axes) -> list[str]:
    return [text.get_text() for text in axes.get_legend().get_texts()]


def head(figure) -> str:
    return figure.legends[0].get_title().get_text().replace("\n", " ")


def test_every_row_names_its_quantity_and_unit():
    axes = plot_suggestion(suggestion()).axes
    assert [a.get_ylabel() for a in axes] == [
        "motor.effort [V]",
        "motor.position [rad]",
        "difference [rad]",
        "motor.velocity [rad/s]",
        "difference [rad/s]",
    ]
    assert axes[-1].get_xlabel() == "time [s]"
    assert {a.get_xlim() for a in axes} == {(0.0, 4.0)}


def test_the_rivals_and_their_differences_are_what_the_experiment_would_show():
    given = suggestion()
    one, two = (given.experiment.run(model).output for _, model in given.rivals)
    sent, position, _, velocity, apart = plot_suggestion(given).axes
    np.testing.assert_array_equal(curves(sent)[0].get_ydata(), given.experiment.built.value)
    for axes, column in ((position, 0), (velocity, 1)):
        for line, output in zip(curves(axes), (one, two), strict=True):
            np.testing.assert_allclose(line.get_ydata(), output[:, column])
    zero, difference = curves(apart)
    np.testing.assert_array_equal(zero.get_ydata(), 0.0)
    np.testing.assert_allclose(difference.get_ydata(), two[:, 1] - one[:, 1])
    rms = np.sqrt(np.mean((two - one)[:, 1] ** 2))
    assert legend(apart) == [f"RMS {rms:.2g} rad/s", "95 % of the noise (±0.098 rad/s)"]


def test_the_band_holds_95_percent_of_the_noise():
    _, _, position, _, velocity = plot_suggestion(suggestion()).axes
    for axes, noise in ((position, NOISE[0]), (velocity, NOISE[1])):
        (band,) = axes.patches
        assert band.get_y() == pytest.approx(-1.959964 * noise)
        assert band.get_height() == pytest.approx(3.919928 * noise)
        low, high = axes.get_ylim()
        assert low < -1.96 * noise < 1.96 * noise < high


def test_near_limits_are_lines_and_far_ones_are_named():
    sent, position, _, velocity, _ = plot_suggestion(suggestion()).axes
    assert limits(sent) == [-2.0, 2.0]
    assert legend(sent) == ["limit ±2 V"]
    assert 4.0 in limits(position)
    assert legend(position) == ["limit −3 .. 4 rad"]
    assert limits(velocity) == []
    assert legend(velocity) == ["limit ±90 rad/s, beyond this view"]
    for axes in (sent, position):
        low, high = axes.get_ylim()
        assert low < min(limits(axes)) <= max(limits(axes)) < high


def test_the_head_names_the_experiment_its_worth_and_the_rivals():
    figure = plot_suggestion(suggestion())
    title, text = head(figure), figure.get_supxlabel().replace("\n", " ")
    assert title == "square on the command, amplitude 1.5 V, 4 s: expected discrimination 120 in log-likelihood"
    assert text.startswith("Expected to tell them apart. ")
    assert [t.get_text() for t in figure.legends[0].get_texts()] == [
        "dead zone @ input (leads by 40 if right; differences are from it)",
        "Coulomb friction @ motor (leads by 80 if right)",
    ]
    looks = [(to_rgba(line.get_color())[:3], line.get_linestyle()) for line in curves(figure.axes[1])]
    assert len(set(looks)) == 2


def test_effects_that_may_be_there_are_drawn_on_the_model_without_them():
    known = (("no further effect", MOTOR), *rivals())
    given = suggestion(rivals=known, against_first=True)
    given = replace(given, outcomes=(replace(given.outcomes[0], in_favour=0.0), *given.outcomes[1:]))
    figure = plot_suggestion(given)
    assert "expected discrimination 80 to 120 in log-likelihood" in head(figure)
    assert len(curves(figure.axes[1])) == 3
    assert figure.legends[0].get_texts()[0].get_text() == "no further effect (differences are from it)"


def test_a_dense_experiment_has_a_second_column_where_the_rivals_differ_most():
    given = suggestion(signal=CHIRP)
    figure = plot_suggestion(given)
    whole, part = figure.axes[0::2], figure.axes[1::2]
    assert len(whole) == len(part) == 5
    (low, high), (begin, end) = whole[0].get_xlim(), part[0].get_xlim()
    assert (low, high) == (0.0, 20.0)
    assert end - begin < 7.0
    assert part[0].get_title(loc="left") == f"where they differ most: {begin:.3g} .. {end:.3g} s"
    one, two = (given.experiment.run(model).output for _, model in given.rivals)
    power = np.sum(((two - one) / NOISE) ** 2, axis=1)
    time = given.experiment.time
    inside = (time >= begin) & (time <= end)
    assert np.mean(power[inside]) > np.mean(power[~inside])
    # What is drawn there fills the axes, and nothing is cut off.
    for axes in part:
        shown = [line.get_ydata()[(begin <= line.get_xdata()) & (line.get_xdata() <= end)] for line in curves(axes)]
        values = np.concatenate(shown)
        assert axes.get_ylim()[0] < np.min(values) <= np.max(values) < axes.get_ylim()[1]


def test_a_closed_loop_shows_the_reference_and_the_command_of_each_rival():
    controller = {
        "type": "pid",
        "output": "motor.position",
        "kp": 5.0,
        "ki": 0.0,
        "kd": 0.1,
        "limit": 1.9,
        "sample_time": 0.01,
    }
    given = suggestion(adds_to="reference", controller=controller, start=0.5)
    figure = plot_suggestion(given)
    axes = figure.axes
    assert [a.get_ylabel() for a in axes[:3]] == ["reference [rad]", "motor.effort [V]", "difference [V]"]
    np.testing.assert_allclose(curves(axes[0])[0].get_ydata(), 0.5 + given.experiment.built.value)
    assert limits(axes[0]) == [-3.0, 4.0]
    runs = [given.experiment.run(model) for _, model in given.rivals]
    for line, run in zip(curves(axes[1]), runs, strict=True):
        np.testing.assert_allclose(line.get_ydata(), run.input)
    assert legend(axes[2])[0].startswith("RMS ")
    assert "amplitude 1.5 rad" in head(figure)
    excited = plot_suggestion(suggestion(controller=controller)).axes
    assert [a.get_ylabel() for a in excited[:2]] == ["excitation [V]", "motor.effort [V]"]


def test_rivals_that_are_told_by_the_force_say_so():
    given = suggestion()
    errors = {"dead_zone@input": {"force[motor]": {"value": 1.0, "unit": "N·m", "noise": 0.1}}}
    told = replace(given, outcomes=(given.outcomes[0], replace(given.outcomes[1], errors=errors)))
    assert "drive force" in plot_suggestion(told).get_supxlabel()
    assert "drive force" not in plot_suggestion(given).get_supxlabel()


@pytest.mark.slow
@pytest.mark.parametrize("signal", (SQUARE, CHIRP))
def test_no_words_run_off_the_page_or_onto_each_other(signal):
    known = tuple(
        (f"gain_asymmetry@input + stribeck_friction@motor number {i}", model)
        for i, (_, model) in enumerate(rivals() * 3)
    )
    text = "this data cannot show " + ", ".join(label for label, _ in known) + "; expected to show them"
    figure = plot_suggestion(suggestion(signal=signal, rivals=known, text=text))
    FigureCanvasAgg(figure).draw()
    page = figure.bbox
    legends = [a.get_legend() for a in figure.axes if a.get_legend()]
    boxes = [artist.get_window_extent() for artist in (*figure.texts, *figure.legends, *legends)]
    boxes += [a.yaxis.label.get_window_extent() for a in figure.axes if a.get_ylabel()]
    for box in boxes:
        assert page.x0 <= box.x0
        assert box.x1 <= page.x1
        assert page.y0 <= box.y0
        assert box.y1 <= page.y1
    rows = [axes.get_tightbbox() for axes in figure.axes if axes.get_ylabel()]
    stack = [figure.legends[0].get_window_extent(), *rows, figure.texts[0].get_window_extent()]
    for above, below in itertools.pairwise(stack):
        assert below.y1 <= above.y0 + 1.0


def test_two_rivals_that_agree_in_everything_can_be_drawn():
    same = rivals("dead_zone@input") * 2
    axes = plot_suggestion(suggestion(rivals=same)).axes
    assert legend(axes[2])[0] == "RMS 0 rad"


@pytest.mark.parametrize("suffix", (".png", ".svg"))
def test_equal_figures_are_equal_files(suffix, tmp_path):
    one, two = (drawing.save(plot_suggestion(suggestion()), tmp_path / f"{name}{suffix}") for name in ("one", "two"))
    assert one.stat().st_size > 10_000
    assert one.read_bytes() == two.read_bytes()
