"""The error of the force on unseen halves: one step from the whole fit, beside fits of the halves."""

from __future__ import annotations

import numpy as np
import pytest

import idloop
from idloop.estimation import fit
from idloop.estimation.dataset import prepare
from idloop.estimation.force_balance.cross_validation import cross_validated_error
from idloop.estimation.force_balance.weak_fit import fit_weak
from idloop.estimation.force_balance.weak_form import weak_form
from idloop.estimation.force_balance.window_width import fit_by_force
from idloop.estimation.optimisation.caching_engine import CachingEngine

MODEL = idloop.load_model("axis").with_effects(["coulomb_friction@axis(level=0.1)"])


def record(machine, seconds):
    signal = idloop.excitation("multisine", sample_time=0.004, duration=seconds, amplitude=1.5)
    return idloop.simulate(machine, signal)


def fitted(model, data):
    return fit_by_force(CachingEngine(model), data, model.theta, accept_noise=True)


@pytest.mark.parametrize("hidden", [None, "cogging@axis(amplitude=0.1, harmonic=6)"])
def test_it_is_that_of_fits_of_the_halves(hidden):
    whole = record(MODEL if hidden is None else MODEL.with_effects([hidden]), 30.0)
    middle = 0.5 * float(whole.time[-1])
    found = fitted(MODEL, prepare(MODEL, [whole]))
    halves = [prepare(MODEL, [whole.cut(*ends)]) for ends in ((None, middle), (middle, None))]
    left = drive = 0.0
    for seen, unseen in (halves, halves[::-1]):
        # In windows of the same width, with the same rest speed; those at the ends of a half differ.
        forms = [
            weak_form(CachingEngine(MODEL), one, found.form.width, found.form.rest_speed) for one in (seen, unseen)
        ]
        half = fit_weak(forms[0], found.point)
        left += float(np.sum(forms[1].residual(half.theta, half.shift) ** 2))
        drive += float(np.sum(forms[1].drive(half.theta, half.shift) ** 2))
    assert cross_validated_error(found) == pytest.approx(np.sqrt(left / drive), rel=0.1)


def test_a_fit_has_it_and_it_is_larger_than_that_of_the_data_that_were_fitted():
    found = fit(MODEL, [record(MODEL, 30.0)], criterion="force")
    assert found.force_error < found.force_error_unseen < 1.1 * found.force_error
    assert fit(MODEL, [record(MODEL, 8.0)], criterion="prediction").force_error_unseen is None
