"""A verdict by one view comes with a finding where another view contradicts it."""

import pytest

from idloop.diagnosis.ladder import Ladder, Step
from idloop.diagnosis.refine import force_finding, free_run_finding
from idloop.diagnosis.search.step import ADEQUATE, UNKNOWN
from idloop.physics import load_model


@pytest.mark.parametrize(
    ("verdict", "share", "reported"),
    [(ADEQUATE, 63.0, True), (ADEQUATE, float("nan"), True), (ADEQUATE, 0.99, False), (UNKNOWN, 63.0, False)],
)
def test_a_free_run_that_is_far_off_is_reported_beside_an_adequate_force(
    verdict: str, share: float, reported: bool
) -> None:
    seen = {"nrmse": {"axis.position": 0.01}}
    unseen = {"nrmse": {"axis.position": 0.02, "axis.velocity": share}}
    ladder = Ladder((Step(None, load_model("axis"), train=seen, validation=unseen),), verdict, criterion="force")
    assert bool(free_run_finding(ladder)) is reported
    assert ("axis.velocity" in free_run_finding(ladder)) is reported


@pytest.mark.parametrize(
    ("verdict", "criterion", "left", "reported"),
    [
        (ADEQUATE, "prediction", 0.23, True), (ADEQUATE, "force", 0.23, False), (ADEQUATE, "prediction", 0.05, False),
        (ADEQUATE, "prediction", None, False), (UNKNOWN, "prediction", 0.23, False),
    ],
)  # fmt: skip
def test_a_force_that_is_left_is_reported_beside_adequate_predictions(
    verdict: str, criterion: str, left: float | None, reported: bool
) -> None:
    ladder = Ladder((Step(None, load_model("axis"), train={"force": left}),), verdict, criterion=criterion)
    assert ("23 % of the drive force" in force_finding(ladder)) is reported


@pytest.mark.parametrize(("noise", "reported"), [(None, True), (0.02, True), (0.137, False), (0.2, False)])
def test_a_force_that_sensor_noise_leaves_is_nothing_missing(noise, reported) -> None:
    """A motor with its cogging in the model: 13.8 % of the force, all of it noise of the tachometer."""
    model = load_model("axis")
    ladder = Ladder(
        (Step(None, model, train={"force": 0.138, "force_noise": noise}),), verdict="adequate", criterion="prediction"
    )
    assert bool(force_finding(ladder)) is reported
