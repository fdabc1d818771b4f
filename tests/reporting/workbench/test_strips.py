"""What a browser is sent: what it lacks, and never less than it needs."""

from __future__ import annotations

import json
import struct

import numpy as np
import pytest

from idloop.errors import InputError
from idloop.physics import load_model
from idloop.reporting.workbench.signals import Signals
from idloop.reporting.workbench.strips import Question, answer

MS = 1_000_000


@pytest.fixture
def signals():
    return Signals(load_model("dc_motor"), capacity=20_000)


def feed(signals, first, count, rng, predicted=True):
    """Samples at 1 kHz from number `first` on, the model a little behind."""
    stamps = 10**9 + MS * np.arange(first, first + count)
    rows = rng.standard_normal((count, 2))
    signals.extend("measured", stamps, rows)
    signals.extend("command", stamps, rng.standard_normal((count, 1)))
    if predicted:
        signals.extend("predicted", stamps[:-7], rows[:-7])
        signals.extend("residual", stamps[:-7], rows[:-7])


def read(data):
    """Head and points, as the browser reads them."""
    (length,) = struct.unpack_from("<I", data)
    head = json.loads(data[4 : 4 + length])
    offset, points = 4 + length, {}
    for one in head["streams"]:
        count, columns = one["count"], one["columns"]
        assert offset % 8 == 0
        time = np.frombuffer(data, "<f8", count, offset)
        values = np.frombuffer(data, "<f4", count * columns, offset + 8 * count).reshape(columns, count)
        offset += 8 * count + 4 * count * columns
        offset += -offset % 8
        points[one["name"]] = time, values
    assert offset == len(data)
    return head, points


class Browser:
    """Keeps what it was sent, by the rule that `answer` states."""

    def __init__(self):
        self.head = None
        self.points = {}

    def ask(self, signals, **given):
        have = (
            {}
            if self.head is None
            else {s["name"]: s["newest"] for s in self.head["streams"] if s["newest"] is not None}
        )
        epoch = "" if self.head is None else self.head["epoch"]
        data = answer(signals, Question(epoch=epoch, have=have, **given))
        head, points = read(data)
        newest = {} if self.head is None else {s["name"]: s["newest"] for s in self.head["streams"]}
        for one in head["streams"]:
            name = one["name"]
            time, values = points[name]
            if not head["whole"]:
                before = self.points[name]
                keep = before[0] < (time[0] if len(time) else np.inf)
                time = np.concatenate([before[0][keep], time])
                values = np.concatenate([before[1][:, keep], values], axis=1)
                one["newest"] = newest[name] if one["newest"] is None else one["newest"]
            self.points[name] = time, values
        self.head = head
        return len(data)


def drawn(time, values, after):
    """Every point once."""
    return np.unique(np.column_stack([time, values.T])[time > after], axis=0)


def test_what_comes_piece_by_piece_is_what_comes_at_once(signals):
    rng = np.random.default_rng(3)
    browser = Browser()
    first, sizes = 0, []
    for count in rng.integers(1, 400, 60):
        feed(signals, first, int(count), rng)
        first += int(count)
        sizes.append(browser.ask(signals, follow=4.0, buckets=200))
    assert not browser.head["whole"]
    head, points = read(answer(signals, Question(follow=4.0, buckets=200)))
    for name in points:
        # The buckets at the left end were whole when they were sent; a bucket of one sample is one point or two.
        theirs, ours = (drawn(*one[name], after=head["start"] + 0.05) for one in (points, browser.points))
        assert ours == pytest.approx(theirs), name
    whole = len(answer(signals, Question(follow=4.0, buckets=200)))
    assert np.median(sizes[-20:]) < 0.3 * whole


def test_a_stream_that_is_late_is_sent_when_it_comes(signals):
    rng = np.random.default_rng(4)
    browser = Browser()
    feed(signals, 0, 3000, rng, predicted=False)
    browser.ask(signals, follow=10.0)
    assert len(browser.points["model"][0]) == 0
    stamps = 10**9 + MS * np.arange(2500)
    signals.extend("predicted", stamps, np.ones((2500, 2)))
    browser.ask(signals, follow=10.0)
    assert not browser.head["whole"]
    assert browser.points["model"][0][0] == 0.0
    assert browser.points["model"][0][-1] == pytest.approx(2.499)


@pytest.mark.parametrize("change", ["stretch", "shown", "replaced", "run"])
def test_what_is_no_longer_true_is_sent_whole(signals, change):
    rng = np.random.default_rng(5)
    feed(signals, 0, 3000, rng)
    browser = Browser()
    browser.ask(signals, follow=2.0)
    browser.ask(signals, follow=2.0)
    assert not browser.head["whole"]
    if change == "replaced":
        signals.replace("predicted", [10**9], [[1.0, 2.0]])
    elif change == "run":
        feed(signals, -5000, 100, rng)
    browser.ask(
        signals, follow=3.0 if change == "stretch" else 2.0, shown="free_run" if change == "shown" else "one_step"
    )
    assert browser.head["whole"]


def test_a_stretch_is_shown_with_every_sample_where_there_is_room(signals):
    feed(signals, 0, 3000, np.random.default_rng(6))
    head, points = read(answer(signals, Question(stretch=(1.0, 1.2), buckets=400)))
    assert (head["start"], head["stop"]) == (1.0, 1.2)
    assert np.diff(points["measured"][0]) == pytest.approx(1e-3)
    assert len(points["measured"][0]) in range(200, 204)


def test_everything_that_is_kept_is_shown_where_nothing_is_said(signals):
    feed(signals, 0, 3000, np.random.default_rng(7))
    head, _ = read(answer(signals, Question()))
    assert (head["start"], head["stop"]) == pytest.approx((0.0, 2.999))
    assert head["band"] == pytest.approx([1.959964 * 0.0332, 1.959964 * 0.0728])


def test_before_anything_came_there_is_an_empty_picture(signals):
    head, points = read(answer(signals, Question(follow=10.0)))
    assert (head["start"], head["stop"]) == (-10.0, 0.0)
    assert all(len(time) == 0 for time, _ in points.values())


def test_a_query_is_read():
    assert Question.read({"follow": "5", "buckets": "9999999", "have": "model:1.5,command:2"}) == Question(
        5.0, None, 2000, have={"model": 1.5, "command": 2.0}
    )
    assert Question.read({"start": "1", "stop": "2"}).stretch == (1.0, 2.0)


@pytest.mark.parametrize(
    "given",
    [{"follow": "x"}, {"follow": "-1"}, {"follow": "nan"}, {"start": "2", "stop": "1"}, {"start": "1"},
     {"start": "0", "stop": "inf"}, {"shown": "other"}, {"have": "model"}, {"have": "model:nan"}, {"buckets": ""}],
)  # fmt: skip
def test_a_query_that_makes_no_sense_is_refused(given):
    with pytest.raises(InputError):
        Question.read(given)
