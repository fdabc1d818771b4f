"""How the evidence for missing effects grows over the recordings of a diagnosis."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from idloop.reporting.figures.evidence import Decided
from idloop.reporting.terms import effect_words
from idloop.reporting.workbench.state import Evidence

if TYPE_CHECKING:
    from idloop.diagnosis import Diagnosis
    from idloop.records import Record


def recorded_evidence(found: Diagnosis, records: Sequence[Record]) -> Evidence | None:
    """Return a line for each effect that was evaluated; None where none was.

    `records`: what it was made of: the samples that it scored, of all or some, are spread over their time.
    """
    courses = {
        one.name: one.course
        for one in found.candidates
        if one.course is not None and one.course.log_e and all(map(math.isfinite, one.course.log_e))
    }
    if not courses:
        return None
    # Two effects that show only together have courses of their own where one was evaluated alone.
    samples = next(iter(courses.values())).samples
    courses = {name: course for name, course in courses.items() if course.samples == samples}
    duration = sum(float(record.time[-1] - record.time[0]) for record in records)
    seconds = tuple(duration * one / samples[-1] for one in samples)
    reached = {name: course.decided(found.threshold) for name, course in courses.items()}
    # What the diagnosis has a reason against, or does not find significant beside its scatter, is not decided.
    named = found.best is not None
    decided = {
        name: Decided(seconds[place], samples[place], courses[name].log_e[place])
        for name, place in reached.items()
        if place is not None and named and name not in found.passed_over
    }
    first = min(decided, key=lambda name: (name not in found.set, decided[name].seconds), default=None)
    above = sum(place is not None for place in reached.values())
    line = f"no effect is decided in {duration:.3g} s"
    if first is not None:
        tied = len(found.set) > 1 and not found.pair
        what = f"one of the {len(found.set)} effects that tie" if tied else effect_words(first)
        line = f"{what} is decided after {decided[first].seconds:.3g} of {duration:.3g} s"
    elif above:
        line += f"; the threshold is reached by {above} that {'is' if above < 2 else 'are'} not added"
    lines = {name: course.log_e for name, course in courses.items()}
    return Evidence(line, found.model.effect_names, seconds, lines, found.threshold, decided, recorded=True)
