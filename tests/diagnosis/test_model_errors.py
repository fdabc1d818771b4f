"""When one model counts as worse than another one."""

from types import SimpleNamespace
from typing import Any

import pytest

from idloop.diagnosis import model_errors
from idloop.errors import IdloopError


@pytest.mark.parametrize(
    ("before", "after", "worse"),
    [
        pytest.param(0.3, 0.5, True, id="it followed the motion, and does so less"),
        pytest.param(0.3, 0.32, False, id="much the same"),
        pytest.param(0.95, 3.0, False, id="it described nothing: an arm that stands still, and one that falls"),
    ],
)
def test_only_a_free_run_that_followed_the_motion_gets_worse(
    monkeypatch: pytest.MonkeyPatch, before: float, after: float, worse: bool
) -> None:
    errors = {"before": before, "after": after}

    def restarted(model: Any, _: Any) -> dict[str, float]:
        return {"axis.position": errors[model.name]}

    monkeypatch.setattr(model_errors, "_anew", restarted)
    plain, extended = (SimpleNamespace(name=name) for name in errors)
    assert model_errors.runs_worse(plain, extended, (SimpleNamespace(name="run"),)) is worse


@pytest.mark.parametrize(
    ("before", "after", "worse"),
    [
        pytest.param((0.34, 0.3, 0.19), (0.21, 0.2, 0.21), False, id="all that is left is noise of a larger inertia"),
        pytest.param((0.34, 0.3, 0.19), (0.40, 0.4, 0.21), True, id="more is left"),
        pytest.param((0.22, 0.1, 0.05), (0.38, 0.03, 0.02), False, id="more is left at a few steps of the command"),
        pytest.param((0.22, 0.1, 0.05), (0.22, 0.2, 0.02), False, id="more is left but at a few steps of the command"),
        pytest.param((0.34, 0.3, 0.19), None, True, id="it has no balance"),
        pytest.param((0.002, 0.002, 0.001), (0.009, 0.009, 0.001), False, id="both within the error of a balance"),
    ],
)
def test_a_model_that_leaves_more_of_the_force_is_worse(
    monkeypatch: pytest.MonkeyPatch, before: tuple[float, ...], after: tuple[float, ...] | None, worse: bool
) -> None:
    errors = {"before": before, "after": after}

    def force_error(model: Any, _: Any) -> Any:
        known = errors[model.name]
        if known is None:
            raise IdloopError("no balance")
        relative, typical, noise = known
        return SimpleNamespace(relative=relative, typical=typical, noise=noise, trusted=noise < 0.2)

    monkeypatch.setattr(model_errors, "force_error", force_error)
    plain, extended = (SimpleNamespace(name=name, inner_couplings=()) for name in errors)
    assert model_errors.explains_less(plain, extended, (SimpleNamespace(name="run"),)) is worse
