"""The demo: a hidden effect found on a live graph; behind --loop, estimates that agree."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from idloop.cli import main
from idloop.cli._demo_loop import distance, windows_of
from idloop.cli.verbs.demo import HIDDEN, MACHINE, choose_hidden, retell
from idloop.cli.verbs.refine import read_ladder
from idloop.physics import load_model


def run(words: list[str], environment: dict[str, str], domain: int) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "idloop", "demo", *words, "--domain", str(domain)],
        env=environment | {"IDLOOP_DATA": os.devnull},
        capture_output=True,
        text=True,
        timeout=1200,
        check=False,
    )


@pytest.mark.ros
@pytest.mark.slow
@pytest.mark.timeout(1300)
def test_the_hidden_effect_is_found(tmp_path: Path, ros_environment: dict[str, str], ros_domain_id: int) -> None:
    folder = tmp_path / "demo"
    done = run(["--directory", str(folder), "--json"], ros_environment, ros_domain_id)
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    assert document["failures"] == []
    assert document["found"]
    assert document["hidden"].startswith("dead_zone@input")
    assert document["above_floor"] < 1.25
    first = document["diagnoses"][0]
    assert {"dead_zone@input", "coulomb_friction@motor"} <= set(first["set"]), "one direction cannot tell them apart"
    assert first["where"]
    assert document["experiments"]
    assert [one["set"] for one in document["diagnoses"] if one["verdict"] == "missing"][-1] == ["dead_zone@input"]
    kept = read_ladder(folder)
    assert kept.ladder.added == ("dead_zone@input",)
    assert kept.bags == ((folder / "bag").resolve(),)
    for name in ("model.yaml", "ladder.png", "compare.png", "bag/metadata.yaml"):
        assert (folder / name).is_file()


@pytest.mark.ros
@pytest.mark.slow
@pytest.mark.timeout(1300)
def test_the_loop_runs_from_end_to_end(tmp_path: Path, ros_environment: dict[str, str], ros_domain_id: int) -> None:
    words = ["--loop", "--graph", "dc_motor", "--seconds", "15", "--directory", str(tmp_path / "demo"), "--json"]
    done = run(words, ros_environment, ros_domain_id)
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    (story,) = document["runs"]
    assert document["failures"] == []
    assert story["worst_fit"] > 95.0
    assert story["apart"]["the replay"] == 0.0
    for name, truth in story["truth"].items():
        found = story["offline"][name]
        assert abs(found["value"] - truth) < 4.0 * found["stderr"]
    assert (tmp_path / "demo" / "dc_motor" / "metadata.yaml").is_file()


def test_a_seed_hides_the_same_effect_each_time_and_another_seed_another_one() -> None:
    texts = [choose_hidden(seed) for seed in range(2 * len(HIDDEN))]
    assert texts == [choose_hidden(seed) for seed in range(2 * len(HIDDEN))]
    assert len(set(texts)) == len(texts)
    assert {text.partition("(")[0] for text in texts} == {name for name, *_ in HIDDEN}
    for text in texts:
        assert load_model(MACHINE).with_effects([text]).effect_names


def test_an_unknown_effect_is_refused_before_anything_is_started(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    folder = tmp_path / "demo"
    assert main.run(["demo", "--hide", "dead_zon@input", "--directory", str(folder)]) == 2
    assert "dead_zone" in capsys.readouterr().err
    assert not folder.exists()


def test_the_story_is_told_from_the_log() -> None:
    head = "[INFO] [1795268556.931469003] [estimator]: "
    fit = "FIT motor.position 86.7 % on 5.0 s not used in the fit: drive.gain = 8.2539 ± 0.0087 N·m/V"
    assert retell("estimator", head + fit) == "model    FIT motor.position 86.7 % on 5.0 s not used in the fit"
    assert retell("estimator", head + "diagnosis: slip@motor is missing") == "missing  slip@motor is missing"
    assert (
        retell("estimator", head + "the residual is not white: diagnose on 30 s")
        == "why      the residual is not white"
    )
    assert retell("plant", "[INFO] [1.2] [plant]: start: dc_motor, 100 Hz") == "live     dc_motor, 100 Hz"
    assert retell("plant", "[WARN] [1.2] [plant]: waits for estimator") == "!        plant: waits for estimator"
    assert retell("recorder", "[INFO] [1.2] [recorder]: recording 10 topics") is None
    assert retell("estimator", head + "something for the log alone") is None


def test_the_distance_of_two_estimates_is_in_combined_standard_errors() -> None:
    one = {"a": {"value": 1.0, "stderr": 0.3}, "b": {"value": 5.0, "stderr": None}}
    other = {"a": {"value": 2.0, "stderr": 0.4}, "b": {"value": 5.0, "stderr": None}}
    assert distance(one, other) == pytest.approx(2.0)
    other["b"]["value"] = 5.1
    assert distance(one, other) == float("inf")


@pytest.mark.parametrize("seconds", [6.0, 20.0, 60.0, 600.0])
@pytest.mark.parametrize("graph", ["dc_motor", "torsion"])
def test_a_live_run_has_room_for_two_fits(graph: str, seconds: float) -> None:
    windows = windows_of(graph, seconds)
    assert windows.window + windows.validation + windows.period <= seconds
