"""What all tests share: the measured data, an own ROS domain for each worker, repeatable examples."""

from __future__ import annotations

import contextlib
import fcntl
import gc
import os
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import HealthCheck, settings

if TYPE_CHECKING:
    from idloop.diagnosis import Diagnosis

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


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Where only whole graphs are asked for, pass by the files that have none: to import them all takes long."""
    if not config.option.markexpr.startswith("whole_graph") or collection_path.suffix != ".py":
        return None
    return "whole_graph" not in collection_path.read_text(encoding="utf-8") or None


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """Keep the garbage collector from what stays until the end, files and tests: else it looks at them ever again."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()
        gc.freeze()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put files with slow tests first: one of them begun last would leave the other workers idle."""
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in slow)


def _yielding(program: str, folder: Path) -> str:
    """A program as it would be on the reader's own machine: the nodes of a graph under test come first.

    As root Chromium would put itself before them, so it loses the right to.
    """
    wrapper = folder / "browser"
    # Where the kernel refuses to take a right away, being nice alone must do.
    drop = "setpriv --bounding-set -sys_nice --inh-caps -sys_nice"
    start = f'exec nice -n 10 "{program}" "$@"'
    wrapper.write_text(f"#!/bin/sh\n{drop} true 2>/dev/null && exec {drop} {start[5:]}\n{start}\n")
    wrapper.chmod(0o755)
    return str(wrapper)


@pytest.fixture(scope="session")
def browser(tmp_path_factory):
    """Headless Chromium, one for all tests of a worker: two Playwrights in one process are refused."""
    playwright = pytest.importorskip("playwright.sync_api", reason="no Playwright: run launch_scripts/test")
    from idloop.errors import InputError
    from idloop.reporting.page.chromium import find_chromium

    try:
        path = find_chromium()
    except InputError as error:
        pytest.skip(str(error))
    arguments = ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync"]
    with playwright.sync_playwright() as driver:
        started = driver.chromium.launch(
            executable_path=_yielding(str(path), tmp_path_factory.mktemp("browser")),
            args=[*arguments, "--disable-background-networking", "--disable-component-update"],
        )
        yield started
        started.close()


@pytest.fixture(scope="session", autouse=True)
def _what_is_trusted_is_the_tests_own(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Keep what is remembered between runs out of the user's own folder."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("state")))
        yield


@pytest.fixture(autouse=True)
def _no_figure_is_left_open() -> Iterator[None]:
    """Close what a test has drawn, as a user closes windows."""
    yield
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")


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
    from idloop.diagnosis import Candidate, Diagnosis, Gate
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
        pair=(gain.name, load.name),
        rival_pairs=((gain.name, "input_offset@input"),),
        alone=replace(gain, model=first),
    )


@pytest.fixture(scope="session")
def ros_domain_id() -> Iterator[int]:
    """ROS domain that no other test process on this machine uses at the same time: each holds the lock of its own."""
    # Domains 0 to 101 are safe on Linux; the low ones are left to people.
    for domain in range(10, 102):
        with (
            contextlib.suppress(OSError),
            Path(tempfile.gettempdir(), f"idloop_test_domain_{domain}").open("a") as lock,
        ):
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            yield domain
            return
    pytest.fail("every ROS domain is in use by another test process")


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
    _use_sockets_only(monkeypatch)
    return dict(os.environ)


def _use_sockets_only(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let this process speak as its nodes do, until the end of the test."""
    try:
        from idloop_nodes.middleware import PROFILE_VARIABLES, use_sockets_only
    except ImportError:
        return
    for name in PROFILE_VARIABLES:
        monkeypatch.setenv(name, "")
    use_sockets_only()
