"""Figures of black-box identification: every panel that the results call for, and none that they do not."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from idloop.drawing import save
from idloop.estimation.black_box.identification import identify
from idloop.estimation.black_box.method import Choices
from idloop.estimation.black_box.sampled import SampledData
from idloop.reporting.plots.identification import Drawn, SweepLine, plot_identification, plot_sweep
from idloop.validation.score import score


@pytest.fixture(scope="module")
def data():
    random = np.random.default_rng(0)
    u = random.normal(size=600)
    y = lfilter([0.0, 0.2, 0.1], [1.0, -1.4, 0.6], u) + 0.02 * random.normal(size=600)
    return SampledData("run", u[:, None], y[:, None], 0.01, ("motor.effort",), ("N·m",), ("motor.velocity",), ("m/s",))


def drawn(data, *names):
    results = []
    for name in names:
        found = identify(data, name, Choices(order=2))
        results.append(Drawn(name, found, score(found.model, [data]) if found.predicts else None))
    return results


def labels(figure):
    return [axes.get_ylabel() for axes in figure.axes]


BODE = ["magnitude [m/s/(N·m)]", "phase [deg]"]
VALIDATION = ["motor.velocity [m/s]", "residual [m/s]"]


@pytest.mark.parametrize(
    ("names", "expected"),
    (
        (("oe",), BODE + VALIDATION),
        (("n4sid", "spa"), [*BODE, *VALIDATION, "singular value, relative [-]"]),
        (("etfe",), BODE),
        (("cra",), ["weight [m/s/(N·m)]"]),
        (("narx-wavelet",), VALIDATION),
        (("rarx",), [*BODE, *VALIDATION, "coefficient [-]", "coefficient [m/s/(N·m)]"]),
    ),
)
def test_the_panels_are_those_of_the_results(names, expected, data):
    assert labels(plot_identification(drawn(data, *names), [data])) == expected


def test_a_polynomial_model_has_a_band_about_its_curve(data):
    figure = plot_identification(drawn(data, "oe"), [data])
    magnitude, phase = figure.axes[:2]
    for axes in (magnitude, phase):
        (curve,), (band,) = axes.get_lines(), axes.collections
        low, high = band.get_datalim(axes.transData).intervaly
        assert low < np.min(curve.get_ydata())
        assert high > np.max(curve.get_ydata())
    assert not plot_identification(drawn(data, "n4sid"), [data]).axes[0].collections


def test_the_measured_phase_lies_beside_the_models(data):
    figure = plot_identification(drawn(data, "spa", "oe"), [data])
    models, measured = (line.get_ydata() for line in figure.axes[1].get_lines())
    assert np.ptp(measured) < np.ptp(models) + 60.0


def test_coefficients_that_change_are_drawn_as_they_went(data):
    (one,) = drawn(data, "kalman")
    *_, free, of_command = plot_identification([one], [data]).axes
    (history,) = one.found.history
    for axes, names in ((free, ["a1", "a2"]), (of_command, ["b1[motor.effort]", "b2[motor.effort]"])):
        assert [text.get_text() for text in axes.get_legend().get_texts()] == names
        assert len(axes.collections) == 2
        for line, name in zip(axes.get_lines(), names, strict=True):
            np.testing.assert_array_equal(line.get_ydata(), history.values[:, history.names.index(name)])
    assert "the free run has the last ones" in free.get_title(loc="left")


def test_only_what_has_bands_is_said_to_have_them(data):
    def title(*names):
        return plot_identification(drawn(data, *names), [data]).axes[0].get_title(loc="left")

    assert title("etfe") == "motor.effort → motor.velocity"
    assert title("etfe", "spa") == "motor.effort → motor.velocity, bands of 95 % of spa"
    assert title("spa", "oe").endswith(", bands of 95 %")


def test_lines_below_the_resolution_are_not_drawn(data):
    (one,) = drawn(data, "spa")
    model = one.found.model
    assert model.frequency[0] < model.resolution
    (curve,) = plot_identification([one], [data]).axes[0].get_lines()
    assert curve.get_xdata()[0] == pytest.approx(np.min(model.frequency[model.resolved]))
    assert np.all(model.frequency[model.resolved] >= model.resolution * (1.0 - 1e-6))


@pytest.mark.slow
def test_one_legend_names_every_method(data, tmp_path):
    names = ("arx", "oe", "n4sid", "iv4", "cra")
    figure = plot_identification(drawn(data, *names), [data], "validation: run")
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["measured", *names]
    assert save(figure, tmp_path / "figure.png").stat().st_size > 20000


def test_a_model_that_runs_away_does_not_spoil_the_scale(data):
    (one,) = drawn(data, "oe")
    away = tuple(run * np.exp(np.arange(len(run)))[:, None] for run in one.score.simulated)
    from dataclasses import replace

    figure = plot_identification([replace(one, score=replace(one.score, simulated=away))], [data])
    assert np.ptp(figure.axes[2].get_ylim()) < 10 * np.ptp(data.output)


def test_a_sweep_shows_both_fits_and_keeps_its_scale():
    value = np.array([1.0, 2.0, 3.0])
    line = SweepLine("oe", value, np.array([50.0, 90.0, -np.inf]), np.array([60.0, 95.0, 40.0]))
    bad = SweepLine("arx", value, np.array([-1e9, 80.0, 70.0]), np.array([50.0, 50.0, 50.0]))
    figure = plot_sweep("order", None, [line, bad], 10, "validation: run")
    top, bottom = figure.axes
    assert (top.get_ylabel(), bottom.get_ylabel()) == ("FIT, free run [%]", "FIT, 10 ahead [%]")
    assert bottom.get_xlabel() == "order [-]"
    assert top.get_ylim()[0] > -100
    assert np.isnan(top.get_lines()[0].get_ydata()[2])
