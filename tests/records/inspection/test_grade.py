"""Three grades, each with its reason."""

from __future__ import annotations

from idloop.records import Finding
from idloop.records.inspection.grade import grade


def _fault(kind, *spoils, level="warning"):
    return Finding(kind, f"{kind} seen; mend it", cure="mend it", spoils=spoils, level=level)


def test_grades():
    assert grade("usable", []) == ("usable", "no fault found")
    assert grade("usable", [_fault("a", level="note")])[0] == "usable"
    assert grade("usable", [_fault("a"), _fault("b")]) == ("usable with care", "a seen (and 1 more)")
    assert grade("usable", [_fault("a"), _fault("b", "x", "y")]) == ("not usable for x and y", "b seen")
    assert grade("usable", [_fault("a", "x"), _fault("b", "identification")])[0] == "not usable for identification"
    assert grade("not_excited", [])[0] == "not usable for identification"
    assert grade("short", [])[0] == "usable with care"
