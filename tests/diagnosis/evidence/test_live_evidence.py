"""Evidence that grows with the samples: each stretch is scored by fits to earlier ones."""

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.diagnosis.conftest import RATE, record_of

from idloop.diagnosis.evidence.live_evidence import PARTS, Decision, LiveEvidence, Tally
from idloop.errors import IdloopError, InputError
from idloop.physics import Model, load_model
from idloop.records import Record, record_from_model

STEP = 1.0 / RATE
EFFECTS = ("coulomb_friction", "dead_zone", "input_offset", "load_torque")


def looked(model: Model, whole: Record, looks: int, first: float = 4.0, period: float = 2.0) -> list[LiveEvidence]:
    """The evidence after every look."""
    found = [LiveEvidence(model, effects=EFFECTS)]
    for look in range(looks):
        start = first + look * period
        earlier, new = whole.cut(0.0, start - 0.5 * STEP), whole.cut(start, start + period - 0.5 * STEP)
        found.append(found[-1].update([earlier], new, round((start + period) * 1e9)))
    return found[1:]


def test_the_evidence_for_hidden_friction_rises_until_it_is_decided(start: Model) -> None:
    machine = load_model("axis").with_effects(["coulomb_friction@axis(level=0.1)"])
    found = looked(start, record_of(machine, 1), looks=4)
    rising = [one.logs["coulomb_friction@axis"] for one in found]
    assert np.all(np.diff(rising) > 0.0)
    assert rising[-1] > found[-1].threshold
    # Two looks tell how much neighbouring windows err alike.
    assert not found[0].decided
    assert found[0].pending("coulomb_friction@axis") == "a second stretch of samples must confirm it"
    assert found[1].pending("coulomb_friction@axis") == ""
    first = found[1].decided["coulomb_friction@axis"]
    assert first == Decision(8_000_000_000, 2 * round(2.0 * RATE)) == found[-1].decided["coulomb_friction@axis"]
    assert found[-1].threshold == pytest.approx(np.log(found[-1].count / 0.01))


@pytest.mark.slow
def test_nothing_is_decided_of_a_machine_that_lacks_nothing(start: Model) -> None:
    for seed in range(4):
        last = looked(start, record_of(load_model("axis"), seed), looks=4)[-1]
        assert last.looks == 4
        assert not last.decided


def test_evidence_does_not_depend_on_later_samples(start: Model) -> None:
    quiet, loud = load_model("axis"), load_model("axis").with_effects(["coulomb_friction@axis(level=0.3)"])
    one = looked(start, record_of(quiet, 2), looks=3)
    other = record_of(loud, 3)
    for index, before in enumerate(one[:2]):
        earlier = record_of(quiet, 2).cut(0.0, 6.0 + 2.0 * index - 0.5 * STEP)
        after = before.update([earlier], other.cut(0.0, 2.0), 1)
        kept = {name: tally.sums[: len(before.tallies[name].sums)] for name, tally in after.tallies.items()
                if name in before.tallies}  # fmt: skip
        assert kept == {name: tally.sums for name, tally in before.tallies.items()}


def differences(rng: np.random.Generator, count: int, size: float = 0.2) -> NDArray[np.float64]:
    """Of the log-densities of two normal distributions, on samples of the second."""
    return np.asarray(size * rng.normal(size=count) - 0.5 * size**2)


@pytest.mark.parametrize("level", [0.2, 0.05])
def test_interim_looks_keep_the_level_of_false_alarms(level: float) -> None:
    runs, alarms = 400, 0
    for seed in range(runs):
        rng, tally = np.random.default_rng(seed), Tally()
        for _ in range(30):
            tally = tally.scored(differences(rng, 40))
            if tally.enough and tally.evidence.log >= np.log(1.0 / level):
                alarms += 1
                break
    assert alarms / runs <= level
    assert alarms > 0 or level < 0.1, "samples that could never alarm would say nothing"


def test_errors_that_hang_together_temper_the_evidence() -> None:
    rng = np.random.default_rng(1)
    alone = together = Tally()
    for _ in range(20):
        alone = alone.scored(0.2 + rng.normal(size=40 * PARTS))
        together = together.scored(np.repeat(0.2 + rng.normal(size=PARTS), 40))
    assert together.evidence.design_effect == pytest.approx(40.0, rel=0.4)
    assert together.evidence.log < 0.1 * alone.evidence.log


def test_a_stretch_that_is_too_short_is_refused_with_the_length_that_is_not(start: Model) -> None:
    whole = record_of(load_model("axis"), 1)
    with pytest.raises(IdloopError, match=r"too short to be scored: .* s are needed"):
        LiveEvidence(start, effects=EFFECTS).update([whole.cut(0.0, 4.0)], whole.cut(4.0, 4.11), 1)


def test_a_body_that_nobody_measures_is_one_line(start: Model) -> None:
    model = load_model("lead_screw")
    rng = np.random.default_rng(1)
    time = np.arange(0.0, 3.0, 0.002)
    record = record_from_model("run", model, time, rng.normal(size=len(time)), rng.normal(size=(len(time), 2)))
    with pytest.raises(InputError, match="every body's position or velocity"):
        LiveEvidence(model).update([record.cut(0.0, 2.0)], record.cut(2.0, 3.0), 1)
