"""Colours that everybody can tell apart and read, in light and in dark."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from idloop.reporting.figures.theme import DARK, LIGHT, new_figure

# Machado, Oliveira and Fernandes (2009), full deficiency, for linear RGB.
SEEN = {
    "normal": np.eye(3),
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}


def linear(colour: str) -> np.ndarray:
    part = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255.0
    return np.where(part <= 0.04045, part / 12.92, ((part + 0.055) / 1.055) ** 2.4)


def contrast(one: str, other: str) -> float:
    bright = sorted(float(linear(c) @ [0.2126, 0.7152, 0.0722]) for c in (one, other))
    return (bright[1] + 0.05) / (bright[0] + 0.05)


def lab(rgb: np.ndarray) -> np.ndarray:
    to_xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    xyz = to_xyz @ np.clip(rgb, 0.0, 1.0) / [0.9505, 1.0, 1.089]
    f = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16.0 / 116.0)
    return np.array([116.0 * f[1] - 16.0, 500.0 * (f[0] - f[1]), 200.0 * (f[1] - f[2])])


@pytest.mark.parametrize("theme", (LIGHT, DARK), ids=lambda t: t.name)
def test_words_and_lines_stand_out_from_the_ground(theme):
    for ground in (theme.surface, theme.page):
        for colour in (theme.text, theme.muted):
            assert contrast(colour, ground) >= 4.5
        for colour in (theme.measured, theme.command, theme.found, theme.limit, *theme.models):
            assert contrast(colour, ground) >= 3.0, colour


@pytest.mark.parametrize("theme", (LIGHT, DARK), ids=lambda t: t.name)
@pytest.mark.parametrize("vision", SEEN)
def test_two_models_and_the_measurement_are_told_apart_with_every_colour_vision(theme, vision):
    seen = [lab(np.asarray(SEEN[vision]) @ linear(c)) for c in (theme.measured, *theme.models[:2])]
    for one, other in itertools.combinations(seen, 2):
        assert np.linalg.norm(one - other) > 25.0


def test_models_whose_colours_some_take_for_one_differ_in_their_dashes():
    looks = [LIGHT.model(index) for index in range(len(LIGHT.models))]
    assert len({str(look["line_dash"]) for look in looks[:4]}) == 4


def test_a_page_can_be_switched_from_light_to_dark():
    assert len(LIGHT.colours) == len(DARK.colours)
    for theme in (LIGHT, DARK):
        assert len(set(theme.colours)) == len(theme.colours)
    assert not set(LIGHT.colours) & set(DARK.colours)


def test_every_axis_has_a_name_and_a_unit():
    plot = new_figure(LIGHT, ("time", "s"), ("gain", None))
    assert plot.xaxis[0].axis_label == "time [s]"
    assert plot.yaxis[0].axis_label == "gain [-]"
