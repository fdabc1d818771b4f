"""What all tests share: the measured data, an own ROS domain for each worker, repeatable examples."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import HealthCheck, settings

if TYPE_CHECKING:
    from idloop.diagnose import Diagnosis

CHECKOUT = Path(__file__).resolve().parent.parent

# As the command line does, and two test workers share two cores.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# Figures are written to files, never shown.
os.environ.setdefault("MPLBACKEND", "Agg")

# The same examples in every run: a failure is always a change of the code.
# `--hypothesis-profile=search` looks for new ones.
settings.register_profile(
    "repeatable",
    derandomize=True,
    deadline=None,
    max_examples=50,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.register_profile("search", deadline=None, max_examples=1000)
settings.load_profile("repeatable")


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Folder of the measured data sets (IDLOOP_DATA, else ../shared/data beside the checkout)."""
    folder = Path(os.environ.get("IDLOOP_DATA", CHECKOUT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no measured data in {folder}: set IDLOOP_DATA to their folder")
    return folder


@pytest.fixture(scope="session")
def missing_pair() -> Diagnosis:
    """Two effects that show only together on a plain axis, with the models that a ladder passes by."""
    from idloop.diagnose import Candidate, Diagnosis, Gate
    from idloop.physics import load_model

    start = load_model("axis")
    first = start.with_effects(["gain_asymmetry@input(ratio=0.02)"])
    both = first.with_effects(["load_torque@axis(torque=-0.01)"])
    gain = Candidate("gain_asymmetry", "input", "yes", "", "It pushes harder one way.", p_value=0.001, model=both)
    load = Candidate("load_torque", "axis", "yes", "", "Something pulls.", p_value=0.001, model=both)
    return Diagnosis(
        model=start,
        candidates=(gain, load),
        set=(gain.name,),
        verdict="missing",
        gate=Gate((), {}, {}),
        unknown=None,
        criterion="prediction",
        level=0.01,
        fit=None,
        pair=(gain.name, load.name),
        rival_pairs=((gain.name, "input_offset@input"),),
        alone=replace(gain, model=first),
    )


@pytest.fixture(scope="session")
def ros_domain_id(worker_id: str) -> int:
    """ROS domain that no other test process on this machine uses at the same time."""
    # Domains 0 to 101 are safe on Linux; the low ones are left to people, the rest is shared out by process and worker.
    worker = int(worker_id[2:]) if worker_id.startswith("gw") else 0
    run = int(os.environ.get("PYTEST_XDIST_TESTRUNUID", f"{os.getpid():x}")[-6:], 16)
    return 10 + (run % 11) * 8 + worker % 8


@pytest.fixture
def ros_environment(ros_domain_id: int, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> dict[str, str]:
    """Environment of this process and its children: own domain, this machine only, logs in a temporary folder."""
    pytest.importorskip("rclpy", reason="no rclpy: run launch_scripts/test, or source a ROS 2")
    variables = {
        "ROS_DOMAIN_ID": str(ros_domain_id),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "ROS_LOG_DIR": str(tmp_path / "ros_log"),
    }
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    return dict(os.environ)
