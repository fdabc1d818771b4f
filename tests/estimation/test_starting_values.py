"""A fit does not depend on its starting values, thirty times larger or smaller ones included."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest

from idloop.estimation import FitResult, fit
from idloop.physics import Model, Plant, load_model
from idloop.records import Record, read_records
from idloop.records.public_data import public_data
from idloop.records.tables.importing import import_bag

FAR = 30.0


def starts(model: Model, *, each: bool = True) -> Iterator[dict[str, float]]:
    """Values of the free parameters: all of them far off, and each in its turn."""
    for factor in (FAR, 1.0 / FAR):
        yield {name: factor * model.values[name] for name in model.free}
        if each:
            yield from ({name: factor * model.values[name]} for name in model.free)


def same(result: FitResult, other: FitResult) -> bool:
    """Whether two fits are one, to a part of their standard errors."""
    apart = np.abs(result.values - other.values) < 0.2 * np.minimum(result.stderr, other.stderr)
    return result.criterion == other.criterion and bool(np.all(apart))


@pytest.fixture(scope="module")
def axis() -> Model:
    """A sledge with dry friction whose mass, friction and level are free."""
    model = load_model("emps").with_free(["axis.inertia", "axis.viscous_friction"])
    return model.with_effects(["coulomb_friction@axis(level=20)"])


def recorded(axis: Model, *, loop: bool) -> Record:
    """Eight seconds at 100 Hz with a noisy position, under random steps or held on a reference."""
    plant, random = Plant(axis, seed=2, noise=False), np.random.default_rng(2)
    time = np.asarray(np.arange(800) * 0.01, dtype=np.float64)
    wanted = np.repeat(random.uniform(-1.0, 1.0, 40), 20)
    output, command = np.empty((len(time), 1)), np.empty(len(time))
    before = 0.0
    for k, t in enumerate(time):
        output[k] = plant.measure() + 1e-4 * random.normal()
        speed, before = (output[k, 0] - before) / 0.01, output[k, 0]
        drive = 30.0 * (0.1 * wanted[k] - before) - 3.0 * speed if loop else 3.0 * wanted[k]
        command[k] = np.clip(drive, -10.0, 10.0)
        plant.step(command[k], t + 0.01)
    return Record("axis", time, command, time, output, axis.input.name, "V", axis.output_names, ("m",))


@pytest.mark.slow
@pytest.mark.parametrize("loop", [False, True])
def test_every_start_leads_to_the_same_fit(axis: Model, loop: bool) -> None:
    record = recorded(axis, loop=loop)
    first = fit(axis, [record])
    assert np.all(np.abs(first.values - axis.theta) < 5.0 * first.stderr)
    for start in starts(axis):
        assert same(fit(axis.with_values(start), [record]), first), start


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "mapping", "files", "effect"),
    [
        ("wpi_model.yaml", "wpi.yaml", ["wpi_sf.csv", "wpi_ff.csv"], "coulomb_friction@m"),
        ("ur_model.yaml", "ur.yaml", ["ur10e_j6.csv"], "coulomb_friction@j6"),
    ],
)
def test_a_robot_s_joint_and_a_drive_s_sweep_are_the_same_from_every_start(
    tmp_path: Path, name: str, mapping: str, files: Sequence[str], effect: str
) -> None:
    data = public_data("failing_inputs/05_start_values")
    if data is None:
        pytest.skip("no measured data: set IDLOOP_DATA")
    model = load_model(data / name).with_effects([effect])
    bags = [import_bag(data / file, tmp_path / file, data / mapping).bag for file in files]
    records = read_records(bags, model)
    first = fit(model, records)
    for start in starts(model, each=False):
        assert same(fit(model.with_values(start), records), first), start
