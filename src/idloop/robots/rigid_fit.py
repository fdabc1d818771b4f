"""Least squares of a robot's torque balance: base parameters with intervals, and links that are physically possible.

Rows of every joint have the weight of their residual variance. What the data determine are the base parameters, found
by a QR decomposition with column pivoting of the regressor on the data (Gautier, J. Robotic Systems 8, 1991). All
parameters are then estimated under positive definite pseudo-inertias (`idloop.robots.inertia`), with a prior that keeps
each link at its description where the data say nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.linalg import qr
from scipy.optimize import least_squares

from idloop.arrays import Array, Integers
from idloop.errors import InputError
from idloop.estimation.statistics.covariance import jackknife, sandwich, white_covariance, widest
from idloop.physics.parameter import NORMAL_95
from idloop.robots.balance import OF_JOINT, Balance, parameter_names
from idloop.robots.inertia import nearest_consistent, parameters_at, root_of
from idloop.robots.rigid_body import PER_LINK

# Pivots below this part of the largest belong to parameters that the data do not determine.
_RANK = 1e-6
# A column below this part of the longest is rounding.
_NOTHING = 1e-9
EFFECTS = "effects"  # name of the factor of a joint's effects
_ROUNDS = 5  # of the joints' variances
_SEGMENTS = 40
_PRIOR = 1.0  # standard deviation of a link's coordinates about its description, see `idloop.robots.inertia`
_LEAST_ARMATURE = 1e-3  # at the start [kg·m²]
_STEP, _MOST_STEPS = 1e-6, 300  # of the optimisation under consistency


@dataclass(frozen=True)
class BaseParameter:
    """A combination of parameters that the data determine."""

    name: str  # of the parameter that stands for the combination
    # In its unit
    value: float
    stderr: float
    others: dict[str, float]  # factors of the other parameters in the combination

    @property
    def interval(self) -> tuple[float, float]:
        """95 % confidence interval."""
        return self.value - NORMAL_95 * self.stderr, self.value + NORMAL_95 * self.stderr


@dataclass(frozen=True)
class RigidFit:
    """Rigid bodies and joints of a robot, fitted."""

    joints: tuple[str, ...]
    links: Array  # shape (joints, 10): physically consistent inertial parameters, in the order of `RigidBody.nominal`
    own: Array  # shape (joints, 4): armature, viscous and Coulomb friction, offset of each joint
    base: tuple[BaseParameter, ...]
    scales: Array  # shape (joints,): factor of the torque of each joint's effects; 1 where it was not estimated
    sigma: Array  # shape (joints,): standard deviation of the residual torque in the comparison band
    condition: float  # condition number of the base parameters' regressor with columns of unit length
    excess: float  # part by which consistency and prior raise the rms residual over that of plain least squares

    @property
    def parameters(self) -> Array:
        """All parameters in the order of the balance, without the scales."""
        return np.concatenate([self.links.ravel(), self.own.ravel()])


def fit_rigid(
    joints: Sequence[str], balances: Sequence[Balance], nominal: Array, scaled: Sequence[int] = ()
) -> RigidFit:
    """Fit the parameters of all joints to the balances of all records together.

    `nominal` (10 joints,): inertial parameters by the description. `scaled`: joints whose effects have a further column
    in the balances, the torque that was subtracted for them: its factor is a correction. Raises InputError: fewer rows
    in motion than parameters that they determine.
    """
    count = len(joints)
    triangles, freedoms = zip(*(_triangle(balances, joint) for joint in range(count)), strict=True)
    sigma, values = _weighted(triangles, np.array(freedoms))
    stacked = np.concatenate([one / s for one, s in zip(triangles, sigma, strict=True)])
    stacked[:, :-1][:, np.isinf(_lengths(stacked))] = 0.0
    base, condition = _base(joints, scaled, balances, stacked, sigma)
    regressor, torque = stacked[:, :-1], stacked[:, -1]
    armatures = range(0, len(OF_JOINT) * count, len(OF_JOINT))
    links, others = consistent_links(regressor, torque, nominal, armatures)
    own = others[: len(OF_JOINT) * count].reshape(count, len(OF_JOINT))
    scales = np.ones(count)
    scales[list(scaled)] += others[len(OF_JOINT) * count :]
    found = np.concatenate([links.ravel(), others])
    plain, kept = (float(np.sum((torque - regressor @ one) ** 2)) for one in (values, found))
    excess = float(np.sqrt(kept / max(plain, 1e-300))) - 1.0
    return RigidFit(tuple(joints), links, own, base, scales, sigma, condition, excess)


def _triangle(balances: Sequence[Balance], joint: int) -> tuple[Array, int]:
    """R of the QR decomposition of a joint's rows with the torque as last column, and the number of rows."""
    table = np.concatenate(
        [np.column_stack([one.regressor[:, joint], one.torque[:, joint]])[one.used[:, joint]] for one in balances]
    )
    return np.asarray(np.linalg.qr(table, mode="r")), len(table)


def _weighted(triangles: Sequence[Array], rows: Integers) -> tuple[Array, Array]:
    """Standard deviation of each joint's residual, and least-squares values, by reweighting."""
    sizes = np.array([float(np.linalg.norm(one[:, -1])) for one in triangles])
    sigma = np.maximum(sizes / np.sqrt(np.maximum(rows, 1)), 1e-12)
    values = np.zeros(triangles[0].shape[1] - 1)
    for _ in range(_ROUNDS):
        stacked = np.concatenate([one / s for one, s in zip(triangles, sigma, strict=True)])
        length = _lengths(stacked)
        solution, _, rank, _ = np.linalg.lstsq(stacked[:, :-1] / length, stacked[:, -1], rcond=_RANK)
        if np.sum(rows) < 2 * rank:
            raise InputError(
                f"{int(np.sum(rows))} rows in motion are too few for {rank} parameters: record a motion of all joints"
                " for longer"
            )
        values = solution / length
        freedom = np.maximum(rows * (1.0 - rank / np.sum(rows)), 1.0)
        errors = np.array([np.linalg.norm(one[:, -1] - one[:, :-1] @ values) for one in triangles])
        sigma = np.maximum(errors / np.sqrt(freedom), 1e-6 * np.max(sigma))
    return sigma, values


def _lengths(stacked: Array) -> Array:
    """Length of every column but the last; infinite where it is rounding."""
    length = np.linalg.norm(stacked[:, :-1], axis=0)
    return np.where(length > _NOTHING * np.max(length, initial=0.0), length, np.inf)


def _base(
    joints: Sequence[str], scaled: Sequence[int], balances: Sequence[Balance], stacked: Array, sigma: Array
) -> tuple[tuple[BaseParameter, ...], float]:
    """Base parameters: friction and offset of each joint first, then the best determined of the others."""
    names = [*parameter_names(joints), *(f"{joints[joint]}.{EFFECTS}" for joint in scaled)]
    first, last = PER_LINK * len(joints), (PER_LINK + len(OF_JOINT)) * len(joints)
    length = _lengths(stacked)
    columns = stacked[:, :-1] / length
    shown = np.flatnonzero(np.isfinite(length))
    ahead = np.array(
        [place for place in shown if place >= first and ((place - first) % len(OF_JOINT) or place >= last)], dtype=int
    )
    behind = np.setdiff1d(shown, ahead)
    q, _ = np.linalg.qr(columns[:, ahead])
    left = columns[:, behind] - q @ (q.T @ columns[:, behind])
    _, triangle, order = qr(left, mode="economic", pivoting=True)
    pivots = np.abs(np.diag(triangle))
    rank = int(np.sum(pivots > _RANK * max(float(pivots[0]), 1e-300)))
    independent = np.concatenate([ahead, behind[order[:rank]]])
    dependent = behind[order[rank:]]
    chosen = columns[:, independent]
    condition = float(np.linalg.cond(chosen))
    mix = np.linalg.lstsq(chosen, columns[:, dependent], rcond=None)[0] * length[dependent] / length[independent, None]
    values = np.linalg.lstsq(chosen, stacked[:, -1], rcond=None)[0] / length[independent]
    errors = np.sqrt(np.diag(_covariance(balances, independent, values, sigma)))
    found = []
    for row, place in enumerate(independent):
        others = {names[other]: float(mix[row, k]) for k, other in enumerate(dependent) if abs(mix[row, k]) > _RANK}
        # The torque that was subtracted is the factor 1.
        value = float(values[row]) + (1.0 if place >= last else 0.0)
        found.append(BaseParameter(names[place], value, float(errors[row]), others))
    return tuple(found), condition


def _covariance(balances: Sequence[Balance], columns: Integers, values: Array, sigma: Array) -> Array:
    """Covariance under residuals that are coloured and correlated between joints."""
    jacobians, residuals, scores = [], [], []
    for one in balances:
        weight = one.used / sigma
        jacobian = one.regressor[:, :, columns] * weight[:, :, None]
        residual = (one.torque - one.regressor[:, :, columns] @ values) * weight
        scores.append(np.einsum("tjk,tj->tk", jacobian, residual))
        jacobians.append(jacobian)
        residuals.append(residual)
    starts = np.cumsum([0, *(len(one) for one in residuals)])
    jacobian, residual = np.concatenate(jacobians), np.concatenate(residuals)
    count = residual.shape[1]
    flat = jacobian.reshape(-1, jacobian.shape[-1])
    share = max(_SEGMENTS // len(balances), 2)
    blocks = [
        np.arange(piece[0] * count, (piece[-1] + 1) * count)
        for a, b in pairwise(starts.tolist())
        for piece in np.array_split(np.arange(a, b), share)
        if len(piece)
    ]
    return widest([sandwich(flat.T @ flat, scores), white_covariance(flat), jackknife(flat, residual.ravel(), blocks)])


def consistent_links(
    regressor: Array, torque: Array, nominal: Array, armatures: Sequence[int] = ()
) -> tuple[Array, Array]:
    """Least squares under positive definite pseudo-inertias, with a prior at the description.

    `regressor` (n, 10 links + k): in units of the residual's standard deviation, as the torque. `torque` (n,).
    `nominal` (10 links,): the description. `armatures`: of the k other parameters, those that are not negative. Returns
    `links` (links, 10). `others` (k,).
    """
    size = len(nominal)
    # What the data do not contain stays 0: the optimiser would move it at random.
    shown = np.flatnonzero(np.any(regressor[:, size:] != 0.0, axis=0))
    if len(shown) < regressor.shape[1] - size:
        bounded = [place for place, own in enumerate(shown) if own in armatures]
        kept, values = consistent_links(
            np.hstack([regressor[:, :size], regressor[:, size + shown]]), torque, nominal, bounded
        )
        whole = np.zeros(regressor.shape[1] - size)
        whole[shown] = values
        return kept, whole
    count, wide = size // PER_LINK, regressor.shape[1]
    roots = np.stack([root_of(nearest_consistent(one)) for one in nominal.reshape(count, PER_LINK)])
    known = regressor[:, :size] @ parameters_at(roots, np.zeros((count, PER_LINK))).ravel()
    positive = size + np.asarray(armatures, dtype=int)
    start, low = np.zeros(wide), np.full(wide, -np.inf)
    start[size:] = np.linalg.lstsq(regressor[:, size:], torque - known, rcond=_RANK)[0]
    start[positive], low[positive] = np.maximum(start[positive], _LEAST_ARMATURE), 0.0
    length = np.linalg.norm(regressor[:, size:], axis=0)
    prior = np.eye(size, wide) / _PRIOR

    def links(point: Array) -> Array:
        return parameters_at(roots, point[:size].reshape(count, PER_LINK))

    def error(point: Array) -> Array:
        linear = np.concatenate([links(point).ravel(), point[size:]])
        return np.concatenate([regressor @ linear - torque, point[:size] / _PRIOR])

    def slope(point: Array) -> Array:
        chain = np.eye(wide)
        for k in range(PER_LINK):
            # The coordinates of different links do not interact.
            step = np.zeros(wide)
            step[k:size:PER_LINK] = _STEP
            change = (links(point + step) - links(point - step)) / (2.0 * _STEP)
            for link in range(count):
                first = PER_LINK * link
                chain[first : first + PER_LINK, first + k] = change[link]
        return np.concatenate([regressor @ chain, prior])

    scale = np.concatenate([np.ones(size), 1.0 / length])
    found = least_squares(error, start, slope, bounds=(low, np.inf), x_scale=scale, max_nfev=_MOST_STEPS).x
    return links(found), found[size:]


@dataclass(frozen=True)
class Payload:
    """A rigid body at the last link."""

    joint: str  # of the last link, in whose frame it is
    # shape (10,): physically consistent: mass [kg], first moments [kg·m], inertia about the frame [kg·m²]
    parameters: Array
    # By least squares [kg]; NaN where the motion does not show it
    mass: float
    mass_stderr: float
    # shape (3,): centre of mass [m]; NaN where the motion does not show it
    centre: Array
    centre_stderr: Array


def fit_payload(fit: RigidFit, empty: Sequence[Balance], loaded: Sequence[Balance]) -> Payload:
    """Fit a body at the last link together with the base parameters of the robot.

    `fit`: of the robot without the body. `empty`, `loaded`: of records without and with the body, the torque of other
    effects subtracted.
    """
    names = parameter_names(fit.joints)
    base = np.array([names.index(one.name) for one in fit.base if one.name in names])
    last = np.arange(PER_LINK * (len(fit.joints) - 1), PER_LINK * len(fit.joints))
    tables = []
    for one, there in [*((one, 0.0) for one in empty), *((one, 1.0) for one in loaded)]:
        both = np.concatenate([one.regressor[:, :, base], there * one.regressor[:, :, last]], axis=2)
        tables.append(replace(one, regressor=both))
    rows = np.concatenate(
        [
            (np.concatenate([one.regressor, one.torque[:, :, None]], axis=2) / fit.sigma[:, None])[one.used]
            for one in tables
        ]
    )
    length = _lengths(rows)
    shown = np.flatnonzero(np.isfinite(length))
    scaled = rows[:, shown] / length[shown]
    solution = np.linalg.lstsq(scaled, rows[:, -1], rcond=_RANK)[0] / length[shown]
    # What a combination of the others replaces is not determined by itself.
    _, size, axes = np.linalg.svd(np.linalg.qr(scaled, mode="r"))
    unclear = np.any(np.abs(axes[size < _RANK * size[0]]) > 1e-3, axis=0)
    whole, covariance = np.full(len(length), np.nan), np.full((len(length), len(length)), np.nan)
    whole[shown] = np.where(unclear, np.nan, solution)
    covariance[np.ix_(shown, shown)] = _covariance(tables, shown, solution, fit.sigma)
    values, covariance = whole[len(base) :], covariance[len(base) :, len(base) :]
    slope = np.zeros((4, 4))
    slope[0, 0] = 1.0
    slope[1:, 0], slope[1:, 1:] = -values[1:4] / values[0] ** 2, np.eye(3) / values[0]
    spreads = [row[row != 0.0] @ covariance[:4, :4][np.ix_(row != 0.0, row != 0.0)] @ row[row != 0.0] for row in slope]
    errors = np.sqrt(np.maximum(spreads, 0.0))
    left = [one.less(fit.parameters) for one in loaded]
    alone = np.concatenate([(one.regressor[:, :, last] / fit.sigma[:, None])[one.used] for one in left])
    torque = np.concatenate([(one.torque / fit.sigma)[one.used] for one in left])
    links, _ = consistent_links(alone, torque, np.zeros(PER_LINK))
    return Payload(fit.joints[-1], links[0], float(values[0]), float(errors[0]), values[1:4] / values[0], errors[1:])
