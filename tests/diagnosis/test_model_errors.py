"""When one model counts as worse than another one."""

from types import SimpleNamespace
from typing import Any

import pytest

from idloop.diagnosis import model_errors


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
