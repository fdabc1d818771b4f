"""Kind, unit and day told apart, and what the one rate of false discoveries leaves: counted on simulated fleets."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom, t

from idloop.fleet.joint_day import FORCE_ERROR
from idloop.fleet.statistics import (
    Finding,
    Hypotheses,
    Series,
    best_change,
    between_periods,
    finding_of,
    random_effect,
    series_of,
    take_apart,
)

UNITS, DAYS = 60, 20
ODD, WORN, STEPPED = range(3), range(3, 6), range(6, 9)


def fleet(
    seed: int,
    *,
    units: int = UNITS,
    planted: bool = False,
    step: float = 0.0,
    memory: float = 0.0,
    missing: float = 0.03,
) -> Series:
    """Units differ by 10 %, days by 3 %, and all units share 2 % from date to date."""
    rng = np.random.default_rng(seed)
    day = rng.normal(size=(units, DAYS))
    for k in range(1, DAYS):
        day[:, k] = memory * day[:, k - 1] + np.sqrt(1.0 - memory**2) * day[:, k]
    error = 0.01 * rng.uniform(0.5, 2.0, size=day.shape)
    y = 1.0 + 0.1 * rng.normal(size=(units, 1)) + 0.03 * day + error * rng.normal(size=day.shape)
    y += 0.02 * rng.normal(size=DAYS)
    if planted:
        y[ODD] += 0.7
        y[WORN] += 0.3 * np.arange(DAYS) / (DAYS - 1)
        y[STEPPED, DAYS // 2 :] += 0.2
    y[:, DAYS // 2 :] += step
    y[rng.uniform(size=y.shape) < missing] = np.nan
    names = tuple((f"r{k:02d}", "j") for k in range(units))
    return Series("kind", "p", "N", names, np.arange(DAYS) + 20000.0, y, error**2)


def found_in(parts):
    tests = Hypotheses()
    tests.test(parts)
    return tests.found()


def count(series):
    tests = Hypotheses()
    tests.test(take_apart(series))
    return tests.count


def unit(finding) -> int:
    return int(finding.robot[1:]) if finding.robot else -1


def test_the_parts_of_the_variance_are_those_of_the_simulation():
    several = [take_apart(fleet(seed)) for seed in range(20)]
    few = [take_apart(fleet(seed, units=5)) for seed in range(200)]
    assert np.sqrt(np.mean([one.unit_deviation**2 for one in few])) == pytest.approx(0.1, rel=0.1), "of few units, too"
    for name, true in (("mean", 1.0), ("unit_deviation", 0.1), ("day_deviation", 0.03)):
        values = np.array([getattr(one, name) for one in several])
        error = np.std(values, ddof=1) / np.sqrt(len(values))
        assert np.mean(values) == pytest.approx(true, abs=max(4.0 * error, 0.02 * true))
    dates = np.array([np.std(one.date) for one in several])
    assert np.mean(dates) == pytest.approx(0.02, rel=0.15)


@pytest.mark.parametrize(
    ("units", "memory", "fleets"), [(UNITS, 0.0, 60), (UNITS, 0.5, 60), (5, 0.0, 200), (5, 0.5, 400)]
)
def test_a_healthy_fleet_has_findings_as_seldom_as_stated(units, memory, fleets):
    several = (fleet(seed, units=units, memory=memory) for seed in range(fleets))
    with_findings = sum(bool(found_in(take_apart(one))) for one in several)
    # Without anything to find, a rate of false discoveries of 5 % is that of fleets with any finding.
    assert with_findings <= binom.ppf(0.999, fleets, 0.05)


def test_what_is_planted_is_found_and_little_else():
    false = every = odd = changed = fleets = 0
    for seed in range(20):
        fleets += 1
        for one in found_in(take_apart(fleet(100 + seed, planted=True))):
            every += 1
            false += unit(one) not in range(9)
            odd += one.what == "odd" and unit(one) in ODD
            changed += one.what in {"trend", "step"} and unit(one) in (*WORN, *STEPPED)
    assert odd >= 0.9 * fleets * len(ODD)
    assert changed >= 0.95 * fleets * (len(WORN) + len(STEPPED))
    assert false <= binom.ppf(0.999, every, 0.05)


def test_a_change_is_named_with_its_date_and_size():
    parts = take_apart(fleet(1, planted=True))
    several = {unit(one): one for one in found_in(parts) if one.what in {"trend", "step"}}
    for k in WORN:
        assert (several[k].what, several[k].size) == ("trend", pytest.approx(0.3, abs=0.08))
    for k in STEPPED:
        assert (several[k].what, several[k].day) == ("step", pytest.approx(20000 + DAYS // 2, abs=1.0))
        assert several[k].low < 0.2 < several[k].high


def test_an_odd_joint_has_the_date_from_which_on_it_is_odd():
    series = fleet(8, missing=0.0)
    series.value[0] += 0.8
    series.value[1, 5:] += 0.8
    several = {unit(one): one.day for one in found_in(take_apart(series)) if one.what == "odd"}
    assert several == {0: 20000.0, 1: 20005.0}


def test_the_interval_of_an_odd_joint_has_the_error_of_the_mean_of_its_kind():
    """Of eight joints, the mean is known worse than the level of any one."""
    held, found, deviation = 0, 0, 3.0
    for seed in range(60):
        series = fleet(700 + seed, units=8, missing=0.0)
        series.value[0] += 1.0 + deviation - np.mean(series.value[0])
        several = [one for one in found_in(take_apart(series)) if one.what == "odd" and unit(one) == 0]
        found += len(several)
        held += sum(one.low < deviation < one.high for one in several)
    assert found >= 50
    assert held >= binom.ppf(0.001, found, 0.95)


def test_an_interval_is_of_the_distribution_of_its_p_value():
    """Of a change that one joint alone has, with few recordings: then Student's t is far from the normal one."""
    series = fleet(9, units=1, missing=0.0)
    few = {"days": series.days[:6], "value": series.value[:, :6], "variance": series.variance[:, :6]}
    parts = take_apart(replace(series, **few))
    _, (one,) = between_periods(parts, 20003.0, None)
    assert parts.freedom < 5.0
    reach = t.ppf(1.0 - 0.5 * one.p_value, parts.freedom) / t.ppf(0.975, parts.freedom)
    assert abs(one.size) == pytest.approx(reach * 0.5 * (one.high - one.low))
    change = best_change(parts.series.days, parts.left[0], parts.total[0], parts.freedom)
    found = finding_of(parts.series, "step", 0.0, change.size, change.stderr, change.freedom, ("r", "j"), 1.0)
    assert found.high - found.size == pytest.approx(t.ppf(0.975, parts.freedom) * change.stderr)


def test_a_change_of_all_is_that_of_the_kind_and_of_no_unit():
    several = found_in(take_apart(fleet(2, step=0.2)))
    assert [(one.what, one.robot, one.day) for one in several if one.what != "day"] == [("step", "", 20000 + DAYS // 2)]


@pytest.mark.parametrize(("units", "several"), [(5, 2), (8, 3), (12, 5)])
def test_what_a_part_of_the_joints_does_at_once_is_a_change_of_no_other(units, several):
    """Else the effects of the dates, which all joints share, have a part of it."""
    fleets, named, false = 40, 0, 0
    for seed in range(fleets):
        series = fleet(400 + seed, units=units, missing=0.0)
        series.value[:several, DAYS // 2 :] += 0.3
        changed = {unit(one) for one in found_in(take_apart(series)) if one.what in {"trend", "step"}}
        named += len(changed & {*range(several)})
        false += len(changed - {*range(several)})
    assert named >= 0.97 * fleets * several
    assert false <= binom.ppf(0.999, named + false, 0.05)


@pytest.mark.parametrize(("units", "alone"), [(1, False), (3, False), (3, True), (5, True)])
def test_a_change_of_one_joint_is_found_also_where_few_or_no_others_have_recordings(units, alone):
    fleets = 20
    named = of_kind = of_joint = 0
    for seed in range(fleets):
        series = fleet(400 + seed, units=units, missing=0.0)
        series.value[0, DAYS // 2 :] += 0.4
        series.value[1:, DAYS // 2 :] = np.nan if alone else series.value[1:, DAYS // 2 :]
        several = found_in(take_apart(series))
        named += ("r00", "step", 20000.0 + DAYS // 2) in {(one.robot, one.what, one.day) for one in several}
        kind, joints = between_periods(take_apart(series), 20000.0 + DAYS // 2, None)
        of_kind += len(kind)
        of_joint += (joints[0].robot, joints[0].low < 0.4 < joints[0].high) == ("r00", True)
    assert named >= 0.95 * fleets
    assert of_kind == (0 if alone or units == 1 else fleets), "what one joint does is told of that joint"
    assert units == 5 or of_joint >= binom.ppf(0.001, fleets, 0.9)


@pytest.mark.parametrize(("units", "after"), [(1, 8), (5, 5)])
def test_a_change_is_found_from_so_many_recordings_after_it_on(units, after):
    fleets, named = 40, 0
    for seed in range(fleets):
        series = fleet(800 + seed, units=units, missing=0.0)
        series.value[0, DAYS - after :] += 0.3
        several = found_in(take_apart(series))
        named += any(unit(one) == 0 and one.what in {"trend", "step"} for one in several)
    assert named >= binom.ppf(0.001, fleets, 0.97)


def test_a_date_that_few_joints_share_may_do_what_other_dates_do():
    series = fleet(6, missing=0.0)
    series.value[1:, DAYS // 2 :] = np.nan
    dates = 0.3 * np.random.default_rng(6).normal(size=DAYS)
    parts = take_apart(replace(series, value=series.value + dates))
    assert np.median(parts.total[0, DAYS // 2 :]) > 0.5 * np.var(dates[: DAYS // 2])
    assert np.median(parts.total[0, : DAYS // 2]) < 0.1 * np.var(dates)


def test_a_single_recording_off_its_course_is_named():
    fleets, every = 20, []
    for seed in range(fleets):
        series = fleet(3 + seed, missing=0.0)
        series.value[7, 12] += 0.4
        every += [(one.what, one.robot, one.day) for one in found_in(take_apart(series))]
    false = len(every) - every.count(("day", "r07", 20012.0))
    assert len(every) - false >= binom.ppf(0.001, fleets, 0.95)
    assert false <= binom.ppf(0.999, len(every), 0.05)


def test_a_shrunken_level_is_nearer_to_its_kind_the_less_is_known():
    series = fleet(4, missing=0.0)
    series.value[0, 1:] = np.nan
    parts = take_apart(series)
    kept = (parts.shrunk - parts.mean) / (parts.level - parts.mean)
    assert 0.5 < kept[0] < kept[1] < 1.0


def test_an_odd_unit_keeps_its_level_but_for_its_error():
    series = fleet(4, missing=0.0)
    series.value[1:] -= np.mean(series.value[1:], axis=1, keepdims=True)  # the others are alike
    parts = take_apart(series)
    assert parts.unit_deviation < 0.01
    assert abs(parts.shrunk[0] - parts.level[0]) <= parts.level_stderr[0] * (1.0 + 1e-9)


def test_periods_are_compared_unit_by_unit():
    held, fleets = 0, 40
    for seed in range(fleets):
        (kind,), _ = between_periods(take_apart(fleet(200 + seed, step=0.1)), 20000.0 + DAYS // 2, None)
        assert kind.p_value < 1e-3
        held += kind.low < 0.1 < kind.high
    assert held >= binom.ppf(0.001, fleets, 0.95)
    series = fleet(5)
    series.value[9, DAYS // 2 :] += 0.3
    _, units = between_periods(take_apart(series), 20000.0 + DAYS // 2, 20000.0)
    (one,) = [one for one in units if one.p_value < 1e-4]
    assert (one.robot, one.what) == ("r09", "beyond")
    assert one.low < 0.3 < one.high
    assert between_periods(take_apart(series), 30000.0, None) == ([], [])


def test_joints_that_a_change_reaches_more_or_less_do_as_their_kind():
    fleets, with_findings = 40, 0
    for seed in range(fleets):
        series = fleet(600 + seed, missing=0.0)
        series.value[:, DAYS // 2 :] += 0.2 + 0.05 * np.random.default_rng(seed).normal(size=(UNITS, 1))
        tests = Hypotheses()
        _, units = between_periods(take_apart(series), 20000.0 + DAYS // 2, None)
        tests.add(np.array([one.p_value for one in units]), units.__getitem__)
        with_findings += bool(tests.found())
    assert with_findings <= binom.ppf(0.999, fleets, 0.05)


def test_a_small_fleet_has_no_tests_that_it_cannot_bear():
    one = Series("k", "p", "N", (("r", "j"),), np.arange(3.0), np.array([[1.0, 1.1, 0.9]]), np.full((1, 3), 0.01))
    assert count(one) == 3, "single recordings only"
    empty = Series("k", "p", "N", (("r", "j"),), np.arange(1.0), np.array([[1.0]]), np.array([[0.01]]))
    assert count(empty) == 0


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e6])
@pytest.mark.parametrize("effect", [0.0, 3.0])
def test_a_random_effect_is_what_the_errors_leave(effect, scale):
    rng = np.random.default_rng(0)
    error = rng.uniform(0.5, 2.0, size=20000)
    found = random_effect(scale * np.hypot(error, effect) * rng.normal(size=error.size), (scale * error) ** 2)
    assert found.variance / scale**2 == pytest.approx(effect**2, rel=0.05, abs=0.05)
    assert abs(found.mean) < 4.0 * found.stderr


@pytest.mark.parametrize("own", [0.0, 0.01])
def test_odd_units_neither_move_the_mean_nor_hide_themselves(own):
    rng = np.random.default_rng(1)
    y = np.append(rng.normal(size=50), [8.0, 9.0, 10.0, 30.0])
    plain, found = (random_effect(one, np.full(len(one), own)) for one in (y[:50], y))
    assert found[:4] == pytest.approx(plain[:4], rel=1e-6)
    assert np.flatnonzero(~found.kept).tolist() == [50, 51, 52, 53]


@pytest.mark.parametrize("size", [0, 1, 2, 5])
def test_a_random_effect_of_equal_or_few_estimates_is_a_number(size):
    same = random_effect(np.full(size, 2.0), np.zeros(size))
    assert (same.variance, np.nan_to_num(same.stderr)) == (0.0, 0.0)
    assert random_effect(np.arange(float(size)), np.full(size, 0.01)).variance >= 0.0


def test_a_step_is_no_trend():
    y = np.where(np.arange(12) < 5, 0.0, 1.0)
    change = best_change(np.arange(12.0), y, np.full(12, 0.01), 100.0)
    assert (change.what, change.day, change.size) == ("step", 5.0, pytest.approx(1.0))


def test_estimates_become_series():
    joints, days = [("b", "j"), ("a", "j"), ("a", "j")], np.array([11.2, 10.1, 10.9])
    value, stderr = np.array([3.0, 2.0, 4.0]), np.array([np.nan, 0.5, 0.1])
    found = series_of("k", "p", "N", joints, days, value, stderr)
    assert found.names == (("a", "j"), ("b", "j"))
    np.testing.assert_array_equal(found.value, [[4.0, np.nan], [np.nan, np.nan]])
    np.testing.assert_allclose(found.variance, [[0.01, np.nan], [np.nan, np.nan]])
    error = series_of("k", FORCE_ERROR, "1", joints, days, value, np.full(3, np.nan))
    np.testing.assert_allclose(error.value, np.log([[4.0, np.nan], [np.nan, 3.0]]))


def test_what_a_date_does_may_grow_with_the_level_of_a_joint():
    """As a gain does: it is a change of the kind, and of no joint that is far from its kind."""
    fleets, with_findings = 40, 0
    for seed in range(fleets):
        rng = np.random.default_rng(seed)
        series = fleet(seed, missing=0.0)
        value = 1.0 + 0.1 * rng.normal(size=(UNITS, 1)) + 0.003 * rng.normal(size=series.value.shape)
        value[:, DAYS // 2 :] *= 1.05
        parts = take_apart(replace(series, value=value, variance=np.full(value.shape, 0.003**2)))
        several = {(one.robot, one.what) for one in found_in(parts)}
        assert ("", "step") in several
        with_findings += len(several) > 1
    assert with_findings <= binom.ppf(0.999, fleets, 0.05)


def test_heavy_tails_of_single_recordings_are_no_change_since_a_date():
    every, fleets = 0, 40
    for seed in range(fleets):
        series = fleet(300 + seed, missing=0.0)
        series.value[:] += 0.1 * np.random.default_rng(seed).standard_t(3.0, size=series.value.shape)
        _, units = between_periods(take_apart(series), 20000.0 + DAYS // 2, None)
        every += sum(one.p_value < 1e-3 for one in units)
    assert every <= binom.ppf(0.999, fleets * UNITS, 1e-3)


def test_every_question_has_the_same_part_of_the_rate():
    """However many single recordings there are beside them, few units have the threshold of a third of the tests."""
    tests = Hypotheses(0.05)
    units, days = np.array([0.002, *[0.5] * 9]), np.full(9_990, 0.5)
    for p_values, question in ((units, "odd"), (days, "day")):
        tests.add(p_values, lambda place, p=p_values: replace(finding(1), p_value=p[place]), question)
    assert [one.q_value for one in tests.found()] == [pytest.approx(0.002 * 2 * 10)]
    tests = Hypotheses(0.05)
    tests.add(np.concatenate([units, days]), lambda _: finding(1))
    assert tests.found() == [], "one question"


def test_a_finding_is_made_only_where_it_may_be_left():
    tests, made = Hypotheses(0.05), []
    tests.add(np.array([0.5, 0.001, 0.04, 0.9]), lambda place: made.append(place) or finding(place))
    assert made == [1, 2]
    assert [(one.robot, round(one.q_value, 6)) for one in tests.found()] == [("1", 0.004)]
    assert tests.count == 4
    assert Hypotheses().found() == []


def finding(place):
    return Finding("day", "k", "p", "N", str(place), "j", 0.0, 1.0, 0.5, 1.5, [0.5, 0.001, 0.04, 0.9][place])


def test_heavy_tails_of_single_recordings_are_no_findings():
    fleets, with_findings = 20, 0
    for seed in range(fleets):
        series = fleet(300 + seed, missing=0.0)
        series.value[:] += 0.03 * np.random.default_rng(seed).standard_t(4.0, size=series.value.shape)
        with_findings += bool(found_in(take_apart(series)))
    assert with_findings <= binom.ppf(0.999, fleets, 0.05)
