"""What one search found of the noise, the models beside it may use: no gain is the noise model's."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from idloop.diagnose import diagnose
from idloop.diagnose.confirm import Confirmed
from idloop.diagnose.footing import same_footing
from idloop.diagnose.proposals import proposals
from idloop.diagnose.refit import Refit, refit, transfer
from idloop.diagnose.setting import Setting, prepare_setting
from idloop.estimate.innovations import WALK
from idloop.physics import Model, load_model
from idloop.physics.simulation import simulate

from .conftest import record_of


@pytest.fixture(scope="module")
def footing(start: Model) -> tuple[Setting, Refit]:
    """A machine with dry friction under a disturbance, and the plain model with its noise at its best."""
    machine = load_model("axis").with_effects(["coulomb_friction@axis(level=0.05)"])
    setting = prepare_setting(start, [record_of(machine, 4, seconds=5.0, disturbance=0.03)], "prediction")
    return setting, refit(setting, start)


def with_poor_noise(setting: Setting, fit: Refit) -> Refit:
    """The same model with a disturbance that is far too weak and never forgotten."""
    poor = transfer(setting, replace(fit, point=np.array([*fit.point[: fit.parameters], -4.0, WALK])))
    assert poor is not None
    return poor


def confirmed_with(name: str, setting: Setting, parent: Refit, beside: Refit, statistic: float) -> Confirmed:
    """An effect refitted beside one model, its gain counted from another."""
    (proposal,) = proposals(beside.model, [name])
    fit = refit(setting, proposal.model({spec.name: 0.01 for spec in proposal.effect.parameters}), None, beside)
    return Confirmed(proposal, fit, 0.0, statistic).refitted(fit, parent)


def test_a_gain_that_is_the_noise_models_goes_to_the_parent(footing: tuple[Setting, Refit]) -> None:
    setting, good = footing
    poor = with_poor_noise(setting, good)
    idle = confirmed_with("quadratic_drag", setting, poor, good, statistic=1.0)
    real = confirmed_with("coulomb_friction", setting, poor, good, statistic=1.0)
    worth = real.fit.log_likelihood - good.log_likelihood
    assert worth > 20.0
    assert idle.gain > 100.0
    parent, (after_idle, after_real) = same_footing(setting, poor, [idle, real], threshold=20.0)
    assert parent.log_likelihood == pytest.approx(good.log_likelihood, abs=1.0)
    assert parent.model.effect_names == ()
    assert after_idle.gain < 2.0
    assert after_real.gain == pytest.approx(worth, abs=1.0)


def test_the_parent_gets_its_noise_from_what_would_take_the_place_of_its_effect_as_well(
    footing: tuple[Setting, Refit],
) -> None:
    setting, bare = footing
    plain = refit(setting, bare.model.with_effects(["coulomb_friction@axis(level=0.04)"]), None, bare)
    (proposal,) = proposals(plain.model, ["stribeck_friction"])
    assert proposal.replaces == "coulomb_friction@axis"
    richer = refit(setting, proposal.model({"coulomb": 0.05, "static": 0.05, "velocity": 0.1}), None, plain)
    poor = with_poor_noise(setting, plain)
    idle = Confirmed(proposal, richer, 0.0, 1.0).refitted(richer, poor)
    assert idle.gain > 100.0
    parent, (after,) = same_footing(setting, poor, [idle], threshold=20.0)
    assert parent.log_likelihood == pytest.approx(plain.log_likelihood, abs=1.0)
    assert after.gain < 8.0


def test_a_gain_that_is_beyond_doubt_or_short_of_the_threshold_is_left_alone(footing: tuple[Setting, Refit]) -> None:
    setting, good = footing
    poor = with_poor_noise(setting, good)
    # As much as the score test promised, and less than could matter.
    found = [confirmed_with("coulomb_friction", setting, poor, good, statistic=1e6)]
    for threshold in (20.0, 2.0 * found[0].gain + 1.0):
        parent, after = same_footing(setting, poor, found, threshold)
        assert parent is poor
        assert after == found
    # Near the threshold the score test's word is not enough.
    parent, _ = same_footing(setting, poor, found, 2.0 * found[0].gain - 1.0)
    assert parent.log_likelihood > poor.log_likelihood + 100.0


@pytest.mark.parametrize("statistic", [1e6, 1.0])
def test_what_the_score_test_promised_is_refitted_with_the_noise_of_a_lifted_parent(
    statistic: float, footing: tuple[Setting, Refit]
) -> None:
    setting, good = footing
    poor = with_poor_noise(setting, good)
    lifting = confirmed_with("quadratic_drag", setting, poor, good, statistic=1.0)
    real = confirmed_with("coulomb_friction", setting, poor, good, statistic)
    stuck = real.refitted(with_poor_noise(setting, real.fit), poor)
    _, (_, after) = same_footing(setting, poor, [lifting, stuck], threshold=20.0)
    if statistic > 20.0:
        assert after.gain == pytest.approx(real.fit.log_likelihood - good.log_likelihood, abs=1.0)
    else:
        assert after.gain == 0.0
        assert after.fit is stuck.fit


def test_what_a_walk_hides_is_told_as_a_rival_of_the_constant_force_behind_it(start: Model) -> None:
    # On a command of one size an uneven gain is an offset. A walk hides both; only the offset is looked for behind it.
    machine = load_model("axis").with_effects(["gain_asymmetry@input(ratio=0.1)"])
    record = record_of(machine, 1, seconds=8.0)
    command = np.sign(record.input)
    rng = np.random.default_rng(1)
    torque = lfilter([1.0], [1.0, -0.9], rng.normal(size=len(command)))
    noise = np.column_stack([rng.normal(size=len(command)) * float(o.noise or 0.0) for o in machine.outputs])
    driven = command + 0.02 * torque / np.std(torque)
    output = simulate(machine, record.time, driven, record.time, noise=noise).output
    diagnosis = diagnose(start, [replace(record, input=command, output=output)])
    assert {"input_offset@input", "gain_asymmetry@input"} <= set(diagnosis.set)
