"""The benchmark's own machinery: contestants agree, tables are written, and what is absent costs one line."""

import json
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

SPEED = Path(__file__).resolve().parents[2] / "benchmarks" / "speed"
sys.path.append(str(SPEED.parent))

from speed import plot, table  # noqa: E402
from speed.contest import Contest, run_worker  # noqa: E402
from speed.machines import torsion_record  # noqa: E402
from speed.motor import PERIOD, START, TRUTH, experiment  # noqa: E402
from speed.plants import PLANTS, steps_of_command  # noqa: E402
from speed.result import Claim, Row, Section  # noqa: E402

HERE = Path(sys.executable)
SIMULATION = {"period": 1e-3, "pieces": 1, "warm": False}


@pytest.mark.slow
@pytest.mark.parametrize("plant", PLANTS, ids=lambda p: p.name)
def test_plain_c_is_the_same_plant(plant):
    if shutil.which("gcc") is None:
        pytest.skip("gcc is not installed")
    data = plant.numbers() | {"command": steps_of_command(2000)}
    contest, settings = Contest(HERE), SIMULATION | {"plant": plant.name}
    ours, own = contest.enter("w", "idloop", "simulation_idloop", data, settings, ours=True, runs=1)
    # The yardstick lets a body that breaks away within a step wait for the next.
    theirs, other = contest.enter("w", "C", "simulation_c", data, settings | {"pieces": 30}, ours=True, runs=1)
    assert not ours.note
    assert not theirs.note
    np.testing.assert_allclose(own["position"], other["position"], atol=1e-6)


@pytest.mark.slow
def test_the_compiled_yardstick_finds_the_motor():
    data = experiment(4.0)
    settings = {"names": list(TRUTH), "start": START, "period": PERIOD, "warm": False}
    _, found = Contest(HERE).enter("w", "numba", "greybox_numba", data, settings, runs=1)
    for name, value in TRUTH.items():
        assert found[name] == pytest.approx(value, rel=0.01)


def test_both_ways_of_reading_a_bag_give_the_same_arrays(tmp_path):
    from idloop.records import Record, write_bag

    t = np.arange(200) * PERIOD
    data = experiment(0.2)
    names = "motor.effort", "V", ("motor.position", "motor.velocity"), ("rad", "rad/s")
    record = Record("m", t, data["command"], t, data["output"], *names)
    settings = {"bag": str(write_bag(tmp_path / "bag", record)), "warm": False}
    none = {"nothing": np.zeros(1)}
    contest = Contest(HERE)
    (_, ours), (_, theirs) = (
        contest.enter("w", who, f"reading_{who}", none, settings, ours=True, runs=1) for who in ("idloop", "rosbags")
    )
    assert ours.keys() == theirs.keys()
    for key in ours:
        np.testing.assert_array_equal(ours[key], theirs[key])


@pytest.mark.slow
def test_a_profile_of_ours_is_written_where_it_is_asked_for(tmp_path):
    plant = PLANTS[0]
    data, settings = plant.numbers() | {"command": steps_of_command(200)}, SIMULATION | {"plant": plant.name}
    contest = Contest(HERE, profiles=tmp_path / "profiles")
    for who in ("idloop", "another"):
        row, _ = contest.enter("A run: of 0.2 s", who, "simulation_idloop", data, settings, ours=True, runs=1)
        assert not row.note
    (file,) = (tmp_path / "profiles").iterdir()
    assert file.name == "a_run_of_0_2_s.txt"
    assert "simulation_idloop.py" in file.read_text()
    assert "cumulative" in file.read_text()


def test_the_torsion_record_is_bounded_and_repeatable():
    u, y = torsion_record(500, 3)
    assert u.shape == (500, 1)
    assert y.shape == (500, 4)
    assert np.max(np.abs(y)) < np.pi
    np.testing.assert_array_equal(y, torsion_record(500, 3)[1])


@pytest.mark.slow
def test_ours_identifies_the_torsion_system():
    from speed.sections.n4sid import free_run_fit

    data = dict(zip("uy", torsion_record(3000, 1), strict=True))
    settings = {"order": 8, "horizon": 28, "warm": False}
    row, answer = Contest(None).enter("w", "idloop", "n4sid_idloop", data, settings, ours=True, runs=1)
    assert row.runs == 1
    assert row.memory is not None
    assert free_run_fit(answer, *torsion_record(2000, 2)) > 90.0


def test_no_environment_and_a_missing_package_are_one_line_each(tmp_path):
    row, answer = Contest(None).enter("w", "peer", "n4sid_sippy", {"u": np.zeros(2)})
    assert (row.note, row.seconds, answer) == ("not installed: no environment for the peers", None, {})
    row, answer = Contest(HERE).enter("w", "peer", "n4sid_sippy", {"u": np.zeros(2)})
    assert (row.note, row.seconds, answer) == ("not installed: sippy_unipi", None, {})


def test_octave_that_is_absent_is_one_line(monkeypatch):
    from speed import slicot

    monkeypatch.setattr(slicot, "octave", lambda: None)
    row, answer = slicot.n4sid_by_slicot(Contest(None), "w", {}, 8, 28, 1)
    assert row.note == "not installed: apt install octave octave-control"
    assert not answer


def test_a_contestant_that_fails_or_hangs_is_one_line():
    failing = run_worker([str(HERE), "-c", "raise SystemExit('it broke')"], 60.0)
    assert failing == {"failed": "it broke"}
    assert run_worker([str(HERE), "-c", "import time; time.sleep(60)"], 0.5) == {"failed": "given up after 0.5 s"}


def test_an_environment_that_cannot_be_made_is_none(tmp_path, capsys):
    from speed.environment import peers_python

    (tmp_path / "file").write_text("")
    (tmp_path / "list.txt").write_text("")
    assert peers_python(tmp_path / "file" / "venv", tmp_path / "list.txt") is None
    assert "no environment for the peers" in capsys.readouterr().err


def example():
    rows = [
        Row("work", "idloop", 0.01, 5, 3.0, {"FIT [%]": 99.0}, agrees=True),
        Row("work", "peer", 0.5, 5, 300.0, {"FIT [%]": 12.0}, agrees=False),
        Row("work", "absent", note="not installed: absent"),
    ]
    claims = [
        Claim("faster", 3.0, 50.0),
        Claim("small", 1.0, 2.0, "MB", at_least=False, limit="the data"),
        Claim("x", 1.0, None),
    ]
    curves = {"growth": {"x": [10, 100], "seconds": [0.1, 1.0], "memory": [None, 2.0], "label": "samples"}}
    return Section("name", "Title: more", rows, claims, ["How."], curves)


def test_tables_say_what_was_reached_and_what_not(tmp_path):
    about = {"when": "today", "machine": "this", "load": "0", "clock": "wall"}
    table.write([example()], about, tmp_path)
    text = (tmp_path / "benchmark.md").read_text(encoding="utf-8")
    assert "| work | idloop | 10 ms | 1 | 3 MB | FIT [%] 99 |" in text
    assert "|  | peer | 500 ms | 50 | 300 MB | FIT [%] 12, **does not agree** |" in text
    assert "|  | absent | not installed: absent | – | – | – |" in text
    assert "| faster | ≥ 3 x | 50 x | yes |" in text
    assert "| small | ≤ 1 MB | 2 MB | **no**: the data |" in text
    assert "| x | ≥ 1 x | – | not measured |" in text
    document = json.loads((tmp_path / "benchmark.json").read_text(encoding="utf-8"))
    assert [claim["met"] for claim in document["sections"][0]["claims"]] == [True, False, None]
    assert document["sections"][0]["rows"][1]["seconds"] == 0.5


def test_pictures_are_drawn_where_there_is_something_to_draw(tmp_path):
    assert plot.draw_beside([example()], tmp_path / "beside.png")
    assert plot.draw_scaling(example().curves, tmp_path / "scaling.png")
    assert not plot.draw_beside([], tmp_path / "none.png")
    assert not plot.draw_scaling({}, tmp_path / "none.png")


@pytest.mark.parametrize(("seconds", "text"), [(None, "–"), (2.0, "2 s"), (0.0123, "12.3 ms"), (4e-6, "4 µs")])
def test_durations_are_told_in_the_unit_that_suits(seconds, text):
    assert table.duration(seconds) == text
