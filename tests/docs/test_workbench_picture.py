"""The picture's clicks, on a page that only pretends: what a step changes is waited for, and nothing else."""

from __future__ import annotations

import pytest
from workbench_picture import climb

from idloop.errors import IdloopError


class Page:
    """Answers what `climb` asks; `found` are the answers of one search after the other, `steps` the ladders."""

    def __init__(self, found, steps, refused=""):
        self.found, self.steps, self.refused = list(found), list(steps), refused
        self.looks, self.ladder, self.missing, self.note, self.clicks = 0, "start", False, "", []

    def is_visible(self, selector):
        return self.missing

    def evaluate(self, expression):
        return self.note if "#note" in expression else self.ladder if "#steps" in expression else self.looks

    def click(self, selector):
        self.clicks.append(selector)
        if self.refused:
            self.note = self.refused
        elif selector == "#diagnose":
            self.looks, self.missing = self.looks + 1, self.found.pop(0)
        else:
            assert self.missing, "there is nothing to click"
            self.ladder, self.missing = self.steps.pop(0), False

    def wait_for_function(self, expression, arg):
        shown = self.ladder if "#steps" in expression else self.looks
        if shown == arg and not self.note:
            raise TimeoutError(expression)

    def wait_for_selector(self, selector, state="visible"):
        # As many steps as the ladder has words for; everything is over at once.
        if selector.startswith("[data-step=") and selector not in [f"[data-step='{i}']" for i in self.numbers()]:
            raise TimeoutError(selector)

    def numbers(self):
        return range(len(self.ladder.split("+")))


def test_an_effect_that_takes_the_place_of_another_makes_the_ladder_no_longer():
    page = Page([True, True, False], ["start + friction", "start + friction that depends on the load"])
    climb(page, 2)
    assert page.ladder.endswith("the load")
    assert len(page.clicks) == 5


def test_it_ends_where_nothing_is_missing():
    page = Page([True, False], ["start + friction"])
    climb(page, 3)
    assert page.clicks.count("#diagnose") == 2
    assert page.ladder == "start + friction"


def test_what_the_workbench_refuses_is_said():
    with pytest.raises(IdloopError, match="the record is too short"):
        climb(Page([], [], refused="the record is too short"), 1)
