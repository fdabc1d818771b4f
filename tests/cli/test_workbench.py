"""`idloop workbench`: says where the page is, serves it, and ends cleanly."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

import numpy as np
import pytest

from idloop.cli.main import run

pytest.importorskip("bokeh", reason="no Bokeh: launch_scripts/test installs it")


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    from idloop.physics import load_model, simulate
    from idloop.records import Record, write_bag

    model = load_model("dc_motor")
    time = 0.01 * np.arange(600)
    command = np.repeat(np.random.default_rng(1).uniform(-3.0, 3.0, 15), 40)
    output = simulate(model, time, command, time).output
    record = Record(
        "run", time, command, time, output, "motor.effort", "V",
        tuple(model.output_names), tuple(o.unit for o in model.outputs), start_ns=10**9,
    )  # fmt: skip
    folder = tmp_path_factory.mktemp("bags") / "run"
    write_bag(folder, record)
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_it_says_where_the_page_is_and_ends_cleanly(bag, number):
    command = [sys.executable, "-m", "idloop", "workbench", "dc_motor", str(bag), "--no-browser", "--json"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env={**os.environ, "PYTHONUNBUFFERED": "1"}
    ) as process:
        try:
            text = ""
            for line in process.stdout:
                text += line
                if line.startswith("}"):
                    break
            assert text, process.stderr.read()
            document = json.loads(text)
            assert document["schema"] == "idloop/workbench/1"
            with urllib.request.urlopen(document["address"], timeout=200) as page:
                assert "What is missing" in page.read().decode()
            process.send_signal(number)
            out, err = process.communicate(timeout=200)
        finally:
            process.kill()
    assert process.returncode == 0
    assert out == ""
    assert "Traceback" not in err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["dc_motor"], "BAG"),
        (["dc_motr", "{bag}"], "dc_motr"),
        (["dc_motor", "nowhere"], "no bag nowhere"),
        (["torsion", "{bag}"], "load1"),
        (["dc_motor", "{bag}", "--address", "203.0.113.7"], "203.0.113.7"),
        (["dc_motor", "{bag}", "--output", "{bag}/metadata.yaml"], "is a file"),
    ],
)
def test_wrong_use_is_one_line_and_exit_code_2(bag, arguments, said, capsys):
    assert run(["workbench", *(word.format(bag=bag) for word in arguments), "--no-browser"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    lines = [line for line in err.splitlines() if line.startswith("idloop workbench")]
    assert len(lines) == 1
    assert said in lines[0]


def test_every_step_is_left_in_the_folder(bag, tmp_path):
    from idloop.cli.verbs.workbench import _keeper
    from idloop.diagnosis import Ladder, Step
    from idloop.physics import load_model

    model = load_model("dc_motor")
    keep = _keeper(tmp_path / "kept", (bag,), (), model)
    keep(Ladder((Step(None, model),)))
    document = json.loads(Path(tmp_path / "kept" / "ladder.json").read_text(encoding="utf-8"))
    assert document["bags"] == [str(bag.resolve())]
    assert _keeper(None, (bag,), (), model) is None
