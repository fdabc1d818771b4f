"""What all tests share: the measured data, an own ROS domain for each worker, repeatable examples."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

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
