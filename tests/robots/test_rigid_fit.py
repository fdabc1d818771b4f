from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.robots.conftest import ARMATURE, DRY, JOINTS, VISCOUS, made

from idloop.errors import InputError
from idloop.robots.balance import balance_of, parameter_names, robot_motions
from idloop.robots.inertia import pseudo_inertia
from idloop.robots.rigid_body import RigidBody
from idloop.robots.rigid_fit import fit_payload, fit_rigid


def balances(urdf, records):
    robot = RigidBody(urdf)
    return [balance_of(robot, one) for one in robot_motions(records, [False, False])]


def true_base(fit, links):
    """True value of every base parameter."""
    own = np.column_stack([ARMATURE, VISCOUS, DRY, np.zeros(2)]).ravel()
    true = dict(zip(parameter_names(JOINTS), [*links, *own], strict=True))
    return {
        one.name: true[one.name] + sum(factor * true[name] for name, factor in one.others.items()) for one in fit.base
    }


def test_a_planar_arm_is_found(urdf, true_links):
    fit = fit_rigid(JOINTS, balances(urdf, [made(urdf, true_links)]), RigidBody(urdf).nominal)
    true = true_base(fit, true_links)
    assert len(fit.base) == 6 + 7  # friction and offsets; first moments and inertias in the plane, with the rotors
    for one in fit.base:
        assert one.value == pytest.approx(true[one.name], abs=max(4.0 * one.stderr, 1e-3)), one.name
    assert fit.own[:, 1] == pytest.approx(VISCOUS, abs=0.01)
    assert fit.own[:, 2] == pytest.approx(DRY, abs=0.01)
    assert all(np.all(np.linalg.eigvalsh(pseudo_inertia(link)) > 0.0) for link in fit.links)
    assert fit.excess < 0.02


def test_what_the_data_do_not_show_is_that_of_the_description(urdf, true_links):
    nominal = RigidBody(urdf).nominal
    fit = fit_rigid(JOINTS, balances(urdf, [made(urdf, true_links)]), nominal)
    names = parameter_names(JOINTS)
    # No motion about x or z.
    for name in ("shoulder.ixx", "elbow.izz"):
        place = names.index(name)
        assert fit.links.ravel()[place] == pytest.approx(nominal[place], rel=0.3)


def test_the_size_of_a_known_effect_is_estimated_with_the_rest(urdf, true_links):
    def effect(q, v):
        return np.column_stack([np.zeros(len(q)), 0.2 * np.sin(9.0 * q[:, 1])])

    (one,) = balances(urdf, [made(urdf, true_links, extra=effect)])
    subtracted = 0.8 * effect(one.motion.position, one.motion.velocity)
    known = one.without(subtracted).with_columns(subtracted[:, :, None] * np.array([0.0, 1.0])[:, None])
    fit = fit_rigid(JOINTS, [known], RigidBody(urdf).nominal, [1])
    assert fit.scales == pytest.approx([1.0, 1.25], abs=0.02)
    named = next(base for base in fit.base if base.name == "elbow.effects")
    assert named.value == pytest.approx(1.25, abs=4.0 * named.stderr + 0.005)
    assert fit.own[:, 2] == pytest.approx(DRY, abs=0.01)


def test_intervals_hold_what_they_promise(urdf, true_links):
    held = total = 0
    record = made(urdf, true_links, noise=0.0)
    (clean,) = balances(urdf, [record])
    random = np.random.default_rng(5)
    for _ in range(60):
        noisy = clean.without(0.05 * random.normal(size=record.effort.shape))
        fit = fit_rigid(JOINTS, [noisy], RigidBody(urdf).nominal)
        truth = fit_rigid(JOINTS, [clean], RigidBody(urdf).nominal)
        exact = {one.name: one.value for one in truth.base}
        for one in fit.base:
            if one.name in exact:
                low, high = one.interval
                held += low <= exact[one.name] <= high
                total += 1
    assert total > 600
    assert held / total > 0.92


def test_the_payload_is_the_difference_of_two_records(urdf, true_links):
    place, mass = np.array([0.02, 0.0, 0.25]), 0.5
    inertia = mass * (place @ place * np.eye(3) - np.outer(place, place))
    body = np.array([mass, *(mass * place), *inertia[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]])
    loaded = true_links + np.concatenate([np.zeros(10), body])
    empty = balances(urdf, [made(urdf, true_links)])
    fit = fit_rigid(JOINTS, empty, RigidBody(urdf).nominal)
    found = fit_payload(fit, empty, balances(urdf, [made(urdf, loaded, seed=3)]))
    assert found.joint == "elbow"
    # A planar arm carries mass and inertia about one axis: the mass at the elbow acts on the shoulder alone.
    assert found.mass == pytest.approx(mass, abs=max(4.0 * found.mass_stderr, 1e-3))
    assert found.centre[[0, 2]] == pytest.approx(place[[0, 2]], abs=0.005)
    assert np.isnan(found.centre[1])


def test_too_short_a_record_is_refused(urdf, true_links):
    (whole,) = balances(urdf, [made(urdf, true_links)])
    few = slice(0, 10)
    short = replace(
        whole, time=whole.time[few], regressor=whole.regressor[few], torque=whole.torque[few], used=whole.used[few]
    )
    with pytest.raises(InputError, match="too few"):
        fit_rigid(JOINTS, [short], RigidBody(urdf).nominal)


def test_an_arm_that_stands_still_is_refused(urdf, true_links):
    record = made(urdf, true_links)
    record.position[:] = 0.3
    with pytest.raises(InputError, match="no joint moves"):
        balances(urdf, [record])
