"""The figure of where models fail: units everywhere, a block for each error, shares and means as computed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from idloop import drawing
from idloop.physics import load_model, simulate
from idloop.records import Record
from idloop.reporting.plots.where import plot_where
from idloop.validation import Where, compare

TIME = np.arange(0.0, 8.0, 5e-3)


@pytest.fixture(scope="module")
def found() -> list[tuple[str, Where]]:
    plain = load_model("dc_motor")
    hidden = plain.with_effects(["coulomb_friction@motor(level=2)"])
    command = 4.0 * np.sin(3.0 * TIME) + 2.0 * np.sin(7.7 * TIME)
    output = simulate(hidden, TIME, command, TIME).output
    output = output + 1e-3 * np.random.default_rng(0).normal(size=output.shape)
    units = tuple(o.unit for o in plain.outputs)
    record = Record("swing", TIME, command, TIME, output, plain.input.name, "V", plain.output_names, units)
    half = plain.with_effects(["coulomb_friction@motor(level=1)"])
    return [("plain", compare(plain, record).where), ("half", compare(half, record).where)]


@pytest.fixture(scope="module")
def figure(found):
    """Both models in one figure, for tests that only look."""
    return plot_where(found)


def only(where: Where, name: str) -> Where:
    """One error of it, which is drawn sooner."""
    return replace(where, maps=(where[name],))


def rows(figure) -> list[list]:
    """Axes by block and row: shares, values, shares, values, ..."""
    columns = 7
    blocks = len(figure.axes) // (2 * columns)
    return [figure.axes[columns * r : columns * (r + 1)] for r in range(2 * blocks)]


def test_every_column_names_its_variable_and_unit(figure):
    labels = [axes.get_xlabel() for axes in rows(figure)[1]]
    assert labels == [
        "time [s]",
        "frequency [Hz]",
        "velocity [rad/s]",
        "position [°]",
        "command [V]",
        "direction [sign]",
        "time since reversal [s]",
    ]
    left = [row[0].get_ylabel() for row in rows(figure)]
    assert left == ["share [%]", "error [N·m]", "share [%]", "error [rad]", "share [%]", "error [rad/s]"]
    assert [row[2].get_ylabel() for row in rows(figure)[1::2]] == [
        "mean ± rms [N·m]",
        "mean ± rms [rad]",
        "mean ± rms [rad/s]",
    ]
    titles = [row[0].get_title(loc="left") for row in rows(figure)[::2]]
    assert titles[0] == "drive force: applied minus needed"
    assert titles[2] == "motor.velocity: free-run error"


def test_the_last_tick_of_a_turn_is_clear_of_the_next_column(figure):
    for row in rows(figure)[1::2]:
        last = row[3].get_xticklabels()[-1]
        assert (last.get_text(), last.get_horizontalalignment()) == ("360", "right")


def test_shares_and_means_are_those_computed(figure, found):
    breakdown = found[0][1]["drive force"].along("velocity")
    shares, values = (row[2] for row in rows(figure)[:2])
    usual, error, _ = shares.patches
    np.testing.assert_allclose(usual.get_data().values, 100.0 * breakdown.usual)
    np.testing.assert_allclose(error.get_data().values, 100.0 * breakdown.error)
    np.testing.assert_allclose(error.get_data().edges, breakdown.edges)
    np.testing.assert_allclose(values.patches[1].get_data().values, breakdown.mean)


def test_nothing_is_cut_off(figure):
    for row in rows(figure):
        for axes in row:
            low, high = axes.get_ylim()
            for patch in axes.patches:
                if hasattr(patch, "get_data"):
                    values = patch.get_data().values
                    assert low <= np.nanmin(values)
                    assert np.nanmax(values) <= high


def test_two_models_differ_in_colour_and_both_are_named(figure):
    shares = rows(figure)[0]
    _, one, two = shares[2].patches
    assert one.get_edgecolor() != two.get_edgecolor()
    texts = [text.get_text() for text in shares[-1].get_legend().get_texts()]
    assert texts[0].startswith("usual share")
    assert texts[1].startswith("error of plain (rms ")
    assert texts[2].startswith("error of half (rms ")
    assert texts[1].endswith("N·m)")


def test_a_variable_that_was_left_out_says_why(found):
    where = found[0][1]
    one = where["motor.velocity"]
    known = tuple(b for b in one.breakdowns if b.variable != "position")
    blind = replace(one, breakdowns=known, left_out={"position": "no position is measured"})
    figure = plot_where([("plain", Where("plain", "swing", (blind,)))])
    texts = [text.get_text() for axes in figure.axes for text in axes.texts]
    assert "position:\nno position is measured" in texts


@pytest.mark.slow
@pytest.mark.parametrize("suffix", (".png", ".svg"))
def test_equal_figures_are_equal_files(found, suffix, tmp_path):
    one, two = (
        drawing.save(plot_where([("plain", only(found[0][1], "drive force"))]), tmp_path / f"{name}{suffix}")
        for name in ("one", "two")
    )
    assert one.stat().st_size > 10000
    assert one.read_bytes() == two.read_bytes()


def test_two_models_stand_beside_each_other(found):
    one, two = (only(where, "motor.velocity") for _, where in found)
    figure = plot_where([("a", one), ("b", two)])
    texts = [text.get_text() for text in figure.axes[6].get_legend().get_texts()]
    assert [text.split(" (")[0] for text in texts] == ["usual share", "error of a", "error of b"]


def test_no_error_to_show_is_an_empty_figure():
    assert plot_where([("plain", Where("plain", "swing", ()))]).axes == []
