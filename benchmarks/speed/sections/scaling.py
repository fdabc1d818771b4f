"""How our time and memory grow: with samples, order, outputs and effects."""

from __future__ import annotations

from collections.abc import Iterable

from speed.contest import Contest
from speed.machines import torsion_record
from speed.plants import steps_of_command
from speed.result import Claim, Row, Section

HORIZON = 28
# Effects in the order in which they join the motor.
EFFECTS = (
    "coulomb_friction@motor(level=0.5)", "dead_zone@input(width=0.05)", "quadratic_drag@motor(coefficient=0.05)",
    "cogging@motor(amplitude=0.1, harmonic=6)", "imbalance@motor(amplitude=0.2)", "saturation@input(limit=0.9)",
)  # fmt: skip


def run(contest: Contest) -> Section:
    """Each curve on its own axis."""
    section = Section("scaling", "Growth of time and memory, idloop alone")
    exponents = (3, 4) if contest.quick else (4, 5, 6, 7) if contest.long else (4, 5, 6)
    samples = [10**exponent for exponent in exponents]
    usual = 3000 if contest.quick else 80_000
    curve(section, contest, "N4SID, order 8, four outputs", "samples", samples, lambda n: (n, 8, 4))
    curve(section, contest, f"N4SID, {usual:,} samples", "order", (2, 4, 8, 12, 16), lambda order: (usual, order, 4))
    curve(section, contest, f"N4SID, order 8, {usual:,} samples", "outputs", (1, 2, 3, 4), lambda p: (usual, 8, p))
    effects(section, contest, usual)
    grown = section.curves.get("N4SID, order 8, four outputs")
    if grown and len(grown["x"]) > 1 and None not in grown["memory"]:
        more = max(grown["memory"]) - grown["memory"][0]
        section.claims.append(Claim("memory that the longest record adds", 16.0, more, "MB", at_least=False))
    section.remarks.append("Memory is the peak above the interpreter, its libraries and the data.")
    return section


def curve(section: Section, contest: Contest, name: str, label: str, values: Iterable[int], of: object) -> None:
    """One curve of N4SID; `of` gives samples, order and outputs."""
    rows: list[tuple[int, Row]] = []
    for value in values:
        samples, order, outputs = of(value)  # type: ignore[operator]
        u, y = torsion_record(samples, 1)
        data, settings = {"u": u, "y": y[:, :outputs]}, {"order": order, "horizon": HORIZON}
        row, _ = contest.enter(
            f"{name}: {value:,} {label}", "idloop", "n4sid_idloop", data, settings, ours=True, runs=3
        )
        rows.append((value, row))
    keep(section, name, label, rows)


def effects(section: Section, contest: Contest, samples: int) -> None:
    """Free run of the motor with more and more effects."""
    data, rows = {"command": steps_of_command(samples)}, []
    for count in range(len(EFFECTS) + 1):
        settings = {"effects": EFFECTS[:count], "period": 1e-3}
        row, _ = contest.enter(
            f"simulation: {count} effects", "idloop", "effects_idloop", data, settings, ours=True, runs=7
        )
        rows.append((count, row))
    keep(section, f"simulation, {samples:,} samples", "effects", rows)


def keep(section: Section, name: str, label: str, rows: list[tuple[int, Row]]) -> None:
    """Rows and curve of what could be done."""
    section.rows += [row for _, row in rows]
    done = [(value, row) for value, row in rows if row.seconds is not None]
    section.curves[name] = {
        "x": [value for value, _ in done], "seconds": [row.seconds for _, row in done],
        "memory": [row.memory for _, row in done], "label": label,
    }  # fmt: skip
