"""Records: read from bags, and simulated by a model's machine."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from idloop.errors import InputError

if TYPE_CHECKING:
    from idloop.arrays import Array
    from idloop.physics import Condition, Model
    from idloop.records import Record
    from idloop.records.align import ModelSignals
    from idloop.signals import Signal


def paths_of(given: str | Path | Iterable[str | Path]) -> list[Path]:
    """One path or several, as a list."""
    return [Path(given)] if isinstance(given, str | Path) else [Path(one) for one in given]


def existing_bag(path: str | Path) -> Path:
    """Return the path of a bag; InputError where there is none."""
    if not Path(path).exists():
        raise InputError(f"no bag {path}: check the path (recordings go to bags/ by default)")
    return Path(path)


def read_bags(
    bags: str | Path | Iterable[str | Path], model: ModelSignals, *, fitted: bool = True, excited: bool = True
) -> list[Record]:
    """Read the streams that a model names: a record for each run of the clock in each bag.

    Parameters
    ----------
    bags : path or iterable of path
        Bags of any ROS distribution (sqlite3 or mcap), folders or files.
    model : Model
        Names topics, joints, fields and units.
    fitted : bool
        Refuse a motion that no fit can use.
    excited : bool
        Refuse bags in which no command ever changes.

    Returns
    -------
    list of Record
        What was noticed while reading is in the `findings` of each.

    Raises
    ------
    InputError
        What cannot be read, a bag given twice, data that no fit can use.
    """
    from idloop import records

    paths = [existing_bag(bag) for bag in paths_of(bags)]
    seen: set[Path] = set()
    for path in paths:
        if path.resolve() in seen:
            raise InputError(f"{path} is given twice: one recording counts once; leave it out, or give another")
        seen.add(path.resolve())
    found = records.read_records(paths, model)
    if fitted and excited:
        found = records.check_commands(found)
    return records.usable_parts(found, records.check_identifiable) if fitted else found


def read_bag(bag: str | Path, model: Model) -> Record:
    """Read the streams that a model names from a bag; of several runs or parts between gaps the longest.

    Parameters
    ----------
    bag : str or Path
    model : Model

    Returns
    -------
    Record
        A finding says so where only a part of the bag is returned.

    Raises
    ------
    InputError
        The bag cannot be read, or holds nothing that the model names.
    """
    from dataclasses import replace

    from idloop import records
    from idloop.records.align import output_scales
    from idloop.records.inspection.velocity_check import without_wrong_velocities

    parts = records.cut_at_gaps(records.read_record(existing_bag(bag), model, check=False))
    longest = max(parts, key=lambda part: part.time.size)
    if len(parts) > 1:
        text = f"only the longest part is shown, {longest.time[0]:.6g} to {longest.time[-1]:.6g} s"
        finding = records.Finding("cut", text, where=longest.name, level="warning")
        longest = replace(longest, findings=(*parts[0].findings, finding))
    checked = records.check_record(longest, held=model.input.kind == "held")
    (record,) = without_wrong_velocities([checked], output_scales(model))
    return record


def simulate(
    model: Model,
    signal: Signal | Array | Sequence[float],
    *,
    sample_time: float | None = None,
    controller: Mapping[str, Any] | bool | None = None,
    seed: int = 0,
    noise: bool = True,
    name: str = "simulation",
    conditions: Iterable[Condition] = (),
) -> Record:
    """Simulate the machine that a model describes, and return its record.

    Parameters
    ----------
    model : Model
        The machine, hidden effects included; at rest at position 0.
    signal : Signal or array_like, shape (n,)
        The command [unit of the model's input]; in closed loop the reference of the controlled output.
    sample_time : float, optional
        Between samples of an array [s]; a `Signal` has its own.
    controller : mapping or bool, optional
        Section of a controller, or True for the model's own: the loop is closed.
    seed : int
        Of the measurement noise.
    noise : bool
        Add the measurement noise that the model's outputs state.
    name : str
        Of the record.
    conditions : iterable of Condition
        Temperature, supply, ... by time.

    Returns
    -------
    Record
        A measurement at every sample of the signal.

    Raises
    ------
    InputError
        No sample time, a controller of another period, or a model without a controller.

    Examples
    --------
    >>> import idloop
    >>> motor = idloop.load_model("dc_motor")
    >>> idloop.simulate(motor, [0.0, 1.0, 1.0], sample_time=0.01).output.shape
    (3, 2)
    """
    import numpy as np

    from idloop.records import record_from_model
    from idloop.signals import Signal as BuiltSignal

    given = tuple(conditions)
    rate = None
    if isinstance(signal, BuiltSignal):
        value, period, rate = signal.value, signal.sample_time, signal.rate
    else:
        value = np.asarray(signal, dtype=np.float64)
        if sample_time is None or not sample_time > 0.0:
            raise InputError(f"sample_time is {sample_time}: give the time between samples of the array in seconds")
        period = sample_time
    if value.ndim != 1 or value.size < 2:
        raise InputError(f"signal {value.shape}: give one value for each sample, two samples at least")
    if controller is None or controller is False:
        from idloop.physics.simulation import simulate as run

        time = np.arange(value.size, dtype=np.float64) * period
        deviations = np.array([(output.noise or 0.0) if noise else 0.0 for output in model.outputs])
        drawn = deviations * np.random.default_rng(seed).normal(size=(time.size, deviations.size))
        output = run(model, time, value, time, noise=drawn, conditions=given or None).output
        record = record_from_model(name, model, time, value, output)
    else:
        from idloop.control import build_controller
        from idloop.control.tracking import track
        from idloop.physics import Plant

        section = model.controller if controller is True else controller
        if not isinstance(section, Mapping):
            raise InputError(f"model {model.name} names no controller: give one, or add a section `controller`")
        built = build_controller({"sample_time": period, **section})
        if not np.isclose(built.sample_time, period, rtol=1e-9):
            raise InputError(f"the controller has a period of {built.sample_time:g} s, the signal one of {period:g} s")
        speed = np.gradient(value, period) if rate is None else rate
        reference = np.column_stack([value, speed]).astype(np.float64)
        plant = Plant(model, seed=seed, noise=noise, conditions=given or None)
        run_ = track(plant, built, reference)
        record = record_from_model(name, model, run_.time, run_.command, run_.output, reference)
    if not given:
        return record
    from dataclasses import replace

    return replace(record, conditions=given)
