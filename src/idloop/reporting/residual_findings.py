"""What a model leaves over: tests of its one-step errors, and the noise of the sensors held against the data."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from idloop.arrays import Array
from idloop.errors import IdloopError
from idloop.p_values import p_value_text
from idloop.validation.measures import NEGLIGIBLE, nrmse

if TYPE_CHECKING:
    from idloop.diagnosis import Ladder
    from idloop.physics import Model
    from idloop.records import Record
    from idloop.validation import Comparison
    from idloop.validation.residual import ResidualTest


# The residual tests look at 25 lags, which fewer samples do not carry.
FEWEST_FOR_TESTS = 100


@dataclass(frozen=True)
class ResidualFinding:
    """Residual test of one output on one record."""

    record: str
    test: ResidualTest

    @property
    def drive(self) -> str:
        """What the errors were tested against, as one says it of a machine."""
        return "command" if self.test.against == "input" else self.test.against

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {"record": self.record, **self.test.to_dict()}


def residual_findings(comparisons: Iterable[Comparison]) -> list[ResidualFinding]:
    """Tests of the one-step errors of every output.

    `comparisons`: one model on one or several records.
    Returns: records that are too short for the tests are left out, and outputs of which the free run misses a
    negligible part: what is left of exact data is the simulator's doing.
    """
    return [
        ResidualFinding(one.record.name, test)
        for one in comparisons
        if len(one.time) >= FEWEST_FOR_TESTS
        for test, missed in zip(one.residual_tests(), _missed(one), strict=False)
        if not missed < NEGLIGIBLE
    ]


def _missed(one: Comparison) -> Array:
    """Error of the free run as a part of each output's standard deviation."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(nrmse(one.measured, one.simulated))


def residual_line(label: str, test: ResidualTest) -> str:
    """Both tests of an output of a model in one line."""
    white = "white" if test.white else "not white"
    free = f" (p {test.cross_p:.2g})" if test.decided else ""
    return f"{label}: residual of {test.name} is {white} (Ljung-Box p {test.ljung_box_p:.2g}) and {test.freedom}{free}"


def findings_on_records(model: Model, records: Sequence[Record]) -> list[ResidualFinding]:
    """As `residual_findings`, of a model on records."""
    from idloop.validation import compare

    found = []
    for record in records:
        # What cannot be compared cannot be tested; the verdict stands by itself then.
        with contextlib.suppress(IdloopError):
            if len(record.time) >= FEWEST_FOR_TESTS:
                found += residual_findings([compare(model, record)])
    return found


def residual_warnings(verdict: str, found: Sequence[ResidualFinding]) -> list[str]:
    """What the tests say against a verdict that reads as if noise were left.

    `found`: on the fitted data.
    Returns: what more is left, and of which outputs; empty where the verdict says so already.
    """
    from idloop.diagnosis.search.step import NOISE_VERDICTS  # not before: a comparison needs no diagnosis

    if verdict not in NOISE_VERDICTS:
        return []
    follows = [one for one in found if one.test.follows]
    coloured = [one for one in found if one.test.coloured and one.test.name not in {o.test.name for o in follows}]
    structure = "a structure that no effect that was looked for explains significantly"
    lines = []
    if follows:
        p = min(one.test.cross_p for one in follows)
        what = f"still {'follow' if _several(follows) else 'follows'} the {follows[0].drive} (p {p_value_text(p)})"
        lines.append(f"but {_errors(follows, found)} {what}: {structure} is left")
    if coloured:
        p = min(one.test.ljung_box_p for one in coloured)
        what = f"{'are' if _several(coloured) else 'is'} not white (Ljung-Box p {p_value_text(p)})"
        lines.append(f"but {_errors(coloured, found)} {what}: noise or a disturbance with a memory, or {structure}")
    return lines


def _several(part: Sequence[ResidualFinding]) -> bool:
    return len({one.test.name for one in part}) > 1


def _errors(part: Sequence[ResidualFinding], whole: Sequence[ResidualFinding]) -> str:
    """Whose errors, and in how many of the records."""
    from idloop.spelling import joined_names

    names = list(dict.fromkeys(one.test.name for one in part))
    records, all_ = len({one.record for one in part}), len({one.record for one in whole})
    where = f" in {records} of {all_} records" if all_ > 1 else ""
    where += " on the fitted data" if all_ < 2 else " of the fitted data"
    return f"the one-step error{'s' if len(names) > 1 else ''} of {joined_names(names)}{where}"


# The stated noise is refuted where a model misses less than this part of it, over so many samples at least: with
# fewer, or closer to it, that happens by chance.
REFUTED = 0.7
FEWEST = 100


def refuted_noise(comparisons: Iterable[Comparison]) -> dict[str, float]:
    """Outputs of which a model misses less than the stated noise, and how much that is.

    Returns: least rms of the free-run error, which bounds the noise that the sensor really has, by the name of the
    output.
    """
    least: dict[str, float] = {}
    for one in comparisons:
        if len(one.time) < FEWEST:
            continue
        for output in one.model.outputs:
            missed = one.rmse[output.name]
            if output.noise is not None and missed < REFUTED * output.noise:
                least[output.name] = min(missed, least.get(output.name, np.inf))
    return least


def believed_noise(model: Model, refuted: Iterable[str]) -> dict[str, float]:
    """Standard deviation of the noise of each output: stated by the model file, and not among the refuted ones."""
    wrong = set(refuted)
    return {o.name: o.noise for o in model.outputs if o.noise is not None and o.name not in wrong}


def least_error(ladder: Ladder, name: str) -> float:
    """Least NRMSE of an output on the data that judge, at any step; infinite where none is known.

    A floor well above it is none. Other data have another motion, and so another NRMSE for the same noise.
    """
    every = [(step.validation or step.train).get("nrmse", {}).get(name) for step in ladder.steps]
    return min((float(one) for one in every if one is not None and np.isfinite(one)), default=np.inf)
