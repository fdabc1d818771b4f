"""Processes that work for a fleet: one that is killed, one that kills every worker, and a driver that is killed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import warnings
from pathlib import Path

import pytest

from benchmarks import fleet as simulated
from idloop.errors import InputError
from idloop.fleet.engine import Workers
from idloop.fleet.store import Store
from idloop.fleet.words import read_words

COUNT = 8
DEATHS = 2  # of workers after which an item at them is suspect


def square(item: int, folder: str) -> int:
    """Square of an item; the first time that it is at the fourth one, the process is killed."""
    here = Path(folder)
    if item == 3 and not (here / "killed").exists():
        (here / "killed").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    if item == 5 and (here / "poison").exists():
        os.kill(os.getpid(), signal.SIGKILL)
    (here / f"{item}").touch()
    return item**2


def ends_the_worker_of_the_other(item: int, folder: str) -> str:
    """The first item ends the process as soon as the second is at it, which ends only after enough of that."""
    here = Path(folder)
    if item == 0:
        while not (here / "there").exists():
            os.sched_yield()
        (here / f"death {os.getpid()}").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    (here / "there").touch()
    while len(list(here.glob("death *"))) < DEATHS:
        os.sched_yield()
    return "done"


def deaf(_: int) -> bool:
    """Whether this process gets no Ctrl-C."""
    return signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, [])


def everything(workers: Workers, folder: Path, size: int) -> dict[int, int]:
    ended = list(workers.map(square, range(COUNT), str(folder), size=size, lost=lambda one: -one))
    pairs = [pair for batch, results in ended for pair in zip(batch, results, strict=True)]
    assert len(pairs) == COUNT, "every item once"
    return dict(pairs)


def test_in_this_process_without_dask(tmp_path):
    (tmp_path / "killed").touch()
    with Workers(0) as workers:
        assert everything(workers, tmp_path, 3) == {item: item**2 for item in range(COUNT)}


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
def test_a_killed_worker_loses_nothing_and_an_item_that_kills_costs_itself_only(tmp_path):
    import dask

    # No new process starts within that time: it is waited for.
    with dask.config.set({"distributed.deploy.lost-worker-timeout": "10ms"}), Workers(2) as workers:
        assert everything(workers, tmp_path, 2) == {item: item**2 for item in range(COUNT)}
        assert (tmp_path / "killed").exists()
        (tmp_path / "poison").touch()
        assert everything(workers, tmp_path, 2) == {item: item**2 if item != 5 else -5 for item in range(COUNT)}
        ended = workers.map(deaf, range(COUNT), size=1, lost=lambda one: False)
        assert all(one for _, (one,) in ended), "Ctrl-C is for this process, also of workers that replace others"
    assert not deaf(0)


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
def test_what_is_at_a_worker_that_another_item_ends_is_not_lost_with_it(tmp_path):
    import dask
    import distributed

    settings = {"scheduler.allowed-failures": DEATHS - 1, "deploy.lost-worker-timeout": "1 day"}
    with dask.config.set({f"distributed.{name}": one for name, one in settings.items()}), distributed.LocalCluster(
        n_workers=1, threads_per_worker=2, host="127.0.0.1", dashboard_address=None
    ) as cluster, Workers(cluster=cluster.scheduler_address) as workers:  # fmt: skip
        ended = workers.map(ends_the_worker_of_the_other, [0, 1], str(tmp_path), size=1, lost=lambda one: "lost")
        assert {one: result for (one,), (result,) in ended} == {0: "lost", 1: "done"}


@pytest.mark.slow
def test_a_limit_of_memory_that_no_worker_keeps_is_one_line():
    with Workers(1, "60MB") as workers, pytest.raises(InputError, match="--memory 60MB: a worker ends before"):
        assert workers.count
    with Workers(1) as workers:
        import dask

        (pause,) = workers.client.run(dask.config.get, "distributed.worker.memory.pause").values()
        assert pause is False, "a worker near its limit goes on, or is replaced"


@pytest.mark.slow
def test_two_fleets_on_a_machine_do_not_meet():
    with warnings.catch_warnings(record=True) as said, Workers(1) as one, Workers(1) as other:
        warnings.simplefilter("always")
        assert one.count == other.count == 1
    assert [str(one.message) for one in said if "in use" in str(one.message)] == []


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
def test_a_cluster_is_reached_by_its_address_and_may_lose_a_worker(tmp_path):
    import distributed

    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=None
    ) as cluster, Workers(cluster=cluster.scheduler_address) as workers:  # fmt: skip
        assert workers.count == 2
        assert everything(workers, tmp_path, 2) == {item: item**2 for item in range(COUNT)}
        assert (tmp_path / "killed").exists()


def start(recordings: Path, folder: Path) -> subprocess.Popen[str]:
    models = []
    for kind, text in simulated.KINDS.items():
        (folder / f"{kind}.yaml").write_text(text)
    models = ["--model", f"j0={folder}/base.yaml", f"j1={folder}/wrist.yaml"]
    words = ["fleet", str(recordings), *models, "--output", str(folder / "out"), "--workers", "1", "--diagnose", "0"]
    return subprocess.Popen(
        [sys.executable, "-m", "idloop", *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True,
    )  # fmt: skip


def finish(recordings: Path, folder: Path) -> tuple[str, Store]:
    run = start(recordings, folder)
    said, wrong = run.communicate()
    assert run.returncode == 0, wrong
    return said, Store(folder / "out")


@pytest.mark.slow
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT])
def test_a_driver_that_is_ended_in_the_middle_goes_on(recordings, plan, tmp_path, how):
    run = start(recordings, tmp_path)
    rows = tmp_path / "out" / "rows"
    while not list(rows.glob("*.parquet")):
        assert run.poll() is None, run.communicate()
    if how == signal.SIGINT:
        os.killpg(run.pid, how)  # as a terminal does: to the workers as well
    else:
        run.send_signal(how)
    _, wrong = run.communicate()
    if how == signal.SIGINT:
        assert run.returncode == 130
        assert f"kept in {tmp_path / 'out'}; the same command goes on from there" in wrong
        assert "Traceback" not in wrong
    before = {file.name: file.read_bytes() for file in rows.glob("*.parquet")}
    said, store = finish(recordings, tmp_path)
    whole = plan.robots * plan.days
    after = {file.name: file.read_bytes() for file in rows.glob("*.parquet")}
    assert {name: after[name] for name in before} == before
    counts = "count(*), count(distinct (sha256, joint, parameter)), count(distinct sha256)"
    sql = f"select {counts} from rows where parameter is not null"
    assert store.query(sql).fetchone() == (whole * plan.joints * 4, whole * plan.joints * 4, whole)
    assert read_words(whole - len(before), whole) in said
