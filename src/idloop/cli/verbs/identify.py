"""`idloop identify`: black-box models of a bag by any method, compared on the same data."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import click

from idloop.api.identification import Grids, describe, even_grids, grids_of, identify, identify_one
from idloop.api.result import ignore_progress
from idloop.cli import _inputs, _outputs
from idloop.cli._identification_arguments import (
    MEASURED,
    SWEPT,
    NumbersArgument,
    Sweep,
    check_save,
    check_structure,
    parse_structure,
    parse_sweep,
)
from idloop.cli._progress import progress
from idloop.cli.main import DONE
from idloop.errors import IdloopError, InputError
from idloop.reporting.text.identification import methods_blocks, sweep_blocks
from idloop.validation.identification_outcome import (
    Outcome,
    best_values,
    excitation_measure,
    mean,
    on_the_same_samples,
    smallest_orders,
)

if TYPE_CHECKING:
    from idloop.estimation.black_box.method import Choices
    from idloop.estimation.black_box.sampled import SampledData
    from idloop.physics import Model
    from idloop.records.bags.axis_signals import AxisSignals
    from idloop.reporting.plots.identification import SweepLine

SCHEMA = "idloop/identify/1"

EXAMPLE = """\b
Examples:
  idloop identify --list
  idloop identify bags/train --method n4sid --method oe --validate bags/unseen --plot compare.png
  idloop identify bags/train --method n4sid --sweep order=1:10 --validate bags/unseen --plot orders.png
  idloop identify bags/low bags/middle bags/high --method oe --sweep amplitude --validate bags/unseen
  idloop identify bags/train --method oe --order 1:4 --delay auto --output motor.velocity --save motor.json

\b
A saved model in Python, with idloop or without it:
  from idloop.estimation.linear import load
  load("motor.json").system                      # a python-control StateSpace
\b
  m = json.load(open("motor.json"))              # or numpy.load("motor.npz")
  control.ss(m["a"], m["b"], m["c"], m["d"], m["sample_time"])
"""


def _load_controller(_context: click.Context, _option: click.Parameter, text: str | None) -> dict[str, Any] | None:
    """Controller of a preset, of a model file, or of a file with its section alone."""
    if text is None:
        return None
    from idloop.control.controller_file import load_controller

    return load_controller(text)


@click.command(cls=_inputs.lists("--validate"), epilog=EXAMPLE)
@click.argument("bags", type=_inputs.BAG, nargs=-1, metavar="BAG...")
@click.option("--method", "methods", multiple=True, metavar="NAME", help="Of --list. May be repeated.")
@_inputs.validate_option
@click.option("--model", type=_inputs.MODEL, help="Preset or model file that names the streams and their units.")
@_inputs.trust_option
@click.option("--joint", metavar="NAME", help="Commanded joint, where joint_command holds several.")
@click.option("--output", "outputs", multiple=True, metavar="JOINT.FIELD", help="Only this output. May be repeated.")
@click.option("--sample-time", type=float, metavar="SECONDS", help="Even grid to identify on; the record's own.")
@_inputs.option(
    "--detrend",
    type=click.Choice(["none", "mean", "linear"]),
    default="none",
    help="What is taken off command and outputs of each record. An axis at rest without command needs none.",
)
@click.option(
    "--drop", type=click.FloatRange(min=0.0), default=0.0, metavar="SECONDS", help="Left out at both ends of a record."
)
@_inputs.option(
    "--order",
    type=NumbersArgument(1),
    metavar="N|A:B|auto",
    default="auto",
    help="States, or degree of every polynomial; of several the one with the least BIC.",
)
@click.option(
    "--structure", metavar="na=2,nb=1,...", help="Degrees of polynomials that differ from --order (na nb nc nd nf)."
)
@_inputs.option(
    "--delay",
    type=NumbersArgument(0),
    metavar="N|A:B|auto",
    default="1",
    help="Samples from a command to its first effect; 1 is none beyond that of sampling.",
)
@click.option("--horizon", type=click.IntRange(min=2), help="Samples that subspace methods look back and ahead.")
@click.option("--window", type=click.IntRange(min=2), help="Samples of lag window (spa), segment (welch), lags (cra).")
@click.option("--period", type=_inputs.POSITIVE, help="Of a periodic excitation (bla) [s].")
@click.option("--units", type=click.IntRange(min=1), help="Units of a network.")
@_inputs.option(
    "--focus",
    type=click.Choice(["prediction", "simulation"]),
    default="prediction",
    help="What is made small: errors one step ahead, or those of the free run.",
)
@click.option(
    "--band",
    type=(float, float),
    metavar="LOW HIGH",
    help="Weigh the fit towards these frequencies [Hz]; 0 and inf leave a side open (polynomials, pem).",
)
@click.option("--stable", is_flag=True, help="Reflect unstable poles (subspace methods).")
@click.option(
    "--integrates/--no-integrates",
    default=None,
    help="Put the pole nearest 1 there, or leave it (subspace methods); n4sid, moesp and cva let the data decide.",
)
@click.option("--closed-loop", is_flag=True, help="Go by way of the recorded reference (iv4, bla).")
@click.option(
    "--controller",
    callback=_load_controller,
    metavar="FILE",
    help="Controller that ran (vodma): a model file, or a file with its section `controller` alone; that of --model.",
)
@_inputs.option(
    "--criterion-steps",
    "steps",
    type=click.IntRange(min=1),
    default=10,
    metavar="K",
    help="Samples that the second score predicts ahead.",
)
@click.option(
    "--sweep",
    metavar="NAME=VALUES",
    help=f"Table and figure over one of {', '.join(SWEPT)}; {' or '.join(MEASURED)} alone: each BAG by itself.",
)
@_inputs.option("--seed", type=click.IntRange(min=0), default=0, help="Of networks.")
@click.option(
    "--save", type=_outputs.OUTPUT_FILE, metavar="FILE", help="Write the model (.json; linear ones also .npz)."
)
@_outputs.force_option("Overwrite the file of --save.")
@click.option("--list", "show_list", is_flag=True, help="List the methods with what they are for.")
@_outputs.drawn_work_options
def command(
    bags: tuple[Path, ...],
    *,
    methods: tuple[str, ...],
    validate: tuple[Path, ...],
    model: Model | None,
    joint: str | None,
    outputs: tuple[str, ...],
    sample_time: float | None,
    detrend: Literal["none", "mean", "linear"],
    drop: float,
    structure: str | None,
    controller: dict[str, Any] | None,
    steps: int,
    sweep: str | None,
    save: Path | None,
    show_list: bool,
    plot: Path | None,
    as_json: bool,
    **options: Any,
) -> int:
    """Identify black-box models from every BAG together, by one or several methods.

    Without --model the command is the effort of joint_command, and the outputs are the fields of joint_states of
    that joint that move. All methods are judged on the same data: the bags of --validate, else those of the fit.
    """
    if show_list:
        list_methods(as_json=as_json)
        return DONE
    from idloop.estimation.black_box.method import Choices
    from idloop.estimation.black_box.methods import find_method

    if not bags:
        raise InputError("no bag: give at least one recording, or --list for the methods")
    if not methods:
        raise InputError("no method: give at least one --method; idloop identify --list shows them")
    if sample_time is not None and not 0 < sample_time < float("inf"):
        raise InputError(f"--sample-time {sample_time:g}: it must be positive")
    chosen = {name: find_method(name) for name in methods}
    over = None if sweep is None else parse_sweep(sweep)
    if over is not None and any(method.kind == "response" for method in chosen.values()):
        raise InputError(f"--sweep {sweep}: responses predict nothing that could be judged; sweep over models")
    if over is not None and over.name in MEASURED and len(bags) < 2:
        raise InputError(f"--sweep {over.name}: it compares bags, each with a model of its own; give two or more")
    if save is not None:
        check_save(save, [method.kind for method in chosen.values()], swept=over is not None)
    law = controller if controller is not None or model is None else model.controller
    choices = Choices(structure=parse_structure(structure), controller=law, **options)
    check_structure(choices.structure, list(chosen.values()))
    note_unused(list(chosen), choices)
    signals = named_signals(bags[0], model, joint, outputs)
    train, unseen = _inputs.read_fitted_and_unseen(bags, validate, signals)
    notes = left_out_notes(bags, signals)
    for note in notes:
        _outputs.log(note)
    with progress("identifying") as update:
        if over is None:
            found = identify(
                train, list(chosen), unseen, sample_time=sample_time, detrend=detrend, drop=drop, steps=steps,
                progress=update, structure=choices.structure, controller=law, **options,
            )  # fmt: skip
        else:
            grids = grids_of(train, unseen, detrend, drop)
            data = grids(sample_time or round(train[0].sample_time, 9))
            if over.name in MEASURED:
                each = [even_grids([record], data[0][0].sample_time, detrend, drop) for record in train]
                cases = record_cases(over, each, data[1] if unseen else None, choices)
            else:
                cases = setting_cases(over, data, choices)
            apart = over.name in (*MEASURED, "sample-time")
            rows = run_cases(list(chosen), cases, grids, steps, update, apart=apart)
    if over is not None:
        document = describe(chosen, train, unseen, data[0], choices, detrend=detrend, steps=steps)
        more = {"plot": plot, "save": save, "notes": notes}
        print_sweep(over, over.unit(data[0][0].input_units[0]), rows, data[1], document | more, as_json=as_json)
        return DONE
    drawn = plot if any(one.found is not None for one in found.outcomes) else None
    _outputs.deliver(found, as_json=as_json, output=save, plot=drawn, save=save, notes=notes)
    failed = [one for one in found.outcomes if one.error]
    if failed:
        raise IdloopError(f"{len(failed)} of {len(found.outcomes)} models failed: {failed[0].label}: {failed[0].error}")
    return DONE


def list_methods(*, as_json: bool) -> None:
    """Print every method with what it is for."""
    from idloop.estimation.black_box.methods import METHODS

    fields = ("name", "kind", "summary", "loop", "source", "needs", "polynomials")
    listed = [{field: getattr(method, field) for field in fields} for method in METHODS.values()]
    _outputs.print_either(methods_blocks, {"schema": SCHEMA, "methods": listed} if as_json else None)


def note_unused(names: Sequence[str], choices: Choices) -> None:
    """Say which options a chosen method does not read."""
    from idloop.estimation.black_box.method import Choices as Default
    from idloop.estimation.black_box.methods import METHODS

    # The controller may be that of the model, which nobody gave to a method.
    usual = {name: value for name, value in vars(Default()).items() if name != "controller"}
    for option in (name for name, value in usual.items() if getattr(choices, name) != value):
        # Output error fits the free run anyway; beside models, responses take what they can.
        deaf = [n for n in names if option not in METHODS[n].needs and not (n == "oe" and option == "focus")]
        if len(deaf) < len(names):
            deaf = [n for n in deaf if METHODS[n].kind != "response"]
        if deaf:
            _outputs.log(f"note: --{option.replace('_', '-')} means nothing to {', '.join(deaf)}")


def named_signals(bag: Path, model: Model | None, joint: str | None, outputs: Sequence[str]) -> AxisSignals:
    """Streams that the model names, else those that the bag shows."""
    from idloop.physics.model import InputSignal
    from idloop.records.bags.axis_signals import AxisSignals, axis_signals, chosen_outputs

    if model is None:
        return axis_signals(bag, outputs, joint)
    measured = tuple(InputSignal(one.topic, one.joint, one.field, one.unit) for one in model.outputs)
    return chosen_outputs(AxisSignals(model.input, measured), outputs)


def left_out_notes(bags: Sequence[Path], signals: AxisSignals) -> list[str]:
    """One note for each bag in which other joints are commanded to move as well."""
    from idloop.records.bags.axis_signals import moving_commands

    notes = []
    for bag in bags:
        others = moving_commands(bag, signals.input)
        if others:
            joints = f"joint{'s' if len(others) > 1 else ''} {', '.join(others)}"
            notes.append(
                f"{bag.name}: the bag holds the {signals.input.field} of {joints} as well, which is left out beside"
                f" that of {signals.input.joint}: from Python several are taken at once (docs/how-to/black-box.md)"
            )
    return notes


@dataclass(frozen=True)
class Case:
    """One value of a sweep."""

    value: float
    text: str  # for the progress
    choices: Choices
    data: Grids | None  # None: the records on an even grid of the period `value`
    record: str = ""  # that it is identified from, where each has a case of its own


def setting_cases(sweep: Sweep, data: Grids, choices: Choices) -> list[Case]:
    """Every value of a setting, or of the sample time, on the same records."""
    cases = []
    for value in sweep.values:
        setting: dict[str, Any] = {} if sweep.name == "sample-time" else {sweep.name: int(value)}
        given = data if setting else None
        cases.append(Case(value, f"{sweep.name} {value:g}", replace(choices, **setting), given))
    return cases


def record_cases(
    sweep: Sweep, records: Sequence[list[SampledData]], unseen: list[SampledData] | None, choices: Choices
) -> list[Case]:
    """Every record by itself, judged on `unseen`, or on itself where there is none; the least measure first."""
    measure: Any = sweep.name
    cases = [
        Case(excitation_measure(measure, one), one[0].name, choices, (one, unseen or one), one[0].name)
        for one in records
    ]
    return sorted(cases, key=lambda case: case.value)


def run_cases(
    names: Sequence[str],
    cases: Sequence[Case],
    grids: Callable[[float], Grids],
    steps: int,
    update: Callable[..., None],
    *,
    apart: bool,
) -> list[tuple[float, Outcome]]:
    """Identify in every case by every method; a failure is its row's outcome.

    `apart`: the cases have other samples, so that AIC and BIC can be held against one another within each only. Raises
    IdloopError: every row failed.
    """
    rows: list[tuple[float, Outcome]] = []
    failure: IdloopError | None = None
    for index, case in enumerate(cases):
        for number, name in enumerate(names):
            update((index + number / len(names)) / len(cases), f"{name}, {case.text}")
            try:
                data = grids(case.value) if case.data is None else case.data
                one = identify_one(name, data, case.choices, steps, ignore_progress)
            except IdloopError as error:
                failure = failure or error
                one = Outcome(name, error=str(error))
            rows.append((case.value, replace(one, record=case.record)))
    if failure is not None and all(one.error for _, one in rows):
        raise failure
    size = len(names) if apart else len(rows)
    groups = [[one for _, one in rows[start : start + size]] for start in range(0, len(rows), size)]
    compared = [one for group in groups for one in on_the_same_samples(group)]
    return [(value, one) for (value, _), one in zip(rows, compared, strict=True)]


def print_sweep(
    sweep: Sweep,
    unit: str | None,
    rows: list[tuple[float, Outcome]],
    judged: list[SampledData],
    document: dict[str, Any],
    *,
    as_json: bool,
) -> None:
    """Write the figure and print the sweep."""
    title, steps, note = document.pop("title"), document["steps"], document["loop"]["note"]
    # At another sample time the free runs are not judged on the same samples, and only fewer states are simpler.
    smallest = smallest_orders(rows, judged) if sweep.name == "order" else {}
    if document["plot"] is not None:
        from idloop.reporting.plots.identification import plot_sweep

        draw = partial(plot_sweep, sweep.name, unit, _sweep_lines(rows), steps, title)
        _outputs.save_plot(draw, document["plot"])
    if not as_json:
        table = sweep_blocks(sweep.name, unit, rows, steps, smallest)
        _outputs.print_blocks([title, "", *table, *filter(None, [note])])
        return
    found = {"over": sweep.name, "unit": unit, "best": best_values(rows), "smallest": smallest}
    listed = [
        {"value": value, "record": one.record or None, "method": one.label, "error": one.error or None}
        | ({} if one.score is None else one.score.to_dict())
        | one.measures()
        for value, one in rows
    ]
    _outputs.print_json({**document, "sweep": {**found, "rows": listed}})


def _sweep_lines(rows: Sequence[tuple[float, Outcome]]) -> list[SweepLine]:
    """Curves of the sweep's figure."""
    import numpy as np

    from idloop.reporting.plots.identification import SweepLine

    lines = []
    for label in dict.fromkeys(one.label for _, one in rows):
        own = [(value, one) for value, one in rows if one.label == label and one.score is not None]
        columns = ([v for v, _ in own], [mean(o, "free_run") for _, o in own], [mean(o, "ahead") for _, o in own])
        lines.append(SweepLine(label, *(np.array(column, dtype=float) for column in columns)))
    return lines
