"""Rows of the lead-screw stage, and the paper's numbers."""

from __future__ import annotations

import numpy as np
import pytest

from papers.stage import stage_comparison, stage_linear, stage_machine, stage_neural, stage_paper, stage_wavelet
from papers.stage.stage_candidates import Bench, Candidate, bench, limit, scores

SECONDS = 30.0


def named(found, text: str):
    """The one line whose quantity begins so."""
    (line,) = [line for line in found.rows() if line.quantity.startswith(text)]
    return line


# -- the paper's numbers --------------------------------------------------------------------


def test_fit_and_mse_of_table_2_tell_the_spread_of_the_speed_and_the_linear_mse_is_ten_times_too_large() -> None:
    networks = stage_paper.WAVELET.spread, stage_paper.NEURAL.spread
    assert networks == (pytest.approx(0.3645, abs=1e-3), pytest.approx(0.3977, abs=1e-3))
    assert stage_paper.LINEAR.spread > 2.5 * max(networks)
    tenth = stage_paper.Published(stage_paper.LINEAR.fit, stage_paper.LINEAR.mse / 10.0)
    assert tenth.spread == pytest.approx(np.mean(networks), rel=0.1)


# -- the rig --------------------------------------------------------------------------------


def test_the_encoder_counts_whole_pulses_and_the_speed_is_their_number() -> None:
    record = stage_paper.measure(stage_paper.AMPLITUDE, 0, SECONDS)
    data = stage_paper.speed(record)
    counts = record.output[:, 0] * stage_paper.PULSES / (2.0 * np.pi)
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-9)
    step = 2.0 * np.pi / stage_paper.PULSES * stage_paper.LEAD / stage_paper.INCH / stage_paper.SAMPLE_TIME
    np.testing.assert_allclose(data.output / step, np.round(data.output / step), atol=1e-9)
    # The sum of all speeds is the way.
    way = np.sum(data.output) * stage_paper.SAMPLE_TIME * stage_paper.INCH / stage_paper.LEAD
    assert way == pytest.approx(record.output[round(data.time[-1] / stage_paper.LOGGER_STEP), 0], abs=1e-9)


def test_the_command_of_a_sample_is_the_one_that_begins_there() -> None:
    record = stage_paper.measure(stage_paper.AMPLITUDE, 0, SECONDS)
    data = stage_paper.speed(record)
    np.testing.assert_array_equal(data.input[:-1, 0], record.input[1:])
    assert data.time[0] == pytest.approx(stage_paper.SAMPLE_TIME)


def test_other_seeds_are_other_stretches_of_the_sequence_and_equal_ones_the_same() -> None:
    first, again, other = (stage_paper.measure(stage_paper.AMPLITUDE, n, SECONDS) for n in (0, 0, 1))
    np.testing.assert_array_equal(first.output, again.output)
    assert abs(np.corrcoef(first.input, other.input)[0, 1]) < 0.25


def test_the_machine_itself_misses_only_what_the_counts_add() -> None:
    data = bench(0, SECONDS)
    found = scores(limit(data), data)
    step = stage_paper.COUNT * stage_paper.LEAD / stage_paper.INCH / stage_paper.SAMPLE_TIME
    # Two roundings, each of variance 1/12.
    assert found.free_mse == pytest.approx(step**2 / 6.0, rel=0.15)


# -- the rows -------------------------------------------------------------------------------


def test_c1(complete, silent) -> None:
    found = stage_machine.reproduce(0, silent)
    complete(found)
    assert found.model.effect_names == (
        "coulomb_friction@stage", "backlash@screw-nut", "sensor_quantisation@position[screw]",
    )  # fmt: skip
    # The encoder sits on the screw; the paper's order of bodies.
    assert list(found.model.bodies) == ["rotor", "screw", "nut", "stage"]


def test_the_equations_see_a_wrong_inertia() -> None:
    plain, frequency = stage_paper.plain(), np.array([0.5, 2.0, 8.0])
    right = stage_machine.chain_response(plain, frequency)
    heavy = plain.with_values({"stage.inertia": 5e-5})
    assert np.max(np.abs(stage_machine.four_inertia_response(plain, frequency) / right - 1.0)) < 0.01
    assert np.max(np.abs(stage_machine.four_inertia_response(heavy, frequency) / right - 1.0)) > 0.1


@pytest.mark.slow
@pytest.mark.parametrize("row", [stage_linear, stage_wavelet, stage_neural])
def test_c2_to_c4(row, complete, silent) -> None:
    complete(row.reproduce(0, silent))


def test_no_order_makes_the_linear_model_sufficient() -> None:
    found = stage_linear.reproduce(1, lambda share, text: None)
    assert named(found, "transfer function: FIT, free run").ours == pytest.approx(stage_paper.LINEAR.fit, abs=6.0)
    assert named(found, "transfer function of order 6").ours < stage_paper.WAVELET.fit - 5.0


def test_scores_know_a_perfect_and_a_silent_model() -> None:
    data: Bench = bench(0, SECONDS)
    measured = tuple(each.output[:, 0] for each in (data.train, data.validation, data.half))
    perfect = scores(Candidate("perfect", None, measured), data)
    assert (perfect.free, perfect.half, perfect.free_mse, perfect.train) == (100.0, 100.0, 0.0, 100.0)
    mean = tuple(np.full(run.shape, run.mean()) for run in measured)
    assert scores(Candidate("mean", None, mean), data).free == pytest.approx(0.0, abs=1e-9)


# -- the comparison -------------------------------------------------------------------------


@pytest.fixture(scope="module")
def comparison() -> stage_comparison.StageComparison:
    """With a diagnosis that knows few effects: the whole catalogue takes a minute."""
    from idloop.diagnosis import refine

    def quick(record, progress):
        start = stage_paper.screw_and_stage()
        known = ["coulomb_friction", "presliding_friction", "stribeck_friction", "backlash", "sensor_quantisation"]
        return refine(start, [record.cut(0.0, stage_comparison.READ)], effects=known, progress=progress)

    return stage_comparison.reproduce(0, lambda share, text: None, repeats=0, find=quick)


@pytest.mark.slow
def test_c5(comparison, complete) -> None:
    complete(comparison)
    assert set(comparison.ladder.added) == {
        "coulomb_friction@stage", "backlash@screw-stage", "sensor_quantisation@position[screw]",
    }  # fmt: skip
    # The plain model is no better than the linear one, the effect makes the difference at both amplitudes.
    plain = scores(stage_comparison.grey_box(comparison.ladder.steps[0].model, comparison.data), comparison.data)
    found = comparison.found(stage_comparison.GREY)
    assert plain.free < comparison.found(stage_comparison.LINEAR).free + 3.0
    assert found.free > plain.free + 10.0
    assert found.half > plain.half + 40.0


@pytest.mark.slow
def test_c5_does_not_hold_where_the_network_is_better(comparison) -> None:
    from dataclasses import replace

    # Forged: what the wavelet network said is what was measured.
    linear, wavelet, *rest = comparison.candidates
    data = comparison.data
    perfect = replace(wavelet, free=tuple(each.output[:, 0] for each in (data.train, data.validation, data.half)))
    forged = replace(comparison, candidates=(linear, perfect, *rest))
    missed = {line.quantity for line in forged.rows() if line.holds is False}
    assert any(text.startswith("order of methods") for text in missed)
    assert any(text.startswith("grey-box: FIT, free run") for text in missed)
    assert any(text.startswith("networks: best FIT at half") for text in missed)


@pytest.mark.slow
def test_the_order_of_methods_is_counted_over_stretches(comparison) -> None:
    from dataclasses import replace

    def stretch(wavelet: float, neural: float, half: float) -> stage_comparison.Stretch:
        return stage_comparison.Stretch((80.0, wavelet, neural, 96.0), (20.0, half, -500.0, 87.0))

    right, wrong = stretch(94.0, 95.0, 40.0), stretch(95.0, 94.0, 80.0)
    mostly = replace(comparison, stretches=(right, wrong, right))
    for text in ("the order holds", "networks fail at half"):
        assert (named(mostly, text).ours, named(mostly, text).holds) == (2.0, True)
        assert named(replace(comparison, stretches=(right, wrong, wrong)), text).holds is False
        # Nothing was counted, nothing is claimed.
        assert named(comparison, text).holds is None
    assert len(mostly.tables()) == len(comparison.tables()) + 1


def test_a_network_fails_below_twice_what_the_counts_leave() -> None:
    assert stage_comparison.failing(90.0) == pytest.approx(80.0)
    for half, fail in ((79.0, True), (81.0, False)):
        stretch = stage_comparison.Stretch((0.0, 0.0, 0.0, 90.0), (0.0, 50.0, half, 90.0))
        assert stretch.networks_fail is fail


def test_the_start_of_screw_and_stage_weighs_what_the_chain_weighs() -> None:
    frequency = np.array([0.2, 1.0, 5.0])
    chain = stage_machine.chain_response(stage_paper.plain(), frequency)
    start = stage_machine.chain_response(stage_paper.screw_and_stage(), frequency)
    assert np.max(np.abs(start / chain - 1.0)) < 0.02
