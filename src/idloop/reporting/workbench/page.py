"""The figures of one browser: where the model fails, the ladder, the next experiment; each looks as it likes."""

from __future__ import annotations

import asyncio
import functools
import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jinja2
import numpy as np
from bokeh.layouts import column
from bokeh.models import ColumnDataSource
from markupsafe import Markup

from idloop.documents import read_json
from idloop.errors import InputError
from idloop.reporting.figures.comparison import frequency_figures, residual_figures
from idloop.reporting.figures.curves import unknown_figure
from idloop.reporting.figures.effects import evidence_figure
from idloop.reporting.figures.ladder import ladder_figures
from idloop.reporting.figures.next_experiment import experiment_figures
from idloop.reporting.figures.theme import LIGHT, THEMES
from idloop.reporting.figures.where import error_along
from idloop.reporting.residual_findings import REFUTED, least_error
from idloop.reporting.workbench.redraw import Canvas, Drawn, drawn
from idloop.reporting.workbench.state_json import answered
from idloop.validation.variables import TITLES, VARIABLES

if TYPE_CHECKING:
    from bokeh.document import Document

    from idloop.diagnosis import Ladder
    from idloop.diagnosis.design.suggest import Suggestion
    from idloop.reporting.workbench.assessment import Assessment
    from idloop.reporting.workbench.signals import Signals
    from idloop.reporting.workbench.state import Evidence, Snapshot, Source

PERIOD = 250  # milliseconds between two looks at what is new
SPANS = (2, 5, 10, 20, 60, 120)  # seconds that a running page shows
FIGURES = ("where", "frequency", "residual", "evidence", "next", "ladder")
Figures = Callable[[Any], list[Any]]
ASSETS = Path(__file__).with_name("assets")


def judged_spread(ladder: Ladder, name: str) -> float:
    """Standard deviation of an output on the data that judge the last step; 0 where its errors do not say."""
    errors = ladder.steps[-1].validation or ladder.steps[-1].train
    missed, relative = (errors.get(measure, {}).get(name) or np.nan for measure in ("rmse", "nrmse"))
    return float(missed / relative) if np.isfinite(missed / relative) else 0.0


def _made(make: Figures, finding: Any) -> tuple[list[Any], Drawn]:
    figures = [] if finding is None else make(finding)
    return figures, drawn(figures)


def make_page(doc: Document, source: Source, key: str, run: str, stop_port: int) -> None:
    """Fill the document of one browser.

    `key`: without it no order is taken. `run`: of the server: a page of another run loads itself anew. `stop_port`:
    port of `StopServer`.
    """
    request = getattr(doc.session_context, "request", None)
    cookies = {} if request is None else request.cookies
    theme = cookies.get("idloop_theme", LIGHT.name)
    page = Page(doc, source, theme if theme in THEMES else LIGHT.name)
    doc.title = f"idloop workbench: {source.state.snapshot.title}"
    doc.template = _template()
    doc.template_variables.update(
        key=key, run=run, stop_port=stop_port, themes=list(THEMES.values()), state=_first_state(source, run),
        variables=[(name, TITLES[name]) for name in VARIABLES], spans=SPANS,
        theme=page.look["theme"],
    )  # fmt: skip
    # The page has its own words for a lost connection, and loads itself anew when the server is back.
    if hasattr(doc, "config"):  # from Bokeh 3.8 on; before, nobody says or does anything about it
        doc.config.notify_connection_status = False
        doc.config.reconnect_session = False
    doc.add_periodic_callback(page.tick, PERIOD)  # type: ignore[arg-type] # Bokeh awaits it


def _first_state(source: Source, run: str) -> str:
    """What the page would ask for first, as JSON that may stand in a page."""
    return json.dumps(answered(source, run), allow_nan=False).replace("<", "\\u003c")


@functools.cache
def _template() -> jinja2.Template:
    environment = jinja2.Environment(autoescape=True, trim_blocks=True, undefined=jinja2.StrictUndefined)
    # In the page itself: a browser shows nothing before it has them, and asks for each of them by itself.
    environment.globals["asset"] = lambda name: Markup((ASSETS / name).read_text(encoding="utf-8"))  # noqa: S704  (ours)
    return environment.from_string((ASSETS / "page.html").read_text(encoding="utf-8"))


class Page:
    """What one browser shows.

    `look` is what the reader has chosen: theme, error and variable of where it fails; whether the page can be seen at
    all; and the places of figures that have come near to sight.
    """

    def __init__(self, doc: Document, source: Source, theme: str) -> None:
        self.source = source
        self.signals: Signals = source.signals
        # The page itself is there sooner when no figure is drawn before the browser asks for them.
        self.look: dict[str, Any] = {"theme": theme, "error": "", "variable": "", "seen": False, "near": []}
        self._doc = doc
        self._drawn: dict[str, tuple[Any, Any]] = {}
        self._making = False
        self.choice = ColumnDataSource(name="look", data={"json": [json.dumps(self.look)]})
        self.choice.on_change("data", self._chosen)
        self.roots = {name: column(name=name, sizing_mode="stretch_width") for name in FIGURES}
        self._canvases = {name: Canvas(root) for name, root in self.roots.items()}
        for root in (*self.roots.values(), self.choice):
            doc.add_root(root)

    def _chosen(self, attribute: str, old: Any, new: Any) -> None:
        try:
            look = read_json(new["json"][0], "look")
        except (KeyError, IndexError, TypeError, InputError):
            return
        if isinstance(look, dict):
            self.look = self._checked(look)
            self._tick_soon()

    def _checked(self, look: dict[str, Any]) -> dict[str, Any]:
        """What the browser says, with what makes no sense left as it was."""
        rules: dict[str, Callable[[Any], bool]] = {
            "theme": lambda v: v in THEMES,
            "error": lambda v: isinstance(v, str),
            "variable": lambda v: v in VARIABLES or not v,
            "seen": lambda v: isinstance(v, bool),
            "near": lambda v: isinstance(v, list) and set(map(str, v)) <= set(FIGURES),
        }
        return self.look | {name: look[name] for name, fits in rules.items() if name in look and fits(look[name])}

    @property
    def _theme(self) -> Any:
        return THEMES[self.look["theme"]]

    async def tick(self) -> None:
        """Show what is new, one place of the page in each call.

        Figures are made on a thread of their own: the strips ask this one for their pictures. A page in the background
        costs nothing.
        """
        snapshot = self.source.state.snapshot
        # One after the other: of two that are made at once, the older may be ready last.
        new = self._new_finding(snapshot) if self.look["seen"] and not self._making else None
        if new is None:
            return
        name, make, finding, anew = new
        self._making = True
        try:
            figures, wanted = await asyncio.to_thread(_made, make, finding)
        finally:
            self._making = False
        self._doc.hold("combine")
        try:
            self._canvases[name].show(figures, wanted, anew=anew)
        finally:
            self._doc.unhold()
        self._tick_soon()

    def _tick_soon(self) -> None:
        self._doc.add_next_tick_callback(self.tick)  # type: ignore[arg-type] # Bokeh awaits it

    def _new_finding(self, snapshot: Snapshot) -> tuple[str, Figures, Any, bool] | None:
        """Place of the first finding that is new, what makes its figures, and whether they are drawn anew.

        A figure costs the browser 5 MB: those of a live graph, which is watched for hours, are drawn from when the
        reader has come near to them. A recording has all of them, on paper too.
        """
        theme = self.look["theme"]
        parts: dict[str, tuple[Any, Figures]] = {
            "next": (snapshot.suggestion, self._next),  # the reader waits for it before the motor moves
            "where": (snapshot.assessment, self._where),
            "frequency": (snapshot.assessment, self._frequency),
            "residual": (snapshot.assessment, self._residual),
            "ladder": (snapshot.ladder, self._ladder),
            "evidence": (snapshot.evidence, self._evidence),
        }
        for name, (finding, make) in parts.items():
            if snapshot.live and name not in self.look["near"]:
                continue
            look = (theme, self.look["error"], self.look["variable"]) if finding is snapshot.assessment else (theme,)
            before = self._drawn.get(name)
            if before is None or before[0] is not finding or before[1] != look:
                self._drawn[name] = finding, look
                return name, make, finding, before is not None and before[1][0] != theme
        return None

    # on a thread of its own

    def _next(self, found: Suggestion) -> list[Any]:
        return list(experiment_figures(found, self._theme))

    def _where(self, found: Assessment) -> list[Any]:
        if not found.where.maps:
            return []
        names = [one.name for one in found.where.maps]
        one = found.where[self.look["error"] if self.look["error"] in names else names[0]]
        plot = error_along([(found.model.name, one)], self.look["variable"] or "velocity", self._theme)
        return [] if plot is None else [plot]

    def _frequency(self, found: Assessment) -> list[Any]:
        if found.frequency is None:
            return []
        output = self.signals.names.index(found.looked_at(self.look["error"]))
        return frequency_figures(found.frequency, output, self._theme)

    def _residual(self, found: Assessment) -> list[Any]:
        tests = {one.test.name: one.test for one in found.residual_tests}
        test = tests.get(found.looked_at(self.look["error"]))
        return [] if test is None else residual_figures(test, self._theme)

    def _evidence(self, found: Evidence) -> list[Any]:
        grown = (found.seconds, found.lines, found.threshold, found.decided)
        return [evidence_figure(*grown, self._theme, recorded=found.recorded)] if found.lines else []

    def _ladder(self, ladder: Ladder) -> list[Any]:
        if not ladder.steps:
            return []
        every = self._floor(ladder).items()
        floor = {name: value for name, value in every if value * REFUTED <= least_error(ladder, name)}
        unknown = [] if ladder.unknown is None else [unknown_figure(ladder.unknown, self._theme)]
        return [*ladder_figures(ladder, floor, self._theme), *unknown]

    def _floor(self, ladder: Ladder) -> dict[str, float]:
        """What the noise of each output alone leaves, relative to the spread of what the ladder is judged on."""
        measured = self.signals.view(*self.signals.span, buckets=10**9, streams=["measured"]).points["measured"][1]
        floor = {}
        for index, name in enumerate(self.signals.names):
            known = measured[:, index][np.isfinite(measured[:, index])]
            # What is shown may have moved on, and much further, since the ladder's last step.
            spread = judged_spread(ladder, name) or (float(np.std(known)) if len(known) else 0.0)
            if spread > 0.0 and np.isfinite(self.signals.noise[index]):
                floor[name] = float(self.signals.noise[index]) / spread
        return floor
