"""Results of the estimator as the state of the page."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from idloop.reporting.workbench.state import WARN, Note
from idloop_nodes.codec import (
    Status,
    evidence_from_statuses,
    fit_from_statuses,
    ladder_from_statuses,
    missing_from_statuses,
    parameters_from_statuses,
)
from idloop_nodes.workbench_page.reading import evidence_of, fit_of, ladder_of, missing_of
from idloop_nodes.workbench_page.source import LiveSource

if TYPE_CHECKING:
    from idloop.physics import Model


class PageResults:
    """Takes results in, one method for each topic: `takers`. The estimator starts with `model`."""

    def __init__(self, source: LiveSource, model: Model) -> None:
        self._source, self._page, self._base = source, source.state, model
        self.takers: dict[str, Callable[[list[Status]], None]] = {
            "estimator/fit": self.take_fit,
            "estimator/parameters": self.take_parameters,
            "estimator/missing_effects": self.take_missing,
            "estimator/evidence": self.take_evidence,
            "estimator/ladder": self.take_ladder,
        }

    def take_fit(self, statuses: list[Status]) -> None:
        """Show a fit; take over the structure of its model, whose values come with its parameters."""
        fit = fit_of(fit_from_statuses(statuses))
        self._page.change(fit=fit)
        ladder = self._page.snapshot.ladder
        # A fit that was under way when a step was taken is one of the model before it.
        late = ladder is not None and fit.effects != tuple(ladder.model.effect_names)
        if fit.error or late or fit.effects == tuple(self._source.model.effect_names):
            return
        own = self._base.effect_names
        self._source.model = self._base.with_effects([name for name in fit.effects if name not in own])

    def take_parameters(self, statuses: list[Status]) -> None:
        """Take over the values of the newest fit."""
        told = parameters_from_statuses(statuses)
        found = {one.name: one.value for one in told}
        model = self._source.model
        if not set(model.free) <= set(found) <= {one.name for one in model.parameters}:
            return  # of a fit of the model before the last step, which may have had more or fewer effects
        fitted = model.with_values(found, {one.name: one.stderr for one in told if one.stderr is not None})
        # The same estimates may come again, with another judgement of whether they may be trusted.
        if fitted.values != model.values or self._page.snapshot.assessment is None:
            self._source.model = fitted
            self._source.want("assess")

    def take_missing(self, statuses: list[Status]) -> None:
        """Show a diagnosis."""
        self._page.change(
            missing=missing_of(missing_from_statuses(statuses), self._base.folder),
            looks=self._page.snapshot.looks + 1,
            pictures=None,
            activity=None,
        )
        self._source.want("pictures")

    def take_evidence(self, statuses: list[Status]) -> None:
        """Show the newest evidence after the earlier."""
        summary = evidence_from_statuses(statuses)
        self._page.change(evidence=evidence_of(summary, self._page.snapshot.evidence))

    def take_ladder(self, statuses: list[Status]) -> None:
        """Show the ladder; take over the model of its newest step."""
        summary = ladder_from_statuses(statuses)
        ladder = ladder_of(summary, self._base.folder)
        before = self._page.snapshot
        changes: dict[str, Any] = {"ladder": ladder, "suggested": summary.suggested_experiment}
        if summary.error:
            changes["note"] = Note(summary.error, WARN)
        if ladder is not None:
            effects = tuple(ladder.model.effect_names)
            if before.ladder is None or len(before.ladder.steps) != len(ladder.steps) or effects != before.effects:
                # What was missing from another model need not be missing from this one.
                if before.missing is not None and before.ladder is not None and effects != before.effects:
                    changes |= {"missing": None, "pictures": {}}
                changes["model"] = ladder.model
                self._source.want("assess")
            changes["activity"] = None
        self._page.change(**changes)
