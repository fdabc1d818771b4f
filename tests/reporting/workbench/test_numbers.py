"""Every number that stands on the page, with its unit, is one of the JSON documents of the command line."""

from __future__ import annotations

import json
import math
import re
import threading
import urllib.request
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("bokeh", reason="no Bokeh: launch_scripts/test installs it")

from fake import FakeSource

from idloop.cli.main import run
from idloop.diagnosis.evidence.live_evidence import LiveEvidence
from idloop.physics import load_model
from idloop.physics.simulation import simulate
from idloop.records import Record, read_record, write_bag
from idloop.reporting.figures.effects import MOST
from idloop.reporting.terms import effect_words
from idloop.reporting.workbench.offline import OfflineSource
from idloop.reporting.workbench.server import Place, Site
from idloop.reporting.workbench.state import model_version
from idloop.reporting.workbench.steps import Study

EXPONENTS = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹−", "-0123456789-")
NUMBER = r"[−-]?\d+(?:\.\d+)?(?:e[+-]?\d+)?"
WITH_UNIT = re.compile(rf"({NUMBER})(?: · 10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+))?\s(%|s|Hz|rad|rad/s|m/s|m|N·m|N|V|A)(?![\w/·])")
# Parts of the page whose numbers are measured values of the recording, not of the model.
TEXTS = (
    "#fits", "#where-words", "#where-hint", "#error", "#stretches", "#residual-words", "#candidates",
    "#steps", "#parameters", "#beware",
)  # fmt: skip
# Columns of the glyphs of a figure, as the browser has them.
COLUMNS = """place => {
  const root = Bokeh.documents[0].get_model_by_name(place), found = [];
  for (const model of root.references()) {
    if (model.type !== "ColumnDataSource") continue;
    found.push(Object.fromEntries([...model.data instanceof Map ? model.data : Object.entries(model.data)].map(
      ([name, column]) => [name, [...column].map((x) => (Number.isNaN(x) ? null : x))])));
  }
  return found;
}"""


# Ends of the lines, the threshold and the marks of the figure of the evidence, as the browser has them.
EVIDENCE = """() => {
  const plot = window.Bokeh?.documents[0]?.get_model_by_name("evidence")?.children[0];
  if (!plot) return null;
  const end = (one, name) => [...one.data_source.data[name]].at(-1);
  return {
    threshold: plot.center.find((one) => one.type === "Span").location,
    lines: plot.renderers.filter((one) => one.name === "looks")
      .map((one) => ["name", "x", "y"].map((of) => end(one, of))),
    decided: plot.renderers.filter((one) => one.name === "decided")
      .map((one) => ["name", "x", "samples"].map((of) => end(one, of))),
  };
}"""


STEP = 0.005
QUIET = 1e-6  # noise of a sensor whose model file states none


@dataclass(frozen=True)
class Machine:
    name: str
    model: str
    effect: str
    values: str
    amplitude: float
    choice: tuple[str, ...]


MACHINES = (
    Machine("motor", "dc_motor", "dead_zone@input", "(width=0.4)", 3.0, ("dead_zone", "coulomb_friction")),
    Machine("axis", "axis", "coulomb_friction@axis", "(level=0.1)", 0.5, ("coulomb_friction", "quadratic_drag")),
    Machine("drag", "axis", "quadratic_drag@axis", "(coefficient=0.3)", 0.5, ("coulomb_friction", "quadratic_drag")),
    Machine("offset", "dc_motor", "input_offset@input", "(offset=0.5)", 3.0, ("input_offset", "dead_zone")),
    Machine("joints", "torsion", "coulomb_friction@motor", "(level=0.05)", 2.0, ("coulomb_friction", "dead_zone")),
    Machine("screw", "emps", "coulomb_friction@axis", "(level=20)", 1.5, ("coulomb_friction", "dead_zone")),
)


def recorded(machine: Machine, folder: Path) -> list[Path]:
    """Bags of a machine with its effect, one to fit and one unseen."""
    plain = load_model(machine.model)
    true = plain.with_effects([machine.effect + machine.values])
    bags = []
    for seed in (1, 2):
        rng = np.random.default_rng(seed)
        time = np.arange(0.0, 12.0, STEP)
        command = machine.amplitude * rng.uniform(-1.5, 1.5, 61)[(5.0 * time).astype(int)]
        noise = np.column_stack([rng.normal(size=len(time)) * float(o.noise or QUIET) for o in plain.outputs])
        output = simulate(true, time, command, time, noise=noise).output
        signals = tuple(plain.output_names), tuple(o.unit for o in plain.outputs)
        record = Record(
            f"run{seed}", time, command, time, output, plain.input.name, plain.input.unit, *signals, start_ns=10**9
        )
        bags.append(write_bag(folder / f"run{seed}", record))
    return bags


def numbers_of(part: Any) -> Iterator[float]:
    """Every number of a document; half the interval of a parameter, and shares in percent."""
    if isinstance(part, dict):
        if isinstance(part.get("stderr"), float):
            yield 1.959964 * part["stderr"]
        for value in part.values():
            yield from numbers_of(value)
    elif isinstance(part, list):
        for value in part:
            yield from numbers_of(value)
    elif isinstance(part, str):
        yield from (float(text.replace("−", "-")) for text in re.findall(NUMBER, part))
    elif isinstance(part, int | float) and not isinstance(part, bool):
        yield float(part)
        yield 100.0 * part


def stands(number: str, power: str, known: np.ndarray) -> bool:
    """Whether a number that is written is one of the known ones, to its last digit."""
    factor = 10.0 ** int(power.translate(EXPONENTS)) if power else 1.0
    plain = number.replace("−", "-")
    digits = len(plain.partition("e")[0].partition(".")[2]) - int(plain.partition("e")[2] or 0)
    value = float(plain) * factor
    return bool(np.any(np.abs(known - value) <= 0.5001 * factor * 10.0**-digits + 1e-12))


def ask(capsys: pytest.CaptureFixture[str], *words: object) -> dict[str, Any]:
    capsys.readouterr()
    assert run([str(word) for word in words]) == 0
    return dict(json.loads(capsys.readouterr().out))


def settled(source: OfflineSource, condition: Any) -> None:
    waited = threading.Event()
    for _ in range(4000):
        if source.state.snapshot.activity is None and condition(source.state.snapshot):
            return
        waited.wait(0.05)
    raise AssertionError(source.state.snapshot.note)


@pytest.mark.slow
@pytest.mark.parametrize("machine", MACHINES, ids=lambda one: one.name)
def test_every_number_on_the_page_is_one_of_the_command_line(machine, tmp_path, visit, capsys):
    (fitted, unseen), effect = recorded(machine, tmp_path), machine.effect
    plain = load_model(machine.model)
    study = Study((read_record(fitted, plain),), (read_record(unseen, plain),), effects=machine.choice)
    source = OfflineSource(plain, study, paths=((fitted,), (unseen,)))
    site = Site(source, Place())
    try:
        page = visit(site.address).page
        settled(source, lambda s: s.assessment is not None)
        source.order("diagnose")
        settled(source, lambda s: s.missing is not None)
        page.wait_for_selector(f"[data-candidate='{effect}']")
        choice = [word for name in machine.choice for word in ("--effects", name)]
        said = [ask(capsys, "diagnose", machine.model, fitted, *choice, "--json", "--quiet")]
        check(site, page, said, (machine.model, unseen), tmp_path, capsys)
        (document,) = said
        courses = {f"{one['effect']}@{one['at']}": one["course"] for one in document["candidates"]}
        for one in document["candidates"]:
            if one["course"] is not None and one["p_value"] < 1.0:  # the same evidence
                log_e = math.log(document["level"] / one["p_value"]) + document["threshold"]
                assert one["course"]["log_e"][-1] == pytest.approx(log_e, rel=1e-6) or log_e > 600.0
        hint = page.inner_text("#evidence-hint").replace("\u00a0", " ")
        assert f"log(m/α) = {document['threshold']:.1f}" in hint
        rows = page.locator("[data-evidence]")
        assert rows.count() > 0
        for row in rows.all():
            course = courses[row.get_attribute("data-evidence")]
            assert row.locator("td").nth(0).inner_text() == f"{course['log_e'][-1]:.1f}".replace("-", "−")

        source.order("add", effect)
        settled(source, lambda s: s.effects == (effect,))
        page.wait_for_selector("[data-step='1']")
        check(site, page, [], (machine.model, unseen), tmp_path, capsys)
        page.goto("about:blank")  # a page whose server is gone complains
    finally:
        site.close()
        source.close()


@pytest.mark.slow
@pytest.mark.parametrize("machine", MACHINES, ids=lambda one: one.name)
def test_the_evidence_on_the_page_is_that_of_the_estimator(machine, tmp_path, visit, capsys):
    """Lines, threshold and decisions are those of the published document, and `idloop diagnose` does not object."""
    reading = pytest.importorskip("idloop_nodes.workbench_page.reading", reason="idloop_nodes is not installed")
    (fitted, _), plain = recorded(machine, tmp_path), load_model(machine.model)
    source, site, known = FakeSource(outputs=machine.model), None, None
    source.state.change(missing=None)  # it is of a motor
    try:
        site = Site(source, Place())
        page = visit(site.address).page
        for document in published(plain, read_record(fitted, plain), machine.choice):
            known = reading.evidence_of(document, known)
            source.state.change(evidence=known)
            newest = {one.name: one for one in document.candidates}
            page.wait_for_function(
                f"seconds => ({EVIDENCE})()?.lines.every((one) => one[1] === seconds)",
                arg=document.seconds,
            )
            drawn = page.evaluate(EVIDENCE)
            assert drawn["threshold"] == pytest.approx(document.threshold, rel=1e-12)
            assert len(drawn["lines"]) == min(len(newest), MOST)
            for name, x, y in drawn["lines"]:
                (one,) = [one for one in newest.values() if effect_words(one.name) == name]
                assert (x, y) == pytest.approx((document.seconds, one.log_e), rel=1e-12)
            decided = {effect_words(one.name): one for one in newest.values() if one.decided}
            assert {name for name, *_ in drawn["decided"]} == set(decided)
            for name, x, samples in drawn["decided"]:
                assert samples == decided[name].decided_samples
                assert x == pytest.approx(document.seconds * samples / document.samples)
            # And the table beside it.
            page.wait_for_function(
                "version => document.body.dataset.version === version", arg=str(source.state.snapshot.version)
            )
            assert f"log(m/α) = {document.threshold:.1f}" in page.inner_text("#evidence-hint").replace("\u00a0", " ")
            for one in newest.values():
                row = page.locator(f"[data-evidence='{one.name}'] td")
                assert row.nth(0).inner_text() == f"{one.log_e:.1f}".replace("-", "−")
                when = row.nth(1).inner_text().replace("\u00a0", " ")
                assert when.endswith(f" s, {one.decided_samples} samples" if one.decided else "open")
        choice = [word for name in machine.choice for word in ("--effects", name)]
        said = ask(capsys, "diagnose", machine.model, fitted, *choice, "--json", "--quiet")
        assert said["level"] == document.level
        tested = {f"{one['effect']}@{one['at']}": one for one in said["candidates"]}
        assert set(newest) <= set(tested)
        assert machine.effect in document.decided
        assert all(tested[name]["p_value"] <= said["level"] for name in document.decided)
        page.goto("about:blank")
    finally:
        if site is not None:
            site.close()
        source.close()


def published(model, record, effects):
    """Documents of ``estimator/evidence`` as a graph would publish them over a recording, read back."""
    from idloop_nodes.codec.evidence import evidence_from_statuses, evidence_to_statuses
    from idloop_nodes.estimation.evidence import summarise_evidence

    found = LiveEvidence(model, effects=effects)
    for stop in (6.0, 8.0, 10.0, 12.0):
        earlier, new = record.cut(0.0, stop - 2.0 - 0.5 * STEP), record.cut(stop - 2.0, stop - 0.5 * STEP)
        found = found.update([earlier], new, round(stop * 1e9))
        summary = summarise_evidence(found, round(stop * 1e9))
        yield evidence_from_statuses(evidence_to_statuses("estimator", summary))


def check(site, page, said, opened, folder, capsys):
    """Compare the page with the files that it offers, and with what the command line says of them.

    `opened`: the model that the page was opened with, beside which it shows all others, and the unseen recording.
    """
    model, ladder = folder / "model.yaml", folder / "ladder.json"
    for path in (model, ladder):
        with urllib.request.urlopen(f"{site.address}files/{path.name}") as answer:
            path.write_bytes(answer.read())
    first, unseen = opened
    compared = ask(capsys, "compare", first, model, unseen, "--json", "--quiet")
    climbed = json.loads(ladder.read_text(encoding="utf-8"))
    one = compared["comparisons"][-1]
    page.wait_for_function(
        "model => document.body.dataset.model === model", arg=model_version(site.source.state.snapshot.model)
    )
    # Head, ladder and command line say the same of the same model, to the last digit that is shown.
    last = climbed["ladder"][-1]["validation"]
    shown = page.evaluate("() => [...document.querySelectorAll('#fits .fit')].map((e) => e.dataset.output)")
    assert [name for name in shown if name != "force"] == list(one["free_run"]["fit"])
    for name, fit in one["free_run"]["fit"].items():
        assert last["fit"][name] == pytest.approx(fit, abs=0.02)
        head = page.inner_text(f"#fits [data-output='{name}'] .value")
        assert stands(head.split()[0], "", np.array([fit])), (head, fit)
        ahead = page.inner_text(f"#fits [data-output='{name}'] .what:last-child").replace("\u00a0", " ")
        assert ahead.endswith(f" % {one['ahead']['steps']} steps ahead")
        assert stands(ahead.split()[0], "", np.array([one["ahead"]["fit"][name]])), ahead
        steps = page.locator(f"#steps li:last-child [data-output='{name}']").inner_text()
        assert head.replace("\u00a0", " ") in steps.replace("\u00a0", " ")
    if last["force"] is not None:
        assert last["force"] == pytest.approx(one["force"]["relative_error"], rel=1e-6)
        head = page.inner_text("#fits [data-output='force'] .value")
        assert stands(head.split()[0], "", np.array([100.0 * last["force"]])), head
    figures(page, one, climbed)
    # And no other number of the model stands anywhere.
    known = np.array(list(numbers_of([*said, compared, climbed])))
    for place in TEXTS:
        text = page.evaluate("place => document.querySelector(place).textContent", place)
        for number, power, unit in WITH_UNIT.findall(text):
            assert stands(number, power, known), (place, number, power, unit, text[:300])


def figures(page, compared, climbed):
    """The glyphs of where the model fails, of the residual tests and of the ladder are the numbers of the documents."""
    error = page.input_value("#error")
    variable = page.get_attribute("[data-variable][aria-checked='true']", "data-variable")
    if variable == "time":  # the error itself is drawn, which no document has
        variable = "velocity"
        page.click("[data-variable='velocity']")
    bins = compared["where"][error]["share"][variable]["bins"]
    assert drawn(page, "where", "rms", [one["rms"] for one in bins])
    said = page.inner_text("#residual-words")
    (test,) = [one for one in compared["residual"] if f"error of {one['output']} on" in said]
    assert test["output"] == error or error == "drive force"
    assert ("is white" in said) == test["white"]
    for name, known in (("autocorrelation", test["autocorrelation"]), ("cross", test["cross_correlation"])):
        assert drawn(page, "residual", "y", known), name
    for output in climbed["ladder"][-1]["validation"]["nrmse"]:
        assert drawn(page, "ladder", "x", [step["validation"]["nrmse"][output] for step in climbed["ladder"]])


def drawn(page, place, name, expected):
    """Whether a figure of the page has a column of these numbers; figures follow the words within some ticks."""
    known = np.array([np.nan if one is None else one for one in expected], dtype=float)
    for _ in range(100):
        for one in page.evaluate(COLUMNS, place):
            column = np.array(
                [np.nan if x is None or isinstance(x, str) else x for x in one.get(name, ())], dtype=float
            )
            if len(column) == len(known) and np.allclose(column, known, rtol=1e-6, equal_nan=True):
                return True
        page.wait_for_timeout(100)
    return False
