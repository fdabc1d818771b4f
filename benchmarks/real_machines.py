"""What the ladder finds on measured machines, from the plain linear model.

For every data set below the folder IDLOOP_DATA (else ../shared/data beside the checkout):
imports the records, climbs with `idloop.diagnosis.refine`, and prints the errors on the
records that were fitted and on held-out ones at every step, ties, the verdict, the time
taken and the best published figure that is known.

    python benchmarks/real_machines.py                # all sets that are there
    python benchmarks/real_machines.py emps silverbox
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from idloop.diagnosis import Ladder, refine
from idloop.errors import IdloopError
from idloop.estimation import fit
from idloop.physics import Model, load_model
from idloop.records import Record, read_record
from idloop.records.tables.importing import import_bag
from idloop.validation import compare

HERE = Path(__file__).resolve().parent
MODELS = HERE / "real_machines"
OWN_EFFECTS = HERE.parent / "docs" / "examples" / "own_effect" / "effects"


class Data(NamedTuple):
    """Model to start from, records to fit and records held out."""

    model: Model
    train: list[Record]
    held_out: list[Record]


class Machine(NamedTuple):
    """One data set: folder below the data, how it is read, what is published, what is shown at the end."""

    folder: str
    load: Callable[[Path, Path], Data]
    criteria: tuple[str, ...]
    published: str
    finish: Callable[[Ladder, Data], None] | None = None
    mean_absolute: bool = False
    effects: Path | None = None


def imported(source: Path, work: Path, mapping: str, model: Model, part: str | None = None) -> Record:
    """One record of a file, through a bag."""
    bag = work / "_".join(name for name in (source.parent.name, source.stem, part) if name)
    if not bag.exists():
        import_bag(source, bag, mapping, part=part)
    return read_record(bag, model)


def emps(folder: Path, work: Path) -> Data:
    """Ball screw in closed loop; the pulses are held out."""
    model = load_model(MODELS / "emps.yaml")
    train, pulses = (
        imported(folder / name, work, "emps", model).decimate(4) for name in ("DATA_EMPS.mat", "DATA_EMPS_PULSES.mat")
    )
    return Data(model, [train], [pulses])


def emps_free_run(ladder: Ladder, data: Data) -> None:
    """Position from the force alone, over 25 s without any correction, and what limits it."""
    print("free run from the force, final structure refitted by simulation:")
    found = fit(ladder.model, data.train, criterion="simulation")
    model = found.model

    def say(label: str, of: Model) -> None:
        print(f"  {label}: pulses RMSE {1e3 * free_run_rmse(of, data.held_out):.2f} mm", flush=True)

    say("fitted on the train record", model)
    for name, value, stderr in zip(found.names, found.values, found.stderr, strict=True):
        moved = fit(model.with_free([name]), data.held_out, criterion="simulation").model
        say(f"... {name} alone moved from {value:.4g} ± {stderr:.2g} to {moved.values[name]:.4g}", moved)
    say("all of it fitted on the pulses record itself", fit(model, data.held_out, criterion="simulation").model)


def dc_motor(folder: Path, work: Path) -> Data:
    """Slow and medium excitations to fit, faster sines and steps held out."""
    model = load_model(MODELS / "dcmotor.yaml")

    def records(*kinds: str) -> list[Record]:
        found = [min((folder / "npz").glob(f"*_{kind}.npz")) for kind in kinds]
        return [imported(path, work, "dcmotor_fra233", model).decimate(10) for path in found]

    return Data(model, records("Ramp", "Sine_pi-2", "Stair", "Chirp"), records("Sine_pi", "Sine_2pi", "Step"))


def silverbox(folder: Path, work: Path) -> Data:
    """Multisines to fit, the arrow of growing amplitude held out."""
    model = load_model(MODELS / "silverbox.yaml")
    source = folder / "SNLS80mV.csv"
    train, arrow = (imported(source, work, "silverbox", model, part) for part in ("multisine_1", "arrow"))
    return Data(model, [train.cut(0.0, 7.0)], [arrow])


def silverbox_free_run(ladder: Ladder, data: Data) -> None:
    """The final structure refitted for the free run, which is what the published figures judge."""
    model = fit(ladder.model, data.train, criterion="simulation").model
    print(f"refitted by simulation: free run on the arrow {1e3 * free_run_rmse(model, data.held_out):.2f} mV RMSE")


def ced(folder: Path, work: Path) -> Data:
    """Six seconds to fit, the rest held out; no model that is known serves several amplitudes alike."""
    model = load_model(MODELS / "ced.yaml")
    record = imported(folder / "drive.mat", work, "ced", model, "z1")
    first, rest = replace(record.cut(0.0, 6.0), name="z1_fitted"), replace(record.cut(6.0), name="z1_held_out")
    return Data(model, [first], [rest])


def bam(folder: Path, work: Path) -> Data:
    """Servo with a pendulum; two loop gains to fit, two held out; runs with the motor switched off are left out."""
    import json

    model = load_model(MODELS / "bam.yaml")
    train, held_out = [], []
    for path in sorted((folder / "xl330_raw").glob("*.json")):
        head = json.loads(path.read_text())
        if head["trajectory"] == "lift_and_drop":
            continue
        (train if head["kp"] in (100, 400) else held_out).append(imported(path, work, "bam", model))
    return Data(model, train, held_out)


def as_given(folder: Path, work: Path, train: Sequence[str], held_out: Sequence[str], kind: str = "") -> Data:
    """Files of a folder, by the model and the mapping that lie beside them."""
    model = load_model(folder / f"{kind}model.yaml")
    mapping = str(folder / (f"{kind.removesuffix('_')}.yaml" if kind else "map.yaml"))
    parts = [[imported(folder / name, work, mapping, model) for name in names] for names in (train, held_out)]
    return Data(model, *parts)


def screw(folder: Path, work: Path) -> Data:
    """Runs at constant speed; every second one is held out."""
    model = load_model(folder.parent / "model.yaml")
    files = sorted(folder.glob("*.csv"), key=lambda path: int(path.stem.replace("n", "-")))
    records = []
    for path in files:
        # The header of one file is two lines shorter.
        header = path.read_text(errors="replace").partition(";Velocity")[0].count("\n")
        mapping = folder.parent / ("map.yaml" if header > 11 else "map10.yaml")
        records.append(imported(path, work, str(mapping), model))
    return Data(model, records[::2], records[1::2])


def hsm(folder: Path, work: Path) -> Data:
    """Torque steps; two heights to fit, two held out."""
    train = ("neg_0.045_1.csv", "neg_0.045_2.csv", "pos_0.065_1.csv", "pos_0.065_2.csv")
    return as_given(folder, work, train, [name.replace("0.045", "0.04").replace("0.065", "0.06") for name in train])


def odrive(folder: Path, work: Path) -> Data:
    """Slow turns; those with other gains are held out."""
    runs = ("nocomp_0.csv", "nocomp_1.csv")
    return as_given(folder, work, [f"slow2_{name}" for name in runs], [f"slow_goodgains_2_{name}" for name in runs])


def kuka(folder: Path, work: Path) -> Data:
    """One joint of an arm that moves as a whole."""
    return as_given(folder, work, ["train.csv"], ["val.csv"])


def robot_arm(folder: Path, work: Path) -> Data:
    """Joint 6 of a UR10e."""
    return as_given(folder, work, ["ur10e_j6.csv"], ["ur10e_j6_unseen.csv"], "ur_")


MACHINES = {
    "emps": Machine(
        "emps",
        emps,
        ("auto", "force"),
        "force error 3.112 % train, 5.98 % pulses (Janot 2019; 5.39 % for the asymmetric model); free run 2.64 mm",
        emps_free_run,
    ),
    "dcmotor": Machine(
        "dcmotor_fra233",
        dc_motor,
        ("simulation", "auto"),
        "nothing published; a free-run fit by hand reaches 3.89 % train and 5.97 % held out with Coulomb and offset",
    ),
    "silverbox": Machine(
        "silverbox",
        silverbox,
        ("auto",),
        "arrow, free run: GRU 2.80 mV, LSTM 2.68 mV; a cubic ARX 1.76 mV; linear 14.2 mV",
        silverbox_free_run,
    ),
    "ced": Machine(
        "ced_prbs",
        ced,
        ("simulation",),
        "none for these records; by hand, on all of z1, FIT 69.3 % with sensor and belt, 4 % or less with either alone",
        effects=OWN_EFFECTS,
    ),
    "bam": Machine(
        "bam_servo_pendulum",
        bam,
        ("auto",),
        "error more than halved against Coulomb and viscous friction, on other servos (arXiv:2410.08650)",
        mean_absolute=True,
    ),
    "screw1": Machine(
        "screw_drives/drive1",
        screw,
        ("auto",),
        "force error by hand, all runs: viscous friction and offset 53 %, with Coulomb 4.1, with Stribeck 1.4",
    ),
    "screw2": Machine(
        "screw_drives/drive2",
        screw,
        ("auto",),
        "force error by hand, all runs: with Coulomb 1.8 %; Stribeck adds nothing",
    ),
    "hsm": Machine(
        "hsm150",
        hsm,
        ("auto",),
        "by hand, free run of the velocity: linear 22.4 %, with Coulomb 19.6, with offset 5.0 (0.0242 and 0.0092 N·m)",
    ),
    "odrive": Machine(
        "odrive_cogging",
        odrive,
        ("auto",),
        "by hand, force error: linear 98 %, with harmonics 7, 28, 14, 36, 12 and 84 of a turn 18 %",
    ),
    "kuka": Machine("kuka_joint", kuka, ("auto",), "by hand, force error 35 % with inertia and viscous friction"),
    "ur10e": Machine("failing_inputs/05_start_values", robot_arm, ("auto",), "nothing published"),
}


def free_run_rmse(model: Model, records: Sequence[Record]) -> float:
    """Root mean square error of the first output, all samples alike."""
    errors = [compare(model, record) for record in records]
    return float(np.sqrt(np.nanmean(np.concatenate([((c.measured - c.simulated)[:, 0]) ** 2 for c in errors]))))


def mean_absolute(model: Model, records: Sequence[Record]) -> float:
    """Mean absolute error of the first output in free run."""
    errors = [compare(model, record) for record in records]
    return float(np.nanmean(np.concatenate([np.abs(c.measured - c.simulated)[:, 0] for c in errors])))


def show(ladder: Ladder, data: Data, seconds: float, absolute: bool) -> None:
    """The ladder as a table."""

    def figures(errors: dict[str, object], model: Model, records: Sequence[Record]) -> str:
        if not errors:
            return "-"
        name = model.outputs[0].name
        nrmse, force = errors["nrmse"], errors["force"]
        text = f"{100 * nrmse[name]:8.2f} %" if name in nrmse else "       -  "  # type: ignore[operator,index]
        text += f" {100 * force:7.2f} %" if force is not None else "       -  "  # type: ignore[operator]
        return text + (f" {mean_absolute(model, records):8.4f}" if absolute else "")

    extra = "      MAE" if absolute else ""
    print(f"  {'step':44} | train: free run, force{extra} | held out{extra}")
    for step in ladder.steps:
        name = "plain linear model" if step.added is None else step.added.name
        train = figures(step.train, step.model, data.train)
        held_out = figures(step.validation, step.model, data.held_out)
        print(f"  {name:44} | {train} | {held_out}")
        ties = [other for other in step.set if step.added is not None and other != step.added.name]
        if ties:
            print(f"    tied with {', '.join(ties)}")
    print(f"  verdict {ladder.verdict} by {ladder.criterion}, {seconds:.0f} s")
    if ladder.unknown is not None:
        print(f"  {ladder.unknown.text}")
    values = ", ".join(f"{k} {v:.4g}" for k, v in ladder.model.values.items() if k in ladder.model.free)
    print(f"  {values}")


def announce(began: float) -> Callable[[Ladder], None]:
    """Say each step as it comes: a climb takes minutes."""

    def say(ladder: Ladder) -> None:
        print(f"  ... {ladder.added[-1]} at {time.monotonic() - began:.0f} s", flush=True)

    return say


def climb(name: str, machine: Machine, folder: Path, work: Path) -> bool:
    """One data set; False when it could not be climbed."""
    print(f"\n{name}\n  published: {machine.published}")
    if not (folder / machine.folder).is_dir():
        print(f"  no {folder / machine.folder}: set IDLOOP_DATA to the folder of the measured data")
        return True
    if machine.effects is not None:
        os.environ["IDLOOP_EFFECTS"] = str(machine.effects)
    try:
        data = machine.load(folder / machine.folder, work)
        for criterion in machine.criteria:
            began = time.monotonic()
            ladder = refine(data.model, data.train, data.held_out, criterion=criterion, on_step=announce(began))
            show(ladder, data, time.monotonic() - began, machine.mean_absolute)
            if machine.finish is not None:
                machine.finish(ladder, data)
            sys.stdout.flush()
    except IdloopError as error:
        print(f"  failed: {error}")
        return False
    finally:
        if machine.effects is not None:
            os.environ.pop("IDLOOP_EFFECTS")
    return True


def main() -> int:
    """Climb on all sets that are asked for and there."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sets", nargs="*", metavar="set", help=f"of {', '.join(MACHINES)}; all when none is named")
    chosen = parser.parse_args().sets or list(MACHINES)
    strange = [name for name in chosen if name not in MACHINES]
    if strange:
        parser.error(f"no set {strange[0]}; choose from {', '.join(MACHINES)}")
    folder = Path(os.environ.get("IDLOOP_DATA", HERE.parent.parent / "shared" / "data"))
    if not folder.is_dir():
        print(f"no measured data in {folder}: set IDLOOP_DATA to their folder")
        return 0
    warnings.filterwarnings("ignore", message=".*unit.*")
    with tempfile.TemporaryDirectory() as work:
        done = [climb(name, MACHINES[name], folder, Path(work)) for name in chosen]
    return 0 if all(done) else 1


if __name__ == "__main__":
    sys.exit(main())
