from __future__ import annotations

import numpy as np
import pytest

from idloop.robots.inertia import (
    nearest_consistent,
    parameters_at,
    parameters_of,
    pseudo_inertia,
    root_of,
)

# 2 kg, centre at (0.1, 0, 0.2), principal inertias 0.02, 0.03, 0.04
CENTRE = np.array([0.1, 0.0, 0.2])
ABOUT = np.diag([0.02, 0.03, 0.04]) + 2.0 * (CENTRE @ CENTRE * np.eye(3) - np.outer(CENTRE, CENTRE))
LINK = np.array([2.0, *(2.0 * CENTRE), *ABOUT[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]])


def is_consistent(parameters) -> bool:
    """Whether a distribution of positive mass has the ten parameters."""
    return bool(np.all(np.linalg.eigvalsh(pseudo_inertia(parameters)) > 0.0))


def test_parameters_survive_the_way_to_the_pseudo_inertia_and_back():
    assert parameters_of(pseudo_inertia(LINK)) == pytest.approx(LINK)
    root = root_of(LINK)
    assert np.allclose(root, np.triu(root))
    assert root @ root.T == pytest.approx(pseudo_inertia(LINK))
    assert parameters_at(root[None], np.zeros((1, 10)))[0] == pytest.approx(LINK)


def test_every_coordinate_is_a_possible_link():
    random = np.random.default_rng(0)
    roots = np.repeat(root_of(LINK)[None], 50, axis=0)
    for link in parameters_at(roots, random.normal(size=(50, 10))):
        assert is_consistent(link)


@pytest.mark.parametrize("change", [{0: 0.0}, {4: 1e-4}, {9: 10.0}, {1: 5.0}])
def test_an_impossible_link_becomes_a_possible_one(change):
    link = LINK.copy()
    for place, value in change.items():
        link[place] = value
    assert not is_consistent(link)
    assert is_consistent(nearest_consistent(link))


def test_a_possible_link_stays():
    assert nearest_consistent(LINK) == pytest.approx(LINK)
