"""Grey-box fit of any model file to any number of records."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from idloop.arrays import Array
from idloop.errors import IdloopError, InputError
from idloop.estimation.criterion import Criterion
from idloop.estimation.criterion_choice import choose_criterion, percent
from idloop.estimation.dataset import Data, opening_segments, output_noise, prepare
from idloop.estimation.direction import opposite_direction_warning
from idloop.estimation.force_balance.cross_validation import cross_validated_error
from idloop.estimation.force_balance.weak_fit import WeakFit
from idloop.estimation.force_balance.window_width import fit_by_force_if_possible
from idloop.estimation.likelihood.disturbance import LONG_MEMORY
from idloop.estimation.likelihood.estimation_problem import prepare_estimation
from idloop.estimation.likelihood.first_fit import first_fit
from idloop.estimation.likelihood.refit import Refit
from idloop.estimation.observer.innovations import InnovationCriterion
from idloop.estimation.optimisation.jacobian_check import jacobian_unreliable
from idloop.estimation.optimisation.least_squares import LeastSquaresProblem
from idloop.estimation.optimisation.levenberg import difference_jacobian
from idloop.estimation.optimisation.solve import Solution, slopes_agree, solve, typical_size
from idloop.estimation.result import FitResult, Ratio, RecordResidual
from idloop.estimation.simulation import SimulationCriterion
from idloop.estimation.statistics.covariance import estimate_covariance
from idloop.estimation.statistics.uncertainty import at_bounds, ties, uncertainty_warnings
from idloop.estimation.statistics.undetermined import common_factor, common_scale, exactly_tied, standard_errors
from idloop.records.inspection.checks import excites

if TYPE_CHECKING:
    from idloop.physics import Engine, Model
    from idloop.records import Record

Progress = Callable[[float, str], None]

# Ratio of losses above which a fit with one parameter held is worse.
_NO_WORSE = 1.01

CRITERIA = ("auto", "prediction", "simulation", "force")


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def fit(
    model: Model,
    records: Sequence[Record],
    criterion: str = "auto",
    progress: Progress | None = None,
) -> FitResult:
    """Estimate the free parameters of a model.

    Parameters
    ----------
    model : Model
        Structure, starting values, bounds and known parameters.
    records : sequence of Record
        One experiment or several, weighted by their samples.
    criterion : {"auto", "prediction", "simulation", "force"}
        One-step prediction errors of an observer with a disturbance force, free-run errors, or the unexplained force
        along the measured motion. ``auto`` follows the rule in `idloop.estimation.criterion_choice` and gives the
        reason in the result.
    progress : callable, optional
        Called with the share done in [0, 1] and a short text.

    Returns
    -------
    FitResult

    Raises
    ------
    InputError
        If a record does not match the model, the command never changes, no parameter is free, or the criterion is
        unknown or impossible.
    IdloopError
        If the model cannot be simulated at its starting values.
    """
    from idloop.estimation.optimisation.caching_engine import CachingEngine

    if criterion not in CRITERIA:
        raise InputError(f"criterion {criterion!r} is unknown; choose one of {', '.join(CRITERIA)}")
    if len(model.free) == 0:
        raise InputError(f"model {model.name!r} has nothing to estimate; write a parameter as {{value: ...}}")
    data = prepare(model, records)
    if not excites(records):
        raise InputError("the command never changes in these records; excite the axis, nothing can be identified")
    report = progress or (lambda share, text: None)
    engine = CachingEngine(model)
    scale = common_scale(engine, data)
    if scale is not None:
        return scale.extended(model, fit(scale.fixed(model), records, criterion, progress))
    noise = output_noise(model, data)
    report(0.0, "looking at the data")
    start = model.theta
    # The balance is nearly linear in the parameters: a cheap start for every criterion, and often the best one itself.
    near = fit_by_force_if_possible(engine, data, start)
    known = near if near is not None and (criterion == "force" or near.resolved) else None
    balance = None if known is not None and criterion != "force" and known.scaled_by_loop else known
    if criterion == "force" and balance is None:
        raise InputError(
            "the force criterion needs every body's position or velocity at a steady rate, and some hundred samples",
            "use prediction",
        )

    def by_force(balance: WeakFit, why: str) -> FitResult:
        result = _conclude_force(model, data, balance, why, noise)
        return _without_ties(model, records, criterion, report, result, balance.slopes) or result

    if balance is not None and criterion == "force":
        return by_force(balance, "as requested")
    if balance is not None and criterion == "auto" and (balance.model_error_dominates or balance.noisy_command):
        return by_force(balance, _why_force(balance))
    chosen, why = ("prediction", _why_prediction(known)) if criterion == "auto" else (criterion, "as requested")
    # Even with much noise a balance may be nearer to the optimum than the starting values.
    starts = [start] if near is None else [start, near.theta]
    report(0.1, f"{chosen} criterion")

    def searched(name: str, reason: str) -> tuple[Array, FitResult]:
        if name == "prediction":
            estimation = prepare_estimation(model, records, name)
            ended = _of_refit(first_fit(estimation, model))
        else:
            found = _search(engine, model, data, starts, lambda share, text: report(0.1 + 0.6 * share, text))
            ended = _of_solution(found)
        report(0.75, "standard errors")
        return ended.jacobian, _conclude(model, data, ended, reason, noise)

    try:
        jacobian, result = searched(chosen, why)
    except (IdloopError, np.linalg.LinAlgError) as error:
        if criterion != "auto" or isinstance(error, InputError):
            raise
        # A model without an observer can still be simulated.
        report(0.1, "simulation criterion")
        chosen, reason = "simulation", str(error).partition(";")[0]
        jacobian, result = searched(chosen, f"the prediction criterion fails: {reason}")
    if balance is not None and criterion == "auto" and balance.contradicts(result.model):
        return by_force(balance, f"{chosen} explains a force as a disturbance, as the force balance shows")
    alone = _without_ties(model, records, criterion, report, result, jacobian)
    if alone is not None:
        return alone
    if criterion != "auto" or chosen == "simulation":
        return result
    report(0.8, "free run, to compare with")
    try:
        rival = _search(engine, model, data, [result.values, *starts], lambda share, text: None)
        free = _conclude(model, data, _of_solution(rival), "", noise)
        # The free run of the predicted values, from its own best initial state: a search for that begins where the best
        # free run does.
        rule = SimulationCriterion(engine, data)
        rule.keep(rival.nuisance)
        held = solve(rule, result.values, result.values, result.values, draft=True, typical=model.theta)
        missed = _residuals(model, data, rule, held.theta, held.nuisance)
    except (IdloopError, np.linalg.LinAlgError):
        return result
    report(0.95, "comparing the criteria")
    final = choose_criterion(result, free, data, missed)
    return replace(free if final.criterion == "simulation" else result, why=final.why)


def _without_ties(
    model: Model,
    records: Sequence[Record],
    criterion: str,
    report: Progress,
    result: FitResult,
    jacobian: Array,
) -> FitResult | None:
    """The fit with one of the exactly tied parameters held; None without such, or where it is worse.

    Along a direction without influence a search may have gone far, to where rounding and bounds decide.
    """
    together = exactly_tied(model, jacobian, result.values)
    if together is None:
        return None
    settled = fit(together.fixed(model), records, criterion, lambda share, text: report(0.8 + 0.2 * share, text))
    if settled.criterion == result.criterion and settled.loss > _NO_WORSE * result.loss:
        return None
    return together.extended(model, settled)


def _search(engine: Engine, model: Model, data: list[Data], starts: list[Array], report: Progress) -> Solution:
    """Best free run from several starting points, tried in turn until a search converges."""
    best: Solution | None = None
    ranked, exact_slopes = _nearer(engine, model, data, _ranked(SimulationCriterion(engine, data), starts))
    for trial in ranked:
        rule = SimulationCriterion(engine, data)
        found = solve(rule, trial, *model.bounds, report=report, typical=model.theta, exact_slopes=exact_slopes)
        if best is None or found.problem.objective < best.problem.objective:
            best = found
        if best.converged:
            break
    if best is None:
        raise IdloopError("no starting point could be fitted")
    return best


def _nearer(engine: Engine, model: Model, data: list[Data], ranked: list[Array]) -> tuple[list[Array], bool]:
    """Starting points, with the result of a search over the beginnings of long records first.

    Also whether sensitivity equations apply there (`slopes_agree`).
    """
    short = opening_segments(data)
    if short is None:
        return ranked, False
    rule = SimulationCriterion(engine, short)
    try:
        near = solve(rule, ranked[0], *model.bounds, draft=True, typical=model.theta)
    except IdloopError:
        return ranked, False
    return [near.theta, *ranked], slopes_agree(near)


def _why_force(balance: WeakFit) -> str:
    if balance.noisy_command:
        return "noise of the measured command biases predictions (errors in variables) and not the force balance"
    return (
        f"the force balance leaves {percent(balance.relative)} of the drive force unexplained, much more than sensor"
        " noise: model error limits the fit"
    )


def _why_prediction(balance: WeakFit | None) -> str:
    if balance is None:
        return "no force balance above the measurement noise: not every body's motion is measured accurately enough"
    if balance.scaled_by_loop:
        return "an unknown gain of the drive's own loop scales all forces, so that a force balance does not show it"
    return (
        f"the force balance leaves {percent(balance.relative)} of the drive force unexplained, but measurement noise"
        " is too large a part of that to conclude that model error limits the fit"
    )


def _conclude_force(model: Model, data: list[Data], fit: WeakFit, why: str, noise: Array) -> FitResult:
    """Result of a fit by force balance."""
    k, count = len(model.free), int(fit.form.starts[-1])
    names = tuple(f"force[{body}]" for body in model.bodies)
    times, edges = fit.form.along("time"), fit.form.starts
    residuals = tuple(
        RecordResidual(d.name, times[first:last], fit.residual[first:last], names)
        for d, first, last in zip(data, edges[:-1], edges[1:], strict=True)
    )
    loss = float(np.prod(np.mean(fit.residual**2, axis=0)))
    return _result(
        model, fit.theta, fit.covariance[:k, :k], fit.slopes, loss, count, fit.converged, [],
        criterion="force", why=why, output_noise=noise, residuals=residuals, iterations=fit.iterations,
        command_shift=fit.shift if fit.form.free_timing else None, force_error=fit.relative,
        force_error_unseen=cross_validated_error(fit),
    )  # fmt: skip


def _result(
    model: Model, theta: Array, covariance: Array, jacobian: Array, loss: float, count: int, converged: bool,
    notes: list[str], *, intensity: float | None = None, **fields: Any,
) -> FitResult:  # fmt: skip
    """Result with standard errors and warnings; the other fields of `FitResult` are given.

    `model`: before the fit.
    `theta` (k,).
    `covariance` (k, k).
    `jacobian` (n, k + m): of the standardised errors, parameters first.
    `count`: samples.
    `notes`: further warnings.
    `intensity`: of a random-walk disturbance [force²/s].
    """
    k, (lower, upper) = len(theta), model.bounds
    tied, seen = ties(jacobian.T @ jacobian, k)
    covariance = covariance.copy()
    covariance[~seen, :] = covariance[:, ~seen] = np.nan
    for tie in tied:
        if tie.exact:
            covariance[list(tie.members), :] = covariance[:, list(tie.members)] = np.nan
    valued = model.with_theta(theta)
    factor = common_factor(valued, covariance)
    ratios: tuple[Ratio, ...] = ()
    if factor is not None:
        ratios = factor.ratios_of(valued.with_values({}, standard_errors(valued, covariance)))
        members = [i for i, name in enumerate(model.free) if name in factor.names]
        covariance[members, :] = covariance[:, members] = np.nan
        tied = [tie for tie in tied if not set(tie.members) <= set(members)]
        notes = [factor.text, *notes]
    stderr = np.sqrt(np.diag(covariance))
    limits = at_bounds(theta, lower, upper, typical_size(theta, lower, upper))
    at_bound = tuple(n for n, hit in zip(model.free, limits, strict=True) if hit)
    warnings = uncertainty_warnings(model.free, theta, stderr, tied, seen)
    warnings += [f"{name} ended on its bound; its interval is one-sided at best" for name in at_bound]
    warnings += notes
    if not converged:
        warnings.append("the search did not converge; try other starting values")
    fitted = valued.with_values(
        {}, {n: float(s) if np.isfinite(s) else None for n, s in zip(model.free, stderr, strict=True)}
    )
    if fields["criterion"] == "prediction":
        fitted = replace(fitted, disturbance=None if intensity is None else float(np.sqrt(intensity)))
    if opposite := opposite_direction_warning(model, fitted):
        warnings.append(opposite)
    return FitResult(
        model=fitted, names=tuple(model.free), values=theta, stderr=stderr, covariance=covariance, loss=loss,
        fpe=loss * (1.0 + k / count) / max(1.0 - k / count, 1e-12), disturbance_intensity=intensity, at_bound=at_bound,
        warnings=tuple(warnings), samples=count, converged=converged, ratios=ratios, **fields,
    )  # fmt: skip


def _ranked(rule: Criterion, starts: list[Array]) -> list[Array]:
    """Starting points, the one with the smaller criterion first."""
    if len(starts) == 1:
        return starts
    values = []
    for theta in starts:
        try:
            problem = LeastSquaresProblem(rule, len(theta))
            problem.reweigh(np.concatenate([theta, rule.nuisance()[0]]), whiten=False)
            values.append(problem.objective if np.isfinite(problem.objective) else np.inf)
        except (IdloopError, np.linalg.LinAlgError):
            values.append(np.inf)
    return [starts[i] for i in np.argsort(values, kind="stable")]


@dataclass(frozen=True)
class _Ended:
    """End of a search by prediction or simulation, with k free parameters and m nuisance parameters."""

    problem: LeastSquaresProblem  # with the weights of the solution
    # From a point to the whitened errors in units of their standard deviation, shape (n,)
    residual: Callable[[Array], Array]
    # shape (k + m,): the parameters, their bounds and typical sizes
    point: Array
    lower: Array
    upper: Array
    scale: Array
    jacobian: Array  # shape (n, k + m)
    covariance: Array  # shape (k, k)
    iterations: int
    converged: bool


def _of_refit(fit: Refit) -> _Ended:
    lower, upper = fit.model.bounds
    _, low, high, size = fit.criterion.nuisance()
    scale = np.concatenate([typical_size(fit.model.theta, lower, upper), size])
    jacobian = fit.jacobian * ((np.arange(len(scale)) < fit.parameters) | fit.sensitive)
    return _Ended(
        problem=fit.problem,
        residual=fit.problem.frozen_residual,
        point=fit.point,
        lower=np.concatenate([lower, low]),
        upper=np.concatenate([upper, high]),
        scale=scale,
        jacobian=jacobian,
        covariance=fit.covariance,
        iterations=fit.rounds,
        converged=fit.settled,
    )


def _of_solution(solution: Solution) -> _Ended:
    problem, k = solution.problem, len(solution.theta)
    point = np.concatenate([solution.theta, solution.nuisance])
    problem.reweigh(point, problem.criterion.whiten)
    residual, jacobian = problem.residual(point), solution.jacobian
    if len(jacobian) != len(residual):
        jacobian, _ = difference_jacobian(
            problem.residual, point, residual, solution.lower, solution.upper, solution.step, solution.scale
        )
    covariance = estimate_covariance(problem, point, residual, jacobian)[:k, :k]
    return _Ended(
        problem=problem,
        residual=problem.residual,
        point=point,
        lower=solution.lower,
        upper=solution.upper,
        scale=solution.scale,
        jacobian=jacobian,
        covariance=covariance,
        iterations=solution.iterations,
        converged=solution.converged,
    )


def _conclude(model: Model, data: list[Data], ended: _Ended, why: str, noise: Array) -> FitResult:
    """Result of a search by prediction or simulation."""
    problem, rule, point, k = ended.problem, ended.problem.criterion, ended.point, len(model.free)
    notes = []
    contacts = any(active.effect.edge is not None for active in model.effects)
    if contacts and jacobian_unreliable(ended.residual, point, ended.lower, ended.upper, ended.scale, k):
        notes.append(
            "contacts in the backlash are so frequent that a change of a parameter by 0.1 % gives another motion: the "
            "estimates depend on the starting values, and the intervals are too small; record a slower motion"
        )
    predicted = isinstance(rule, InnovationCriterion)
    return _result(
        model, point[:k], ended.covariance, ended.jacobian, problem.loss, problem.count(point), ended.converged, notes,
        # A disturbance of short memory is no random walk.
        intensity=rule.intensity if isinstance(rule, InnovationCriterion) and rule.memory >= LONG_MEMORY else None,
        criterion="prediction" if predicted else "simulation", why=why, output_noise=noise, command_shift=None,
        residuals=_residuals(model, data, rule, point[:k], point[k:]), iterations=ended.iterations,
        orders=tuple(problem.orders),
    )  # fmt: skip


def _residuals(model: Model, data: list[Data], rule: Any, theta: Array, nuisance: Array) -> tuple[RecordResidual, ...]:
    names = tuple(o.name for o in model.outputs)
    found = []
    for index, d in enumerate(data):
        if isinstance(rule, InnovationCriterion):
            value = rule.innovation(theta, nuisance, index)
        else:
            value = d.output - rule.simulated(theta, nuisance, index)
        found.append(RecordResidual(d.name, d.time, value, names))
    return tuple(found)
