"""What the estimator orders, refuses and does next, without a node and without a worker."""

from __future__ import annotations

import json

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop.errors import InputError
from idloop_nodes.codec import LadderSummary, MissingSummary, Status
from idloop_nodes.estimation.coordinator import MAXIMUM_EXPERIMENTS, Autopilot, Coordinator
from idloop_nodes.estimation.diagnosis_jobs import (
    ADD_BEST,
    DESIGN,
    DIAGNOSE,
    EFFECTS,
    SUGGEST,
    UNDO,
    DiagnosisAnswer,
    MotionLimits,
)
from idloop_nodes.estimation.whiteness_watch import WhitenessWatch

TIE = ("dead_zone@input", "coulomb_friction@motor")


def missing_summary(verdict, effects=()):
    return MissingSummary((Status("e: missing effects", values={"verdict": verdict, "set": " ".join(effects)}),))


def ladder_summary(suggested=""):
    head = Status("e: ladder", values={"suggested_experiment": suggested, "error": ""})
    return LadderSummary((head, Status("e: step 0"), Status("e: step 1")))


LADDER = ladder_summary()


class Office:
    """A coordinator whose worker and excitation are played by the test."""

    def __init__(self, *pilot, data=True):
        self.orders, self.log, self.experiments = [], [], []
        self.asked = 0
        self.data = data
        self.pilot = Autopilot(*pilot)
        self.coordinator = Coordinator(
            self.submit, self.experiments.append, self.ask, lambda: self.pilot, self.log.append
        )

    def submit(self, verb, state, **more):
        if not self.data:
            raise InputError("too few samples yet")
        self.orders.append((verb, state, more))
        return f"{verb} on 30 s"

    def ask(self):
        self.asked += 1

    def answer(self, verb=None, **more):
        verb = verb or self.coordinator.ordered
        answer = DiagnosisAnswer(verb, 5, **({"state": verb.encode()} | more))
        taken = self.coordinator.take(answer)
        if taken is not None:
            self.coordinator.go_on(taken)
        return taken

    def found(self, verdict, effects=()):
        return self.answer(missing=missing_summary(verdict, effects), ladder=LADDER)

    @property
    def verbs(self):
        return [order[0] for order in self.orders]


def test_one_order_at_a_time():
    office = Office()
    assert office.coordinator.order(DIAGNOSE) == "diagnose on 30 s"
    assert office.coordinator.busy
    for verb in (DIAGNOSE, ADD_BEST, UNDO, SUGGEST):
        with pytest.raises(InputError, match="diagnose is under way"):
            office.coordinator.order(verb)
    office.found("adequate")
    assert not office.coordinator.busy
    assert office.coordinator.order(DIAGNOSE)


def test_orders_without_their_grounds_are_refused():
    office = Office()
    for verb, said in ((ADD_BEST, "diagnose first"), (UNDO, "no step"), (SUGGEST, "diagnose first")):
        with pytest.raises(InputError, match=said):
            office.coordinator.order(verb)
    assert not office.orders
    with pytest.raises(InputError, match="too few samples"):
        Office(data=False).coordinator.order(DIAGNOSE)


def test_without_autopilot_nothing_follows():
    office = Office()
    office.coordinator.order(DIAGNOSE)
    office.found("missing", TIE)
    assert office.verbs == [DIAGNOSE]
    assert not office.asked
    office.coordinator.order(ADD_BEST)
    assert office.orders[-1][1] == b"diagnose", "the state of the last answer goes with the next order"
    office.answer(ladder=LADDER)
    assert office.verbs == [DIAGNOSE, ADD_BEST]
    with pytest.raises(InputError, match="diagnose first"):
        office.coordinator.order(ADD_BEST)
    office.coordinator.order(UNDO)
    office.answer(ladder=LADDER)
    assert office.verbs[-1] == UNDO


def test_the_autopilot_climbs_until_nothing_is_left():
    office = Office(True, True, False)
    office.coordinator.order(DIAGNOSE)
    office.found("missing", TIE)
    office.answer(ladder=LADDER)
    office.found("missing", TIE[:1])
    office.answer(ladder=LADDER)
    office.found("adequate")
    assert office.verbs == [DIAGNOSE, ADD_BEST, DIAGNOSE, ADD_BEST, DIAGNOSE]
    assert not office.coordinator.busy


def suggestion():
    return ladder_summary(json.dumps({"text": "try", "experiment": {"adds_to": "command"}}))


def test_what_ties_is_settled_by_an_experiment_first():
    office = Office(True, True, True)
    office.coordinator.order(DIAGNOSE)
    office.found("missing", TIE)
    assert office.asked == 1
    assert office.coordinator.busy, "simulated time waits for the excitation too"
    office.coordinator.limits_known(MotionLimits(amplitude=2.0))
    assert office.orders[-1][0] == SUGGEST
    assert office.orders[-1][2]["limits"].amplitude == 2.0
    office.answer(ladder=suggestion())
    assert json.loads(office.experiments[0]) == {"adds_to": "command"}
    office.coordinator.handed_over("experiment from 1 s to 2 s")
    assert not office.coordinator.busy
    office.coordinator.order(DIAGNOSE)
    office.found("missing", TIE[:1])
    assert office.verbs == [DIAGNOSE, SUGGEST, DIAGNOSE, ADD_BEST]


def test_what_is_worked_out_alone_moves_nothing_and_runs_when_it_is_ordered():
    """A reader sees the predicted motion before anything moves."""
    office = Office(True, True, False)
    office.coordinator.missing = missing_summary("missing", TIE)
    assert office.coordinator.order(DESIGN).endswith("nothing moves")
    office.coordinator.limits_known(MotionLimits())
    office.answer(ladder=suggestion())
    assert office.experiments == []
    assert not office.coordinator.busy
    assert "will run the experiment that was worked out" in office.coordinator.order(SUGGEST)
    assert json.loads(office.experiments[0]) == {"adds_to": "command"}
    office.coordinator.handed_over("")
    assert office.verbs == [SUGGEST]
    # It has run: the next one is worked out anew, from the newest data.
    office.coordinator.order(SUGGEST)
    assert office.asked == 2


@pytest.mark.parametrize("later", ["diagnosis", "effects", "another model"])
def test_what_was_worked_out_for_another_question_is_not_run(later):
    office = Office(False, False, False)
    office.coordinator.missing = missing_summary("missing", TIE)
    office.coordinator.order(DESIGN)
    office.coordinator.limits_known(MotionLimits())
    office.answer(ladder=suggestion())
    if later == "diagnosis":
        office.coordinator.order(DIAGNOSE)
        office.found("missing", TIE)
    elif later == "effects":
        office.coordinator.set_effects(("slip@motor",))
        office.answer(ladder=LADDER)
    else:
        office.coordinator.forget()
    office.coordinator.missing = missing_summary("missing", TIE)
    office.coordinator.order(SUGGEST)
    assert (office.experiments, office.asked) == ([], 2)


@pytest.mark.parametrize("stage", ["limits", "suggestion"])
def test_a_design_that_fails_adds_nothing(stage):
    office = Office(True, True, False)
    office.coordinator.missing = missing_summary("missing", TIE)
    office.coordinator.order(DESIGN)
    if stage == "limits":
        office.coordinator.refused("nobody answers")
    else:
        office.coordinator.limits_known(MotionLimits())
        office.answer(error="no experiment", state=b"")
    assert ADD_BEST not in office.verbs


def test_an_experiment_that_settled_nothing_is_not_repeated():
    office = Office(True, True, True)
    office.coordinator.order(DIAGNOSE)
    office.found("missing", TIE)
    office.coordinator.limits_known(MotionLimits())
    office.answer(ladder=suggestion())
    office.coordinator.handed_over("")
    office.coordinator.order(DIAGNOSE)
    office.found("missing", TIE)
    assert office.verbs == [DIAGNOSE, SUGGEST, DIAGNOSE, ADD_BEST]


def test_experiments_come_to_an_end():
    office = Office(True, False, True)
    for number in range(MAXIMUM_EXPERIMENTS + 2):
        office.coordinator.order(DIAGNOSE)
        office.found("missing", (*TIE, f"effect{number}@motor"))
        if office.coordinator.waiting:
            office.coordinator.limits_known(MotionLimits())
            office.answer(ladder=suggestion())
            office.coordinator.handed_over("")
    assert office.verbs.count(SUGGEST) == MAXIMUM_EXPERIMENTS


@pytest.mark.parametrize("stage", ["limits", "suggestion", "handover"])
def test_without_the_excitation_the_best_is_added_all_the_same(stage):
    office = Office(True, True, True)
    office.coordinator.order(DIAGNOSE)
    office.found("missing", TIE)
    if stage == "limits":
        office.coordinator.refused("nobody answers")
    else:
        office.coordinator.limits_known(MotionLimits())
        if stage == "suggestion":
            office.answer(error="no experiment", state=b"")
        else:
            office.answer(ladder=suggestion())
            office.coordinator.refused("beyond the limits")
            assert office.coordinator.ladder.error == "beyond the limits"
    assert office.verbs[-1] == ADD_BEST
    assert office.log


def test_the_users_effects_overtake_what_is_under_way():
    office = Office(True, True, True)
    office.coordinator.order(DIAGNOSE)
    office.coordinator.set_effects(("dead_zone@input",))
    office.coordinator.set_effects(("slip@motor",))
    assert office.verbs == [DIAGNOSE]
    assert office.found("missing", TIE) is None
    assert office.orders[-1][0] == EFFECTS
    assert office.orders[-1][2] == {"effects": ("slip@motor",)}
    assert office.answer(ladder=LADDER).ladder is LADDER
    assert not office.coordinator.busy


def test_effects_set_while_the_excitation_is_asked():
    office = Office(True, True, True)
    office.coordinator.order(DIAGNOSE)
    office.found("missing", TIE)
    office.coordinator.set_effects(("slip@motor",))
    office.coordinator.limits_known(MotionLimits())
    assert office.verbs == [DIAGNOSE, EFFECTS]


def test_what_was_ordered_for_another_model_is_in_vain():
    office = Office(True, True, True)
    office.coordinator.order(DIAGNOSE)
    office.coordinator.forget()
    assert office.answer(DIAGNOSE, missing=missing_summary("missing", TIE)) is None
    assert office.coordinator.missing is None
    assert office.coordinator.state == b""
    assert not office.coordinator.busy


def test_an_order_that_failed_leaves_what_was_known():
    office = Office()
    office.coordinator.order(DIAGNOSE)
    office.found("missing", TIE)
    office.coordinator.order(ADD_BEST)
    taken = office.answer(error="the worker process ended", state=b"")
    assert taken.ladder.error == "the worker process ended"
    assert taken.ladder.steps == LADDER.steps
    assert office.coordinator.state == b"diagnose"
    assert office.coordinator.order(ADD_BEST)


def test_a_reference_stays_within_its_amplitude_and_the_position_range():
    assert MotionLimits(amplitude=2.0).position is None
    assert MotionLimits(amplitude=2.0, position_min=-9.0, position_max=9.0).position == (-9.0, 9.0)
    assert MotionLimits(amplitude=2.0, adds_to="reference").position == (-2.0, 2.0)
    assert MotionLimits(2.0, -1.0, 9.0, adds_to="reference").position == (-1.0, 2.0)


WHITE, GREY, COLOURED = {"p": 0.5, "v": 0.02}, {"p": 0.5, "v": 1e-3}, {"p": 0.5, "v": 1e-9}
FIT = {"p": 90.0}


def test_the_watch_calls_once():
    watch = WhitenessWatch()
    assert [watch.look(one, FIT) for one in (WHITE, COLOURED, WHITE, COLOURED, COLOURED, COLOURED)] == [
        *[False] * 4,
        True,
        False,
    ]
    assert not any(watch.look(COLOURED, FIT) for _ in range(5))
    assert not watch.look(GREY, FIT), "neither clearly bad nor good again"
    assert [watch.look(one, FIT) for one in (WHITE, COLOURED, COLOURED)] == [False, False, True]


def test_the_watch_calls_again_for_a_new_model_and_for_a_much_larger_error():
    watch = WhitenessWatch()
    watch.look(COLOURED, FIT)
    assert watch.look(COLOURED, FIT)
    watch.arm()
    assert [watch.look(COLOURED, FIT) for _ in range(3)] == [False, True, False]
    assert [watch.look(COLOURED, {"p": 70.0}) for _ in range(3)] == [False, True, False]


def test_the_watch_says_nothing_about_nothing():
    watch = WhitenessWatch()
    assert not any(watch.look({}, {}) for _ in range(5))
