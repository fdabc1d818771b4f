"""Bags of a motor with a hidden dead zone, for the verbs that look for it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from idloop.cli import _progress


@pytest.fixture(autouse=True)
def _no_progress(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a busy machine any verb may take long enough for a line of progress: what stands on stderr must not tell."""
    monkeypatch.setattr(_progress, "PERIOD", 1e6)


@pytest.fixture(scope="session")
def hidden(tmp_path_factory) -> SimpleNamespace:
    """Model file without the effect, and bags with it: many levels, unseen ones, and two levels that hide it."""
    from idloop.diagnosis.design.experiment import Experiment
    from idloop.physics import load_model
    from idloop.records import write_bag

    folder = tmp_path_factory.mktemp("hidden")
    model = load_model("dc_motor")
    outputs = tuple(replace(o, noise=n) for o, n in zip(model.outputs, (0.002, 0.01), strict=True))
    model = replace(model, outputs=outputs, controller=None)
    model.save(folder / "bare.yaml")
    truth = model.with_effects(["dead_zone@input(width=0.4)"])

    def record(folder_name: str, seconds: float, **signal: object) -> Path:
        given = {"sample_time": 0.01, "duration": seconds, "amplitude": 2.0, **signal}
        run = Experiment(given).run(truth, noise=True, disturbance=0.02, seed=len(folder_name), name=folder_name)
        return write_bag(folder / folder_name, run)

    return SimpleNamespace(
        model=folder / "bare.yaml",
        levels=record("levels", 10.0, name="multilevel", seed=2),
        unseen=record("unseen", 6.0, name="multilevel", seed=5),
        two=record("two", 10.0, name="prbs", band_hz=1.0, seed=1),
    )


@pytest.fixture(scope="session")
def refined(hidden, tmp_path_factory) -> Path:
    """Folder of the ladder that the whole catalogue climbs to the hidden effect."""
    from idloop.cli import main

    folder = tmp_path_factory.mktemp("ladders") / "refined"
    words = ("refine", hidden.model, hidden.levels, "--validate", hidden.unseen, "--output", folder, "--most", 3)
    assert main.run([str(word) for word in words]) == 0
    return folder
