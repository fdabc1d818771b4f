"""Makes the pictures of the gallery: a log of a motor with a hidden dead zone, from the file to the answer.

.venv/bin/python docs/gallery.py
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from workbench_picture import take_picture

import idloop

PICTURES = Path(__file__).parent / "images" / "gallery"
PROGRAM = [sys.executable, "-m", "idloop"]


def write_log(path: Path, seed: int) -> None:
    """A log as a microcontroller prints it: duty cycle in percent, encoder counts, revolutions per minute."""
    motor = idloop.load_model("dc_motor").with_effects(["dead_zone@input(width=0.6)"])
    signal = idloop.excitation("multilevel", sample_time=0.01, duration=20.0, amplitude=3.0, seed=seed)
    run = idloop.simulate(motor, signal, noise=False)
    noise = np.random.default_rng(seed).normal(size=run.time.size)
    counts = np.round(run.output[:, 0] * 4096 / (2 * np.pi)) % 4096
    speed = run.output[:, 1] * 30 / np.pi + 0.3 * noise
    columns = np.column_stack([1e3 * run.time, run.input_at(run.time), counts, speed])
    np.savetxt(path, columns, delimiter=",", header="time_ms,voltage_V,encoder,rpm", comments="", fmt="%.6g")


def run(*words: str | Path) -> None:
    """Run a verb; it must succeed."""
    subprocess.run([*PROGRAM, *map(str, words)], check=True, stdout=subprocess.DEVNULL)


def picture_of_workbench(folder: Path) -> None:
    """The workbench after the missing effect was found."""
    words = ["workbench", "fitted.yaml", "bags/train", "--validate", "bags/unseen", "--no-browser", "--json"]
    where = (folder / "begun").resolve()
    with subprocess.Popen([*PROGRAM, *words], stdout=subprocess.PIPE, text=True, cwd=where) as served:
        assert served.stdout is not None  # noqa: S101  (it is a pipe)
        try:
            text = ""
            while not text.rstrip().endswith("}"):
                text += served.stdout.readline()
            take_picture(json.loads(text)["address"], PICTURES / "workbench.png", folder=str(where))
        finally:
            served.terminate()


def main() -> None:
    """Make every picture anew."""
    PICTURES.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for file, seed in (("train", 1), ("unseen", 2)):
            write_log(folder / f"{file}.csv", seed)
        begun, bags = folder / "begun", folder / "begun" / "bags"
        run("start", folder / "train.csv", folder / "unseen.csv", "--output", begun)
        (PICTURES / "start.png").write_bytes((begun / "log.png").read_bytes())
        run("inspect", bags / "train", "--plot", PICTURES / "inspect.png")
        refined = folder / "refined"
        run("refine", begun / "fitted.yaml", bags / "train", "--validate", bags / "unseen", "--output", refined)
        run(
            "compare",
            begun / "fitted.yaml",
            refined / "model.yaml",
            bags / "unseen",
            "--plot",
            PICTURES / "compare.png",
        )
        run("report", refined, "--picture", PICTURES / "report.png")
        picture_of_workbench(folder)


if __name__ == "__main__":
    main()
