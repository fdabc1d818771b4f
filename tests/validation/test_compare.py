import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from idloop.errors import IdloopError, InputError
from idloop.estimation import fit
from idloop.physics import Model, load_model
from idloop.physics.engine import Engine
from idloop.records import Record, read_record
from idloop.validation import Comparison, compare, fit_percent, force_error


def servo(noise: float = 0.0, seed: int = 0) -> tuple[Model, Record]:
    """An axis under a smooth command, position measured, and its record."""
    model = load_model("emps").with_effects(["coulomb_friction@axis(level=20)"])
    rng = np.random.default_rng(seed)
    time = np.asarray(np.arange(0.0, 8.0, 1e-3), dtype=np.float64)
    command = 1.5 * np.sin(2 * np.pi * 0.7 * time) + 0.8 * np.sin(2 * np.pi * 1.9 * time)
    output = Engine(model).simulate(None, time, command, time) + noise * rng.normal(size=(len(time), 1))
    record = Record(
        "servo", time, command, time, output, model.input.name, "V", model.output_names, ("m",)
    )  # fmt: skip
    return model, record


def one_step(result: Comparison) -> float:
    """FIT of the one-step prediction of the position [%]."""
    return float(fit_percent(result.measured, result.predicted)[0])


def test_the_true_model_explains_everything() -> None:
    model, record = servo()
    result = compare(model, record)
    assert result.fit["axis.position"] > 99.99
    assert result.fit_ahead["axis.position"] > 99.99
    assert result.force is not None
    # What is left is the corner of dry friction, rounded by the band limit.
    assert result.force.relative < 0.08


def test_a_missing_effect_shows_on_the_drive_side() -> None:
    model, record = servo()
    without = compare(model.without_effect("coulomb_friction@axis"), record)
    assert without.force is not None
    assert without.force.relative > 0.2


def test_prediction_ten_steps_ahead_lies_between_one_step_and_free_run() -> None:
    model, record = servo(noise=1e-4)
    wrong = model.with_values({"coulomb_friction@axis.level": 10.0})
    result = compare(wrong, record)
    assert result.fit["axis.position"] < result.fit_ahead["axis.position"] < one_step(result)


def test_a_subset_of_the_samples_is_enough_for_the_disturbance(monkeypatch: pytest.MonkeyPatch) -> None:
    model, record = servo(noise=1e-4)
    wrong = model.with_values({"coulomb_friction@axis.level": 17.0})
    whole = compare(wrong, record)
    # The package has a function of the module's name.
    monkeypatch.setattr(sys.modules["idloop.validation.runs"], "SUBSET_SAMPLES", len(record.time) // 5)
    quick = compare(wrong, record)
    assert one_step(quick) == pytest.approx(one_step(whole), abs=0.02)
    assert np.std(quick.innovation - whole.innovation) < 0.05 * np.std(whole.innovation)


def test_initial_state_is_found() -> None:
    model, record = servo()
    late = record.cut(2.0, 8.0)
    assert compare(model, late).fit["axis.position"] > 99.9


def test_everything_in_one_document() -> None:
    model, record = servo(noise=1e-5)
    result = compare(model, record)
    document = result.to_dict()
    assert set(document) >= {"free_run", "one_step", "ahead", "force", "share", "residual"}
    assert document["ahead"]["steps"] == 10


def test_a_model_that_runs_away_has_a_drive_side() -> None:
    """An inertia that a force balance could not tell from none."""
    model, record = servo(noise=1e-5)
    gone = model.with_effects(["presliding_friction@axis"])
    least = gone.parameter("axis.inertia").min
    gone = gone.with_values({"axis.inertia": least, "presliding_friction@axis.stiffness": 1e6})
    result = compare(gone, record)
    assert not np.any(np.isfinite(result.simulated))
    assert not np.any(np.isfinite(result.innovation))
    assert result.force is not None
    assert result.to_dict()["force"]["relative_error"] > 0.0
    sparse = record.output.copy()
    sparse[::2] = np.nan
    with pytest.raises(IdloopError, match="stays finite"):
        compare(gone, replace(record, output=sparse))


def test_bad_requests() -> None:
    model, record = servo()
    with pytest.raises(InputError, match="horizon"):
        compare(model, record, steps=0)
    holes = record.output.copy()
    holes[::2] = np.nan
    sparse = replace(record, output=holes)
    with pytest.raises(InputError, match="steady rate"):
        force_error(model, sparse)
    assert compare(model, sparse).force is None


def bag(tmp_path_factory: pytest.TempPathFactory, source: Path, mapping: str) -> Path:
    from idloop.records.tables.importing import import_bag

    if not source.exists():
        pytest.skip(f"no {source}: set IDLOOP_DATA to the folder of the measured data")
    target = tmp_path_factory.mktemp(mapping) / source.stem
    import_bag(source, target, mapping)
    return target


@pytest.fixture(scope="module")
def emps(data_dir: Path, tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, Model], Record]:
    """Reader of the two EMPS records through our own import."""
    bags = {
        name: bag(tmp_path_factory, data_dir / "emps" / f"{name}.mat", "emps")
        for name in ("DATA_EMPS", "DATA_EMPS_PULSES")
    }
    return lambda name, model: read_record(bags[name], model)


@pytest.mark.slow
def test_emps_as_published(emps: Callable[[str, Model], Record]) -> None:
    model = load_model("emps").with_effects(["coulomb_friction@axis", "input_offset@input"])
    train, pulses = emps("DATA_EMPS", model), emps("DATA_EMPS_PULSES", model)
    result = fit(model, [train])
    assert result.criterion == "force"
    values = result.model.values
    assert values["axis.inertia"] == pytest.approx(95.1, rel=0.005)
    assert values["axis.viscous_friction"] == pytest.approx(203.5, rel=0.02)
    assert values["coulomb_friction@axis.level"] == pytest.approx(20.4, rel=0.02)
    # The publication's offset stands on the other side of the balance.
    assert -values["input_offset@input.offset"] * values["drive.gain"] == pytest.approx(-3.16, rel=0.05)
    first = force_error(result.model, train)
    assert first.relative <= 0.042
    assert force_error(result.model, pulses, first.cutoff).relative <= 0.061


@pytest.mark.slow
def test_emps_without_dry_friction_misses_the_force(emps: Callable[[str, Model], Record]) -> None:
    model = load_model("emps")
    train, pulses = emps("DATA_EMPS", model), emps("DATA_EMPS_PULSES", model)
    result = fit(model, [train])
    first = force_error(result.model, train)
    assert first.relative == pytest.approx(0.18, abs=0.01)
    assert force_error(result.model, pulses, first.cutoff).relative == pytest.approx(0.18, abs=0.01)


def test_a_hole_in_the_record_is_no_missing_force() -> None:
    model, record = servo()
    whole = force_error(model, record, 40.0)
    keep = (record.time < 3.0) | (record.time > 3.6)
    cut = replace(record, time=record.time[keep], output=record.output[keep])
    lost = record.output.copy()
    lost[~keep & (record.time < 3.3)] = np.nan
    for holed in (cut, replace(record, output=lost)):
        found = force_error(model, holed, 40.0)
        assert found.relative < 1.5 * whole.relative
        assert not np.any((found.time > 3.0) & (found.time < 3.3))


def test_forces_stand_at_the_instants_of_the_motion() -> None:
    model, record = servo()
    found = force_error(model, record)
    assert np.all(np.isin(found.time, record.time))
    # The command is the applied force over the gain, but for the band limit.
    gain = model.values["drive.gain"]
    assert np.linalg.norm(gain * found.command - found.applied) < 0.02 * np.linalg.norm(found.applied)
