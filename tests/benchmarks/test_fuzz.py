"""A short form of the fuzzing campaign, and what it holds against a reader."""

from __future__ import annotations

import pickle
import random

import pytest
from damage import LONGEST, TOO_MUCH, VERY_LONG, damaged
from readers import Reader, readers
from trial import Trial

from idloop.errors import InputError

READERS = readers()
INPUTS = 15


@pytest.mark.parametrize("reader", READERS, ids=lambda reader: reader.name)
@pytest.mark.filterwarnings("ignore")
def test_no_damage_breaks_a_reader(reader, tmp_path):
    trial, chance, seeds = Trial(reader, tmp_path, tmp_path / "findings"), random.Random(1), reader.seeds()
    for data in seeds:
        trial(data)
    # Some are refused, such as a file with a pickle in it; never all of them.
    assert trial.refused < trial.inputs
    for pool in (seeds, reader.bombs()):
        for _ in range(INPUTS if pool is seeds else len(pool)):
            trial(damaged(chance.choice(pool), reader.words, seeds, chance))
    assert not trial.findings


def broken(path, target):
    raise KeyError("name")


def speechless(path, target):
    raise InputError("")


def greedy(path, target):
    b"x" * (1 << 29)


def stubborn(path, target):
    try:
        wandering(path, target)
    except Exception:  # noqa: BLE001 (a reader that turns whatever happens into a line)
        raise InputError("an excuse") from None


def wandering(path, target):
    (target.parent.parent.parent / "elsewhere").write_text("x")


def trusting(path, target):
    return pickle.loads(pickle.dumps(InputError))


@pytest.mark.parametrize("read", [broken, speechless, wandering, trusting, stubborn, greedy])
def test_what_no_reader_may_do_is_found_and_its_input_kept(read, tmp_path, monkeypatch):
    monkeypatch.setattr("trial._ROOM", 1 << 27)
    folder = tmp_path / "work"
    folder.mkdir()
    trial = Trial(Reader("one", ".bin", read, list, ()), folder, tmp_path / "findings")
    trial(b"abc")
    trial(b"abcd")
    assert len(trial.findings) == 1
    assert [file.read_bytes() for file in (tmp_path / "findings").iterdir()] == [b"abc"]
    assert not (tmp_path / "elsewhere").exists()


def test_damage_is_the_same_for_a_seed_and_bounded():
    seeds = [b"{a: 1}", bytes(LONGEST)]
    first, again = ([damaged(seeds[1], ("word",), seeds, random.Random(k)) for k in range(50)] for _ in range(2))
    assert first == again
    assert len(set(first)) > 25
    assert max(map(len, first)) <= VERY_LONG


@pytest.mark.parametrize("kind", range(len(TOO_MUCH)))
def test_too_much_is_made_of_every_kind(kind):
    made = {TOO_MUCH[kind](random.Random(k)) for k in range(200)}
    assert len(made) > 10
    assert max(map(len, made)) < 10 * VERY_LONG
