"""A small simulated fleet: two robots of two joints on three days."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks import fleet as simulated
from idloop.fleet.joint_day import Settings
from idloop.physics.model_file import from_text

pytest.importorskip("distributed")
pytest.importorskip("duckdb")
pytest.importorskip("fsspec")
pytest.importorskip("pyarrow")
pytest.importorskip("statsmodels")


@pytest.fixture(scope="session")
def plan() -> simulated.Fleet:
    """Nothing is planted, missing or broken."""
    return simulated.Fleet(2, 2, 3, missing=0.0, broken=0.0)


@pytest.fixture(scope="session")
def recordings(plan, tmp_path_factory) -> Path:
    """Folder ROBOT/DATE of its bags, to be read only."""
    folder = tmp_path_factory.mktemp("fleet")
    for robot in range(plan.robots):
        simulated.write_robot(folder, plan, robot)
    return folder


@pytest.fixture(scope="session")
def settings() -> Settings:
    """Joint 0 is of the base, joint 1 of the wrist."""
    return Settings(
        (("j0", from_text(simulated.KINDS["base"], None)), ("*", from_text(simulated.KINDS["wrist"], None)))
    )
