"""`idloop demo`: a machine with a hidden effect, and a live graph that finds it, adds it and says when it is done."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from idloop.cli import _inputs, _outputs
from idloop.cli._demo_loop import GRAPHS, check_loop, narrated, run_from_away
from idloop.errors import IdloopError
from idloop.output_files import make_folder, probe_folder

if TYPE_CHECKING:
    from idloop.diagnosis import Ladder
    from idloop.graph import Findings
    from idloop.physics import Model
    from idloop.records import Record

MACHINE = "dc_motor"
# What may be hidden: effect, its parameter and the range that the seed chooses from.
HIDDEN = (
    ("dead_zone@input", "width", 0.2, 0.4),
    ("coulomb_friction@motor", "level", 1.5, 3.0),
    ("saturation@input", "limit", 2.6, 3.2),
)
SECONDS, WINDOW, VALIDATION, PERIOD, DIAGNOSED = 90.0, 15.0, 5.0, 10.0, 20.0
# The free run of the last model may leave so much more than the sensors' noise.
AT_THE_FLOOR = 1.25
TROUBLE = re.compile(r"^\[(?:WARN|ERROR|FATAL)\]")  # of a live graph, whoever says it: the story halts there
LOG_LINE = re.compile(r"^\[(?:INFO|WARN|ERROR|FATAL)\] \[[\d.]+\] \[[^\]]+\]: (.*)$")
# How the estimator's log begins, and the word that the story puts before it.
TOLD = {
    "FIT ": "model",
    "the residual is not white": "why",
    "where: ": "where",
    "diagnosis: ": "missing",
    "ladder: ": "ladder",
    "next experiment: ": "next",
    "experiment from ": "runs",
    "the experiment is over": "then",
    "no experiment: ": "next",
}


def choose_hidden(seed: int) -> str:
    """The effect that a seed hides, as text for the plant."""
    import numpy as np

    random = np.random.default_rng(seed)
    name, parameter, low, high = HIDDEN[seed % len(HIDDEN)]
    return f"{name}({parameter}={random.uniform(low, high):.3g})"


@dataclass(frozen=True)
class Outcome:
    """What the story came to."""

    hidden: str  # effect that only the machine has, as text
    bag: Path
    findings: Findings
    ladder: Ladder
    floor: dict[str, dict[str, float]]  # ``fit`` [%] and ``nrmse`` that the sensors' noise alone leaves, by output
    files: dict[str, Path] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Hidden effect without its value."""
        return self.hidden.partition("(")[0]

    @property
    def found(self) -> bool:
        """Whether exactly the hidden effect was added."""
        return set(self.ladder.model.effect_names) == {self.name}

    @property
    def above_floor(self) -> float:
        """Largest ratio of an output's error on unseen data to what the noise alone leaves."""
        errors = self.ladder.steps[-1].validation["nrmse"]
        return max(float(errors[name]) / floor for name, floor in self.floor["nrmse"].items())

    @property
    def failures(self) -> list[str]:
        """What did not come out as it must, one line each."""
        failed = []
        if not self.found:
            added = ", ".join(self.ladder.model.effect_names) or "nothing"
            failed.append(f"{self.hidden} was hidden, {added} was found")
        if not self.above_floor <= AT_THE_FLOOR:
            failed.append(f"the last error is {self.above_floor:.2f} times that of the noise")
        return failed


# ---------------------------------------------------------------- the live graph


def retell(label: str, line: str) -> str | None:
    """A line of the story from a line that a node has written; None for what only a log needs."""
    match = LOG_LINE.match(line)
    text = match[1] if match else line
    if TROUBLE.match(line):
        return f"{'!':<8} {label}: {text}"
    if label == "plant" and text.startswith("start: "):
        return f"{'live':<8} {text.removeprefix('start: ')}"
    if label != "estimator":
        return None
    for begin, word in TOLD.items():
        if text.startswith(begin):
            words = text.removeprefix(begin) if begin.endswith(": ") else text
            # Of a fit the story needs the error, not the parameters.
            words = words.partition(": ")[0] if word in ("model", "why", "then") else words
            return f"{word:<8} {words}"
    return None


def run_live(hidden: str, folder: Path, seed: int, domain: int | None, tell: Callable[[str], None]) -> Path:
    """Run the graph to its end and return the bag."""
    from idloop.physics import load_model

    values = {"effects": json.dumps([hidden]), "seed": str(seed), "bag": str(folder / "bag"), "duration": repr(SECONDS)}
    times = {"window": WINDOW, "validation": VALIDATION, "fit_period": PERIOD, "diagnose_window": DIAGNOSED}
    values |= {name: repr(seconds) for name, seconds in times.items()}

    with narrated("live graph", 120.0) as update:

        def say(label: str, line: str) -> None:
            words = retell(label, line)
            if words is not None:
                tell(words)
            update(label, line)

        run_from_away("hidden", load_model(MACHINE), folder / "start.yaml", values, say, domain)
    return folder / "bag"


# ---------------------------------------------------------------- what came of it


def judge(hidden: str, bag: Path, folder: Path, seed: int) -> Outcome:
    """Read what the graph left behind, and write the files."""
    from idloop.diagnosis import Ladder
    from idloop.graph import read_findings
    from idloop.physics import load_model
    from idloop.records import read_record

    findings = read_findings(bag)
    if findings.ladder is None:
        raise IdloopError(f"{bag}: the estimator found nothing to say about missing effects")
    ladder = Ladder.from_dict(findings.ladder)
    record = read_record(bag, load_model(MACHINE))
    windows = [diagnosis["windows"] for diagnosis in findings.diagnoses if diagnosis["windows"]][-1]
    seen, unseen = zip(*(window_parts(record, start, stop) for start, stop in windows), strict=True)
    outcome = Outcome(hidden, bag, findings, ladder, noise_floor(ladder.model, unseen))
    outcome.files.update(write_files(outcome, folder, record, seen, unseen, seed))
    return outcome


def window_parts(record: Record, start: int, stop: int) -> tuple[Record, Record]:
    """What the live estimator has fitted of a stretch of data, and its end, by which it has judged."""
    share = VALIDATION / (DIAGNOSED + VALIDATION)
    cut = stop - round((stop - start) * share)
    first, middle, last = ((stamp - record.start_ns) / 1e9 for stamp in (start, cut, stop))
    half = 0.5 * record.sample_time
    return record.cut(first, middle - half), record.cut(middle, last - half)


def noise_floor(model: Model, records: Sequence[Record]) -> dict[str, dict[str, float]]:
    """FIT and NRMSE of a model that is exact, by output, as means over records like those of a ladder."""
    import numpy as np

    floor: dict[str, dict[str, float]] = {"fit": {}, "nrmse": {}}
    for column, output in enumerate(model.outputs):
        if output.noise is not None:
            left = np.array([output.noise / np.nanstd(record.output[:, column]) for record in records])
            floor["fit"][output.name] = float(100.0 * np.mean(1.0 - left))
            floor["nrmse"][output.name] = float(np.sqrt(np.mean(left**2)))
    return floor


def write_files(
    outcome: Outcome, folder: Path, record: Record, seen: Sequence[Record], unseen: Sequence[Record], seed: int
) -> dict[str, Path]:
    """Write model, ladder, figures and report; `idloop refine --resume` and `idloop report` go on from them."""
    from dataclasses import replace

    from idloop.cli._command_line import command_line
    from idloop.drawing import save
    from idloop.reporting.ladder_folder import Kept, fitted_records, judged_records, write_ladder, write_report
    from idloop.reporting.page.contents import gather
    from idloop.reporting.plots.comparison import plot_panels
    from idloop.reporting.plots.diagnosis import plot_ladder
    from idloop.reporting.provenance import provenance

    ladder = outcome.ladder
    context = click.get_current_context(silent=True)
    origin = provenance([outcome.bag], [], commands=[command_line(context)] if context else [], seed=seed)
    judged, fitted = (
        tuple((outcome.bag, float(part.time[0]), float(part.time[-1])) for part in parts) for parts in (unseen, seen)
    )
    kept = Kept(ladder, (outcome.bag,), (), None, origin, judged, fitted)
    write_ladder(folder, kept)
    parts = fitted_records(kept, [record]), judged_records(kept, [record])
    contents = gather(ladder, *parts, provenance=origin)
    contents = replace(contents, floor=outcome.floor["nrmse"])
    files = {name: folder / name for name in ("model.yaml", "ladder.json", "ladder.png", "compare.png", "report.html")}
    save(plot_ladder(ladder, outcome.floor["nrmse"]), files["ladder.png"])
    shown = contents.judged[0]
    save(plot_panels([shown.panel]), files["compare.png"])
    write_report(contents, files["report.html"])
    return {"bag": outcome.bag, **files}


def tell_outcome(outcome: Outcome) -> None:
    """Print the ladder, the floor, what was hidden and what was found."""
    from idloop.reporting.text.diagnosis import ladder_blocks

    click.echo()
    _outputs.print_blocks(ladder_blocks(outcome.ladder))
    floor = ", ".join(f"{name} {value:.2f} %" for name, value in outcome.floor["fit"].items())
    click.echo(f"noise floor: FIT {floor}; the last error is {outcome.above_floor:.2f} times that of the noise")
    click.echo(f"hidden in the machine: {outcome.hidden}: {'found' if outcome.found else 'NOT found'}\n")
    _outputs.print_table(("file", ""), [(name, str(path)) for name, path in outcome.files.items()])


def to_document(outcome: Outcome, failures: list[str]) -> Mapping[str, Any]:
    """Everything for `--json`."""
    own = {key: getattr(outcome, key) for key in ("hidden", "found", "above_floor", "files")}
    findings = outcome.findings
    found = {"diagnoses": findings.diagnoses, "experiments": findings.experiments, "refine": findings.ladder}
    return {"schema": "idloop/demo/2", **own, **found, "noise_floor": outcome.floor, "failures": failures}


@click.command("demo", short_help="The whole story on the live graph with a hidden effect.")
@click.option(
    "--hide", metavar="EFFECT", help="Hide this effect, as in 'dead_zone@input(width=0.3)' (default: by --seed)."
)
@_inputs.option("--seed", type=click.IntRange(0), default=0, help="Of the hidden effect and the noise.")
@click.option("--loop", is_flag=True, help="Check instead that live, offline and replayed estimates agree.")
@click.option("--graph", "graphs", type=click.Choice(GRAPHS), multiple=True, help="With --loop: only this graph.")
@_inputs.option("--seconds", type=click.FloatRange(6.0), default=60.0, help="With --loop: signal of a graph [s].")
@click.option("--directory", type=_outputs.NEW_FOLDER, help="New folder for all results (default: in bags/).")
@click.option("--domain", type=click.IntRange(0, 232), help="ROS domain of the graphs (ROS_DOMAIN_ID).")
@_outputs.work_options
def command(
    hide: str | None,
    *,
    seed: int,
    loop: bool,
    graphs: tuple[str, ...],
    seconds: float,
    directory: Path | None,
    domain: int | None,
    as_json: bool,
) -> None:
    """Hide an effect in a simulated machine and watch the live graph find it.

    Five processes over DDS excite, control, simulate, record and identify a DC motor. The estimator has a model without
    the hidden effect. It sees that its model fails and where, names what is missing, has the next
    experiment run where effects tie, adds what it found, and goes on until nothing significant is left.
    """
    folder = directory or probe_folder(
        Path("bags") / time.strftime("demo_%Y%m%d_%H%M%S"), "--directory", new=True, parents=True
    )
    from idloop.physics import load_model

    hidden = hide or choose_hidden(seed)
    load_model(MACHINE).with_effects([hidden])  # an unknown effect is refused before anything is started
    make_folder(folder, parents=True)
    if loop:
        document, failures = check_loop(graphs, folder, seconds, seed, domain, quiet=as_json)
        if as_json:
            _outputs.print_json({"schema": "idloop/demo/1", **document, "failures": failures})
        else:
            click.echo(f"all results: {folder}")
    else:
        failures = tell_story(hidden, folder, seed, domain, as_json=as_json)
    if failures:
        raise IdloopError("; ".join(failures))


def tell_story(hidden: str, folder: Path, seed: int, domain: int | None, *, as_json: bool) -> list[str]:
    """Run the graph, say what happens while it does, then what came of it; return what failed."""
    if not as_json:
        click.echo(f"{'hidden':<8} an effect that only the machine has; the motor turns one way")
    bag = run_live(hidden, folder, seed, domain, (lambda line: None) if as_json else click.echo)
    outcome = judge(hidden, bag, folder, seed)
    failures = outcome.failures
    if as_json:
        _outputs.print_json(to_document(outcome, failures))
    else:
        tell_outcome(outcome)
    return failures
