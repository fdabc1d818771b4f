"""How long a diagnosis takes; nobody else does one, so there are only targets."""

from __future__ import annotations

import numpy as np
from speed.contest import Contest
from speed.result import Claim, Row, Section

ONE = "single/coulomb_friction/axis/axis/clear"
THREE = "triple/coulomb_friction+input_offset+imbalance/axis/0"
FOUR = "single/cable_spring/torsion/load3/weak"
LIMIT = "searches for the noise of predictions, and fits of each effect by the balance"


def run(contest: Contest) -> Section:
    """The catalogue, a ladder, four bodies, and growth with the record."""
    seconds = 10.0 if contest.quick else 60.0
    section = Section("diagnosis", f"Diagnosis: whole catalogue, {seconds:g} s at 1 kHz")
    plan = (
        ("one body, diagnosis", ONE, False, 1.0, 3),
        ("one body, ladder of three", THREE, True, 5.0, 1),
        ("four bodies, diagnosis", FOUR, False, 15.0, 1),
    )
    for work, case, ladder, target, runs in plan:
        row = timed(contest, work, case, seconds, runs, ladder=ladder)
        section.rows.append(row)
        section.claims.append(Claim(work, target, row.seconds, "s", at_least=False, limit=LIMIT))
    lengths = (5.0, 10.0) if contest.quick else (15.0, 30.0, 120.0)
    grown = {seconds: section.rows[0]}
    for length in lengths:
        grown.setdefault(length, timed(contest, f"one body, record of {length:g} s", ONE, length, 1))
    section.rows += [row for length, row in grown.items() if length != seconds]
    known = {length: row.seconds for length, row in sorted(grown.items()) if row.seconds}
    if len(known) > 1:
        first, last = min(known), max(known)
        power = float(np.log(known[last] / known[first]) / np.log(last / first))
        section.claims.append(Claim("power of the record's length with which it grows", 1.1, power, "", at_least=False))
        section.curves["diagnosis, one body"] = {
            "x": [1000.0 * length for length in known], "seconds": list(known.values()), "label": "samples",
        }  # fmt: skip
    section.remarks.append(
        "The cases are those of the diagnosis suite, made as long; `right` says whether what was hidden was found."
        " It uses all cores: processor time, where that is what counts, is that of all together."
    )
    return section


def timed(contest: Contest, work: str, case: str, seconds: float, runs: int, *, ladder: bool = False) -> Row:
    """Median time of one case, by ours."""
    settings = {"case": case, "ladder": ladder, "patience": 120.0}
    data = {"seconds": np.array([seconds])}
    row, answer = contest.enter(work, "idloop", "diagnosis_idloop", data, settings, ours=True, runs=runs)
    row.answer = {name: float(value) for name, value in answer.items()}
    return row
