"""A claim decides whether a line holds, and says in words what was claimed."""

from __future__ import annotations

import math
import operator

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from papers.claim import (
    above,
    at_least,
    at_most,
    below,
    between,
    beyond,
    equals,
    near,
    stated,
    within,
    within_errors,
)

numbers = st.floats(-1e6, 1e6)
sizes = st.floats(1e-6, 1e6)


@pytest.mark.parametrize(
    ("make", "relation"),
    [(below, operator.lt), (at_most, operator.le), (above, operator.gt), (at_least, operator.ge)],
)
@given(limit=numbers, ours=numbers)
def test_a_limit_is_the_comparison_that_it_says(make, relation, limit: float, ours: float) -> None:
    assert make(limit).met(ours) is relation(ours, limit)
    assert make(limit).met(limit) is relation(limit, limit)


@given(low=numbers, high=numbers, ours=numbers)
def test_between_is_at_least_the_one_and_at_most_the_other(low: float, high: float, ours: float) -> None:
    assert between(low, high).met(ours) is (at_least(low).met(ours) and at_most(high).met(ours))


@given(centre=numbers, distance=sizes, ours=numbers)
def test_near_ends_at_its_distance_on_both_sides(centre: float, distance: float, ours: float) -> None:
    assert near(centre, distance).met(ours) is (abs(ours - centre) < distance)
    assert near(0.0, distance).met(ours) is not (beyond(distance).met(ours) or abs(ours) == distance)
    assert not near(0.0, distance).met(-distance)


@given(centre=numbers, share=st.floats(1e-3, 2.0), far=st.floats(0.0, 4.0), side=st.sampled_from([-1.0, 1.0]))
def test_a_share_is_of_the_size_of_the_number(centre: float, share: float, far: float, side: float) -> None:
    assume(abs(centre) > 1e-3)
    assume(abs(far - 1.0) > 1e-6)
    ours = centre + side * far * share * centre
    assert within(centre, share).met(ours) is (far < 1.0)
    assert within(-centre, share).met(-ours) is (far < 1.0)


@given(centre=numbers, stderr=sizes, off=st.floats(0.0, 10.0))
def test_standard_errors_are_counted(centre: float, stderr: float, off: float) -> None:
    assume(abs(off - 4.0) > 1e-3)
    assume(stderr > 1e-6 * abs(centre))
    assert within_errors(centre, 4.0, stderr).met(centre + off * stderr) is (off < 4.0)


@given(wanted=numbers, other=numbers)
def test_equal_is_exact(wanted: float, other: float) -> None:
    assert equals(wanted).met(wanted)
    assert equals(wanted).met(other) is (wanted == other)
    assert equals(wanted).met(math.nextafter(wanted, math.inf)) is False


@pytest.mark.parametrize(
    "claim",
    [
        below(1.0), at_most(1.0), above(1.0), at_least(1.0), between(0.0, 1.0), beyond(1.0), near(1.0, 1.0),
        within(1.0, 1.0), within_errors(1.0, 4.0, 1.0), equals(1.0), above(1.0).of(math.nan),
    ],
)  # fmt: skip
def test_no_number_bears_out_no_claim(claim) -> None:
    assert claim.met(math.nan) is False


@pytest.mark.parametrize(
    "claim",
    [below(math.nan), at_most(math.nan), above(math.nan), at_least(math.nan), between(0.0, math.nan), near(1, math.nan),
     within(math.nan, 1.0), within_errors(1.0, 4.0, math.nan), equals(math.nan)],
)  # fmt: skip
def test_a_bound_that_is_no_number_is_not_reached(claim) -> None:
    assert claim.met(1.0) is False


@pytest.mark.slow
@given(limit=numbers, value=numbers, printed=st.one_of(numbers, st.text(), st.none()))
def test_a_claim_of_a_number_inside_words_asks_for_that_number(limit: float, value: float, printed) -> None:
    inside = above(limit).of(value)
    assert inside.met(printed) is above(limit).met(value)
    assert inside.words("%") == above(limit).words("%")


@pytest.mark.parametrize("fulfilled", [True, False])
def test_words_are_decided_where_they_are_stated(fulfilled: bool) -> None:
    claim = stated("names all five effects and nothing else", fulfilled)
    assert claim.met("whatever") is claim.met(None) is fulfilled
    assert claim.words("%") == "names all five effects and nothing else"


@pytest.mark.parametrize("claim", [below(1.0), near(1.0, 1.0), within(1.0, 0.1)])
def test_a_number_is_never_claimed_of_words(claim) -> None:
    with pytest.raises(TypeError):
        claim.met("88.1 of 88.5")


@pytest.mark.parametrize(
    ("claim", "unit", "words"),
    [
        (below(5.0), "%", "< 5 %"),
        (at_most(2.1 * (1.0 + 1e-12)), "", "≤ 2.1"),
        (above(-0.5), "%", "> -0.5 %"),
        (at_least(99.595), "%", "≥ 99.595 %"),
        (between(0.00335, 0.0134), "rad²", "0.00335 to 0.0134 rad²"),
        (beyond(1.0), "rad/s²", "beyond ± 1 rad/s²"),
        (near(79.624, 6.0), "%", "79.624 ± 6 %"),
        (near(0.0, 1e-9), "rad/s", "± 1e-09 rad/s"),
        # A share has its own unit.
        (within(8.255, 1e-4), "rad/s²/V", "8.255 ± 0.01 %"),
        (within(-2.306, 0.1), "", "-2.306 ± 10 %"),
        (within_errors(2.306, 4.0, 0.0158), "1/s", "4 standard errors: ± 0.0632 1/s"),
        (equals(82000), "", "= 82000"),
        (equals("70/15/15"), "%", "= 70/15/15 %"),
    ],
)  # fmt: skip
def test_the_words_have_the_bound_and_the_unit(claim, unit: str, words: str) -> None:
    assert claim.words(unit) == words
