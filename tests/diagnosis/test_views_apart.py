"""A verdict by one view tells where another one sees something else."""

import pytest

from idloop.diagnosis.ladder import Ladder, Step
from idloop.diagnosis.refine import views_apart
from idloop.diagnosis.search.step import ADEQUATE, UNKNOWN
from idloop.physics import load_model


@pytest.mark.parametrize(
    ("verdict", "share", "told"),
    [(ADEQUATE, 63.0, True), (ADEQUATE, float("nan"), True), (ADEQUATE, 0.99, False), (UNKNOWN, 63.0, False)],
)
def test_a_free_run_that_is_far_off_is_told_beside_an_adequate_force(verdict: str, share: float, told: bool) -> None:
    seen = {"nrmse": {"axis.position": 0.01}}
    unseen = {"nrmse": {"axis.position": 0.02, "axis.velocity": share}}
    ladder = Ladder((Step(None, load_model("axis"), train=seen, validation=unseen),), verdict, criterion="force")
    assert bool(views_apart(ladder)) is told
    assert ("axis.velocity" in views_apart(ladder)) is told
