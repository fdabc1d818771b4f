"""`idloop demo --loop`: live, offline and replayed estimates of one machine agree, and a real machine's record."""

from __future__ import annotations

import dataclasses
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from idloop.cli import _outputs
from idloop.cli._progress import progress
from idloop.errors import IdloopError

if TYPE_CHECKING:
    from idloop.graph import LiveResult, Windows
    from idloop.physics import Model

GRAPHS = ("dc_motor", "torsion")
# The estimator starts this far from the machine's values, or there would be nothing to find.
START = 0.6
LEAST_FIT = 95.0
# Combined standard errors within which two estimates of one parameter count as the same.
SAME = 3.0


@dataclass
class LoopRun:
    """What one graph's run showed."""

    graph: str  # name of the graph
    bag: Path  # its recording
    truth: dict[str, float]  # parameters of the simulated machine
    # `live`, `replayed`: last fit of the estimator on the live graph and on the replayed bag
    live: LiveResult
    # Value and standard error by parameter, of all that was recorded
    offline: dict[str, dict[str, Any]] = field(default_factory=dict)
    replayed: LiveResult | None = None
    # Largest distance of an estimate from the live one, in combined standard errors
    apart: dict[str, float] = field(default_factory=dict)

    @property
    def fit(self) -> float:
        """Worst FIT of an output on samples that the live fit had not seen [%]."""
        return min(self.live.fit.values())

    @property
    def failures(self) -> list[str]:
        """What did not come out as it must, one line each."""
        found = []
        if not self.fit >= LEAST_FIT:
            found.append(f"{self.graph}: live FIT on unseen samples is {self.fit:.1f} %, less than {LEAST_FIT:g} %")
        found += [
            f"{self.graph}: {what} differs from the live estimate by {distance:.1f} standard errors"
            for what, distance in self.apart.items()
            if not distance <= SAME
        ]
        return found


def windows_of(graph: str, seconds: float) -> Windows:
    """Fit windows that leave a live run of this length at least two fits."""
    from idloop.graph import Windows

    longest = {"dc_motor": 20.0, "torsion": 10.0}[graph]
    window = min(longest, seconds / 3.0)
    return Windows(window, window / 2.0, window)


@contextmanager
def narrated(text: str, seconds: float) -> Iterator[Any]:
    """Spinner with the newest line of the nodes; the lines themselves when stderr is no terminal."""
    with progress(text, writes=True) as update:
        started = time.monotonic()

        def say(label: str, line: str) -> None:
            words = line.split("]: ", 1)[-1]
            update(min((time.monotonic() - started) / seconds, 0.99), f"{label}: {words[:90]}")

        yield say


def distance(one: Mapping[str, Mapping[str, Any]], other: Mapping[str, Mapping[str, Any]]) -> float:
    """Largest difference of two sets of estimates in combined standard errors; infinite when one has none."""
    worst = 0.0
    for name, first in one.items():
        second = other[name]
        spread = ((first["stderr"] or 0.0) ** 2 + (second["stderr"] or 0.0) ** 2) ** 0.5
        gap = abs(first["value"] - second["value"])
        worst = max(worst, gap / spread if spread > 0.0 else float("inf") if gap > 0.0 else 0.0)
    return worst


def run_from_away(
    graph: str,
    machine: Model,
    start: Path,
    values: Mapping[str, str],
    say: Callable[[str, str], None],
    domain: int | None,
) -> None:
    """Run a graph whose estimator starts from a model file `start`, its free parameters far from the machine's."""
    from idloop.graph import load_graph, run_graph

    machine.with_values({p.name: START * p.value for p in machine.parameters if p.free}).save(start)
    if not run_graph(load_graph(graph, {"model": str(start), **values}), say=say, domain_id=domain):
        raise KeyboardInterrupt


def run_live(graph: str, folder: Path, seconds: float, seed: int, domain: int | None) -> LoopRun:
    """Excite, control, record and identify a simulated machine, each in its own process."""
    from idloop.graph import read_results
    from idloop.physics import load_model

    machine, bag = load_model(graph), folder / graph
    windows = windows_of(graph, seconds)
    values = {"seed": str(seed), "bag": str(bag), "duration": repr(seconds), "window": repr(windows.window)}
    values |= {"validation": repr(windows.validation), "fit_period": repr(windows.period)}
    with narrated(f"{graph}: live graph", 60.0) as say:
        run_from_away(graph, machine, folder / f"{graph}_start.yaml", values, say, domain)
    live = read_results(bag)
    if not live.fits or live.error:
        raise IdloopError(f"{graph}: {live.error or 'the estimator made no fit; give the run more --seconds'}")
    truth = {p.name: p.value for p in machine.parameters if p.free}
    return LoopRun(graph, bag, truth, live)


def refit_offline(run: LoopRun, folder: Path) -> None:
    """Fit the whole recording offline and draw it."""
    from idloop.estimation import fit
    from idloop.physics import load_model
    from idloop.records import read_record

    model = load_model(folder / f"{run.graph}_start.yaml")
    with progress(f"{run.graph}: offline fit", writes=True) as update:
        result = fit(model, [read_record(run.bag, model)], progress=update)
    result.model.save(folder / f"{run.graph}_fitted.yaml")
    run.offline = {
        name: {"value": value, "stderr": error}
        for name, value, error in zip(result.names, result.values.tolist(), result.stderr.tolist(), strict=True)
    }
    run.apart["the offline fit"] = distance(run.live.parameters, run.offline)


def replay(run: LoopRun, folder: Path, seconds: float, domain: int | None) -> None:
    """Play the recording into a fresh estimator."""
    from idloop.graph import replay_bag

    with tempfile.TemporaryDirectory() as scratch, narrated(f"{run.graph}: replay", 40.0) as say:
        run.replayed = replay_bag(
            run.bag,
            str(folder / f"{run.graph}_start.yaml"),
            Path(scratch) / "replay",
            windows=windows_of(run.graph, seconds),
            say=say,
            domain_id=domain,
        )
    run.apart["the replay"] = distance(run.live.parameters, run.replayed.parameters)


def tell(run: LoopRun) -> None:
    """Print what one graph's run showed."""
    live, replayed = run.live, run.replayed
    fits = ", ".join(f"{name} {value:.1f} %" for name, value in live.fit.items())
    click.echo(f"live FIT on samples that the fit had not seen: {fits}")
    rows = []
    for name, truth in run.truth.items():
        columns = [live.parameters[name], run.offline[name], replayed.parameters[name] if replayed else {}]
        cells = [f"{one['value']:.5g} ± {one['stderr'] or 0.0:.2g}" if one else "-" for one in columns]
        rows.append((name, f"{truth:.5g}", *cells, live.parameters[name]["unit"]))
    _outputs.print_table(("parameter", "machine", "live", "offline", "replayed", "unit"), rows)
    apart = ", ".join(f"{what} by at most {value:.2g}" for what, value in run.apart.items())
    click.echo(f"differs from the live estimate, in standard errors: {apart}\nbag: {run.bag}\n")


def real_machine(folder: Path) -> list[dict[str, Any]] | None:
    """Fit the EMPS positioning axis, without and with its friction; None where the record is not there."""
    from idloop.estimation import fit
    from idloop.physics import load_model
    from idloop.records import read_record
    from idloop.records.public_data import public_data
    from idloop.records.tables.importing import import_bag
    from idloop.validation import force_error

    data = public_data("emps")
    if data is None:
        return None
    bags = {}
    for role, name in (("train", "DATA_EMPS.mat"), ("pulses", "DATA_EMPS_PULSES.mat")):
        bags[role] = folder / f"emps_{role}"
        import_bag(data / name, bags[role], "emps")
    rows: list[dict[str, Any]] = []
    for effects in ([], ["coulomb_friction@axis"], ["coulomb_friction@axis", "input_offset@input"]):
        model = load_model("emps").with_effects(effects)
        result = fit(model, [read_record(bags["train"], model)])
        errors = {role: force_error(result.model, read_record(bag, model)).relative for role, bag in bags.items()}
        values = dict(zip(result.names, result.values.tolist(), strict=True))
        rows.append({"effects": effects, "parameters": values, "force_error": errors})
    return rows


def tell_real_machine(rows: list[dict[str, Any]] | None) -> None:
    """Print the ladder on the real machine, or where its record comes from."""
    if rows is None:
        click.echo("real machine: the EMPS record is not on this machine; the README says where it comes from")
        return
    click.echo("real machine (EMPS ball-screw axis): force error of each model")
    _outputs.print_table(
        ("model", "fitted", "pulses (unseen)"),
        [
            (
                " + ".join(["inertia, viscous friction", *(name.split("@")[0] for name in row["effects"])]),
                f"{100 * row['force_error']['train']:.2f} %",
                f"{100 * row['force_error']['pulses']:.2f} %",
            )
            for row in rows
        ],
    )
    last = rows[-1]["parameters"]
    click.echo(
        f"mass {last['axis.inertia']:.2f} kg, viscous {last['axis.viscous_friction']:.1f} N·s/m, Coulomb "
        f"{last['coulomb_friction@axis.level']:.2f} N (published 95.11, 203.5, 20.39; force error 4.08 % and 5.98 %)\n"
    )


def check_loop(
    graphs: Sequence[str], folder: Path, seconds: float, seed: int, domain: int | None, *, quiet: bool
) -> tuple[dict[str, Any], list[str]]:
    """Run the loop of each graph from end to end and compare what comes out.

    `folder`: for all results; `seconds`: signal of each graph [s]; `domain`: ROS domain; `quiet`: print nothing.
    Returns `document`: what was found, for JSON; `failures`: what did not come out as it must, one line each.
    """
    runs = []
    for graph in graphs or GRAPHS:
        if not quiet:
            click.echo(f"{graph}: excitation, controller, plant, recorder, estimator; {seconds:g} s of signal")
        run = run_live(graph, folder, seconds, seed, domain)
        refit_offline(run, folder)
        replay(run, folder, seconds, domain)
        runs.append(run)
        if not quiet:
            tell(run)
    rows = real_machine(folder)
    if not quiet:
        tell_real_machine(rows)
    document = {"runs": [dataclasses.asdict(run) | {"worst_fit": run.fit} for run in runs], "real_machine": rows}
    return document, [line for run in runs for line in run.failures]
