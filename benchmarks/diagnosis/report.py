"""Tables of a run: every criterion with counts and 95 % intervals, by effect and by condition.

    python benchmarks/diagnosis/report.py results.jsonl
    python benchmarks/diagnosis/report.py results.jsonl --failures     # what was found instead, case by case

The tables by effect and by view cover all cases of a category, testable or not.
The answers are judged again here from what the run wrote down, so a rule about twins that changes needs no new
run. A hidden effect counts as testable by `oracle` alone (realistic ones by `drive_oracle`): the diagnosis has no part
in it.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "examples"))
sys.path.insert(0, str(Path(__file__).resolve().parent))

from case import CATEGORIES, Case
from drive_oracle import WORTH
from experiment import start_model
from intervals import clopper_pearson
from oracle import HOPELESS, TESTABLE
from score import Rung, Score, score
from twins import pieces

from idloop.diagnosis.evidence.detection_limit import DetectionLimit

RATIO = 1.10


@dataclass(frozen=True)
class Answer:
    """One line of results with its judgement."""

    case: Case
    row: dict[str, Any]
    score: Score

    @property
    def gains(self) -> tuple[float, ...]:
        """Gain of each hidden effect; NaN in a quick run."""
        known = self.row.get("gains", {})
        return tuple(float(known.get(name, float("nan"))) for name in self.case.truth)

    @property
    def testable(self) -> bool:
        """All hidden effects are testable."""
        if self.case.nuisances is not None:
            return all(share >= WORTH for share in self.row["worth"].values())
        return all(gain >= TESTABLE for gain in self.gains)

    @property
    def right(self) -> bool:
        """Everything hidden was found, or said not to show, and nothing false was named."""
        if self.case.category == "untestable":
            return self.trap_answered
        return all(self.score.found) and not self.score.false

    @property
    def view(self) -> str:
        """The view of the data that decided: ``force``, ``prediction``, ..."""
        return str(self.row["criterion"])

    @property
    def unexplained(self) -> str:
        """Force that the first and the last model leave unexplained on the unseen record."""
        errors = self.row.get("force_error", (None, None))
        return " -> ".join("-" if error is None else f"{100.0 * error:.1f} %" for error in errors)

    @property
    def hopeless(self) -> bool:
        """The hidden effect cannot be seen."""
        return all(gain < HOPELESS for gain in self.gains)

    @property
    def convention(self) -> bool:
        """What is hidden is no effect at all, such as the place at which a lone position sensor reads zero."""
        model = start_model(self.case, self.row["seed"])
        return any(not pieces(self.case, model, name) for name in self.case.truth)

    @property
    def ratio(self) -> float | None:
        """Validation error beside that of the true structure."""
        value = self.row.get("validation", {}).get("ratio")
        return None if value is None else float(value)

    @property
    def trap_answered(self) -> bool:
        """Said that the data cannot show it, or named a set that holds it, and nothing false."""
        if self.score.false:
            return False
        if self.row["verdict"] == "not_excited" or all(self.score.found):
            return True
        named = any(name in self.row["untestable"] for name in self.case.truth)
        return not self.row["added"] and named

    @property
    def size_told(self) -> bool:
        """Said that the data would not show an effect of this size, and nothing false."""
        limits = self.row.get("shows_from", {})
        if self.score.false or not self.case.hidden:
            return False
        for hidden in self.case.hidden:
            limit = limits.get(hidden.name)
            if limit is None or not DetectionLimit.from_dict(limit).undetectable(hidden.values[limit["parameter"]]):
                return False
        return True

    @property
    def condition(self) -> str:
        """Disturbance and noise in a few words."""
        words = [] if self.case.disturbance.kind == "none" else [f"{self.case.disturbance.kind} torque"]
        words += ["coloured noise"] if self.case.noise.kind == "ar" else []
        words += ["rounded"] if self.case.quantisation else []
        return ", ".join(words) or "white noise only"


def answers(path: Path, level: float | None = None) -> tuple[list[Answer], list[dict[str, Any]]]:
    """Read results; failed cases apart."""
    from cases import cases_of

    rows = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines() if line.strip()]
    known = {case.id: case for case in cases_of({row["id"] for row in rows}.__contains__)}
    found, failed = {}, {}
    for row in rows:
        if row["id"] not in known or (level is not None and row["level"] != level):
            continue
        key = row["id"], row["level"], row["seed"]
        if "error" in row:
            failed[key] = row
            continue
        failed.pop(key, None)
        case = known[row["id"]]
        added = [Rung(a["name"], tuple(a["set"]), a["replaces"], a["p_value"], a["gain"]) for a in row["added"]]
        found[key] = Answer(case, row, score(case, start_model(case, row["seed"]), added))
    return list(found.values()), list(failed.values())


def share(hits: Iterable[bool]) -> str:
    """``hits/count  percent (low .. high)``."""
    values = list(hits)
    if not values:
        return f"{'-':>9}"
    low, high = clopper_pearson(sum(values), len(values))
    percent = 100.0 * sum(values) / len(values)
    return f"{sum(values):4}/{len(values):<4} {percent:6.1f} % ({100 * low:5.1f} .. {100 * high:5.1f})"


def table(title: str, chosen: Sequence[Answer], key: Callable[[Answer], str], hit: Callable[[Answer], bool]) -> None:
    """Shares by a property of the case."""
    print(f"\n{title}")
    for name in sorted({key(a) for a in chosen}):
        print(f"  {name:44.44} {share(hit(a) for a in chosen if key(a) == name)}")


def strength_of_gain(answer: Answer) -> str:
    """Band of the smallest gain."""
    gain = min(answer.gains)
    for limit in (HOPELESS, TESTABLE, 50.0, 200.0, 1000.0):
        if gain < limit:
            return f"gain below {limit:6.0f}"
    return "gain 1000 and more"


def criteria(every: Sequence[Answer], level: float) -> None:
    """The numbers that the suite is for."""
    by = {name: [a for a in every if a.case.category == name] for name in CATEGORIES}
    judged = [a for a in every if "gains" in a.row or a.case.category == "clean"]
    single = [a for a in by["single"] if a in judged and a.testable]
    print(f"level {100 * level:g} %, {len(every)} cases")
    lines = [
        ("testable single effect: the set contains it", "98 %", [a.score.found[0] for a in single]),
        ("... and is exactly one effect (twins are one)", "90 %", [a.score.exact for a in single]),
        ("two testable effects: both found", "95 %", [all(a.score.found) for a in by["double"] if a.testable]),
        ("three testable effects: all found", "90 %", [all(a.score.found) for a in by["triple"] if a.testable]),
        ("nothing hidden: a false effect", f"{100 * level:g} %", [bool(a.score.false) for a in by["clean"]]),
        (
            "... with AR(0.9) torque",
            f"{100 * level:g} %",
            [bool(a.score.false) for a in by["clean"] if a.case.disturbance.kind == "ar"],
        ),
        (
            "... with AR(0.9) torque or coloured noise",
            f"{100 * level:g} %",
            [bool(a.score.false) for a in by["clean"] if a.case.disturbance.kind == "ar" or a.case.noise.kind == "ar"],
        ),
        (
            "a false effect on top of all right ones",
            f"{100 * level:g} %",
            [bool(a.score.false) for a in every if a.case.hidden and all(a.score.found)],
        ),
        (
            "realistic: every effect worth its name found",
            "95 %",
            [all(a.score.found) for a in by["realistic"] if a.case.hidden and a.testable],
        ),
        (
            "realistic: a false effect",
            f"{100 * level:g} %",
            [bool(a.score.false) for a in by["realistic"]],
        ),
        (
            f"validation error at most {RATIO:g} of the true structure's",
            "95 %",
            [a.ratio <= RATIO for a in every if a.ratio is not None and a.case.category != "untestable"],
        ),
        (
            "untestable on purpose: said so, or right set",
            "95 %",
            [a.trap_answered for a in every if a.case.category == "untestable"],
        ),
        (
            "... or that one of its size would not show",
            "95 %",
            [a.trap_answered or a.size_told for a in every if a.case.category == "untestable"],
        ),
        (
            "untestable on purpose: resolved by the suggestion",
            "90 %",
            [bool(a.row["resolved"]) for a in every if "resolved" in a.row],
        ),
        (
            "... where it is no convention of the origin",
            "90 %",
            [bool(a.row["resolved"]) for a in every if "resolved" in a.row and not a.convention],
        ),
    ]
    for text, wanted, hits in lines:
        print(f"  {text:56} wanted {wanted:>5}  {share(hits)}")


def by_effect_and_view(every: Sequence[Answer]) -> None:
    """For every category: all found and nothing false, by each hidden effect and by the view that decided.

    A case with two effects counts at each of them. Testable or not: a quick run knows no testability.
    """
    for category in CATEGORIES:
        own = [a for a in every if a.case.category == category]
        if not own:
            continue
        effects = sorted({hidden.effect for a in own for hidden in a.case.hidden}) or ["none"]
        if any(not a.case.hidden for a in own) and "none" not in effects:
            effects.append("none")
        print(f"\n{category}: {'':{max(42 - len(category), 0)}} {'right':41} {'that effect found':41} a false effect")
        for name in effects:
            chosen = [a for a in own if name in _effects(a)]
            _line(name, chosen, name)
        for view in sorted({a.view for a in own}):
            _line(f"view {view}", [a for a in own if a.view == view], None)
            for name in effects:
                chosen = [a for a in own if a.view == view and name in _effects(a)]
                if chosen:
                    _line(f"  {name}", chosen, name)


def _effects(answer: Answer) -> list[str]:
    return [hidden.effect for hidden in answer.case.hidden] or ["none"]


def _line(title: str, chosen: Sequence[Answer], effect: str | None) -> None:
    """Shares of some answers: right, one effect found (all of them without one), anything false."""
    found = [
        hit
        for a in chosen
        for hidden, hit in zip(a.case.hidden, a.score.found, strict=True)
        if effect is None or hidden.effect == effect
    ]
    false = [bool(a.score.false) for a in chosen]
    print(f"  {title:42.42} {share(a.right for a in chosen):41} {share(found):41} {share(false)}")


def details(every: Sequence[Answer]) -> None:
    """The same by effect and by condition."""
    single = [a for a in every if a.case.category == "single" and a.testable]
    hidden = [a for a in every if a.case.category in ("single", "double", "triple") and a.testable]
    clean = [a for a in every if a.case.category == "clean"]
    traps = [a for a in every if a.case.category == "untestable"]
    effect, found = (lambda a: a.case.effect), (lambda a: all(a.score.found))
    table("testable single effects, set contains it, by effect", single, effect, found)
    table("... is exactly one, by effect", single, effect, lambda a: a.score.exact)
    table(
        "all single effects, set contains it, by gain of an observer that knows the noise",
        [a for a in every if a.case.category == "single"],
        strength_of_gain,
        found,
    )
    table("two and three, all found", [a for a in hidden if a not in single], effect, found)
    for title, key in (
        ("machine", lambda a: a.case.machine),
        ("simulator", lambda a: a.case.simulator),
        ("loop", lambda a: a.case.loop),
        ("excitation", lambda a: a.case.training[0].kind),
        ("recordings", lambda a: str(len(a.case.training))),
        ("disturbance and noise", lambda a: a.condition),
        ("disturbance torque", lambda a: f"{100 * a.case.disturbance.share:g} %"),
        ("noise told", lambda a: "told" if a.case.noise.told else "to be found"),
        ("strength", lambda a: a.case.strength or "-"),
    ):
        table(f"all found, by {title}", hidden, key, found)
        table(f"false effect where something is hidden, by {title}", hidden, key, lambda a: bool(a.score.false))
        if title != "strength":
            table(f"false effect where nothing is hidden, by {title}", clean, key, lambda a: bool(a.score.false))
    table("untestable on purpose, answered, by reason", traps, lambda a: a.case.trap, lambda a: a.trap_answered)
    table("validation error within bound, by category", [a for a in every if a.ratio is not None],
          lambda a: a.case.category, lambda a: a.ratio is not None and a.ratio <= RATIO)  # fmt: skip
    seconds = sorted(float(a.row["seconds"]) for a in every)
    if seconds:
        print(f"\nprocessor seconds of a ladder: median {seconds[len(seconds) // 2]:.1f}, most {seconds[-1]:.1f}")


def _worth(answer: Answer) -> str:
    """What the hidden effects could have been worth, by the oracle of the case."""
    if answer.case.nuisances is not None:
        return f"worth {answer.row['worth']}"
    return f"gains {[round(g, 1) for g in answer.gains]} ratio {answer.ratio and round(answer.ratio, 3)}"


def failures(every: Sequence[Answer]) -> None:
    """What went wrong, grouped by kind."""
    kinds: dict[str, list[Answer]] = {}
    for a in every:
        if a.case.category == "untestable":
            if not a.trap_answered:
                kinds.setdefault("untestable, answered wrongly", []).append(a)
            continue
        if a.case.hidden and a.testable and not all(a.score.found):
            kinds.setdefault("testable, not found", []).append(a)
        elif a.case.category == "single" and a.testable and not a.score.exact:
            kinds.setdefault("testable, found in a larger set", []).append(a)
        if a.score.false:
            kinds.setdefault("false effect", []).append(a)
        if a.ratio is not None and a.ratio > RATIO:
            kinds.setdefault("validation error too large", []).append(a)
    for kind, several in kinds.items():
        print(f"\n{kind}: {len(several)}")
        for a in several:
            print(
                f"  {a.case.id}  [{a.case.simulator} {a.case.loop} {a.case.training[0].kind} {a.condition}"
                f" {100 * a.case.disturbance.share:g} %] view {a.view} verdict {a.row['verdict']}"
                f" {_worth(a)} force unexplained {a.unexplained}"
            )
            for item in a.row["added"]:
                gain = item["gain"]
                tail = f" in place of {item['replaces']}" if item["replaces"] else ""
                shown = "" if gain is None else f" gain {gain:.1f}"
                print(f"      + {' | '.join(item['set'])}{tail}  p {item['p_value']:.2g}{shown}")


def main() -> int:
    """Print the report."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("results", type=Path)
    parser.add_argument("--failures", action="store_true", help="list what went wrong instead of the tables")
    parser.add_argument("--details", action="store_true", help="also by effect and by condition")
    arguments = parser.parse_args()
    every, failed = answers(arguments.results)
    for level in sorted({a.row["level"] for a in every}):
        chosen = [a for a in every if a.row["level"] == level]
        if arguments.failures:
            failures(chosen)
            continue
        criteria(chosen, level)
        by_effect_and_view(chosen)
        if arguments.details:
            details(chosen)
    for row in failed:
        print(f"failed: {row['id']}: {row['error']}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
