"""`idloop monitor`: alarms for a worn machine, none for a healthy one, and it says what it cannot tell."""

from __future__ import annotations

import json
from dataclasses import replace
from types import SimpleNamespace

import pytest

from idloop.cli import main

LEVEL = "coulomb_friction@motor.level"


@pytest.fixture(scope="module")
def machine(tmp_path_factory) -> SimpleNamespace:
    """A motor's model file, and bags of it: healthy ones, a worn one, and one in which half is healthy."""
    from idloop.diagnosis.design.experiment import Experiment
    from idloop.physics import load_model
    from idloop.records import write_bag

    folder = tmp_path_factory.mktemp("wear")
    model = load_model("dc_motor").with_effects(["coulomb_friction@motor(level=0.8)"])
    outputs = tuple(replace(o, noise=n) for o, n in zip(model.outputs, (0.005, 0.02), strict=True))
    model = replace(model, outputs=outputs, controller=None)
    model.save(folder / "model.yaml")

    def bag(name: str, seconds: float, seed: int, growth: float = 0.0):
        given = {"name": "multilevel", "amplitude": 3.0, "sample_time": 0.01, "duration": seconds, "seed": seed}
        run = Experiment(given).run(
            model.with_values({LEVEL: 0.8 + growth}), noise=True, disturbance=0.2, seed=seed, name=name
        )
        return write_bag(folder / name, run)

    return SimpleNamespace(
        folder=folder,
        model=folder / "model.yaml",
        reference=bag("reference", 240.0, 1),
        healthy=bag("healthy", 120.0, 2),
        worn=bag("worn", 120.0, 3, 0.16),
    )


def run(machine, *arguments):
    places = {"MODEL": machine.model, "HEALTHY": machine.healthy, "WORN": machine.worn, "REFERENCE": machine.reference}
    return main.run(["monitor", *(str(places.get(a, a)) for a in arguments)])


@pytest.mark.slow
def test_growth_alarms_and_health_does_not(machine, capsys):
    assert run(machine, "MODEL", "HEALTHY", "WORN", "--reference", "REFERENCE", "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert found["schema"] == "idloop/monitor/1"
    assert found["false_alarm_hours"] == 1000.0
    assert found["may_vary"] == ["motor.viscous_friction"]
    (watch,) = found["watches"]
    assert (watch["parameter"], watch["unit"], watch["state"]) == (LEVEL, "N·m", "alarm")
    assert watch["growth"]["low"] < 0.16 < watch["growth"]["high"]
    assert 0.0 < watch["delay"] < 60.0
    assert {alarm["record"] for alarm in found["alarms"]} == {"worn"}
    first = found["alarms"][0]
    assert 0.0 < first["onset"] < first["time"] < 60.0


@pytest.mark.slow
def test_in_words_with_units(machine, capsys):
    assert run(machine, "MODEL", "WORN", "--reference", "REFERENCE", "--watch", "coulomb_friction@motor=0.16") == 0
    out = capsys.readouterr().out
    for word in ("promised: one false alarm in 1000 h", "N·m", "alarm at s", "newest growth", f"{LEVEL}: alarm"):
        assert word in out
    assert run(machine, "MODEL", "HEALTHY", "--reference", "REFERENCE", "--false-alarms", "per week") == 0
    out = capsys.readouterr().out
    assert "168 h" in out
    assert "no sign of a change" in out


def test_without_a_reference_the_start_is_healthy(machine, capsys):
    assert run(machine, "MODEL", "REFERENCE", "--learn", "160", "--false-alarms", "per 100 h", "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert found["reference_duration"] == pytest.approx(160.0, abs=0.1)
    assert found["watches"][0]["state"] == "quiet"


def test_a_promise_that_cannot_be_kept_is_not_made(machine, capsys):
    assert run(machine, "MODEL", "HEALTHY", "--watch", "coulomb_friction@motor=2%") == 0
    out = capsys.readouterr().out
    assert "this data cannot tell" in out
    assert "times as long" in out


@pytest.mark.slow
def test_the_figure_is_written(machine, capsys):
    path = machine.folder / "wear.png"
    assert run(machine, "MODEL", "HEALTHY", "WORN", "--reference", "REFERENCE", "--plot", path) == 0
    assert path.stat().st_size > 10_000


@pytest.mark.parametrize(
    ("arguments", "word"),
    (
        (("MODEL",), "BAG"),
        (("MODEL", "nowhere"), "nowhere"),
        (("dc_motor", "HEALTHY"), "--watch|add an effect"),
        (("MODEL", "HEALTHY", "--watch", "coulomb_friction@motr"), "did you mean"),
        (("MODEL", "HEALTHY", "--false-alarms", "never"), "per 1000 h"),
        (("MODEL", "HEALTHY", "--vary", "drive.gian"), "drive.gain"),
        (("MODEL", "HEALTHY", "--learn", "500"), "nothing is left"),
        (("MODEL", "HEALTHY", "--learn", "50", "--reference", "REFERENCE"), "use one"),
        (("MODEL", "HEALTHY", "--block", "0"), "block"),
    ),
)
def test_wrong_use_is_one_line(arguments, word, machine, capsys):
    import re

    assert run(machine, *arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert re.search(word, err)
