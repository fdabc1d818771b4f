"""Parameters of which the motion determines only a combination: one of them is held at its value.

In the usual case neither the drive's gain nor inertia and friction are known: a common factor of all forces does not
change the motion, and only their ratios are determined. No criterion has a minimum along such a direction, so that it
is found before the search.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from idloop.arrays import Array
from idloop.estimation.dataset import prepare
from idloop.estimation.result import FitResult, Ratio
from idloop.estimation.simulation import SimulationCriterion
from idloop.estimation.statistics.uncertainty import reduced_hessian, ties
from idloop.physics import Engine
from idloop.physics.effect import INPUT
from idloop.physics.schema import BODY_PARAMETERS, COUPLING_PARAMETERS

if TYPE_CHECKING:
    from idloop.estimation.dataset import Data
    from idloop.physics import Model
    from idloop.records import Record


# A power of two: a scaled simulation is equal in all digits unless some force is not scaled.
_FACTOR = 2.0
_SAME = 1e-9
# A common factor is undetermined from this relative standard error on: its interval contains zero.
_ANY_FACTOR = 0.5
# Parameters that share a factor move by the same part, within this.
_ALIKE = 0.2


@dataclass(frozen=True)
class Undetermined:
    """Parameters of which the motion determines only a combination."""

    names: tuple[str, ...]  # all of them
    held: str  # the one that is held at its value
    value: float  # value of the held one
    unit: str  # its unit
    ratios: bool  # whether a common factor has no influence, so that the ratios are determined
    exact: bool = True  # or only within the noise of the data

    @property
    def text(self) -> str:
        """Warning: what the data cannot tell, and what to do."""
        listed = f"{', '.join(name for name in self.names if name != self.held)} and {self.held}"
        if not self.exact:
            return (
                f"this data determines hardly more than the ratios of {listed}: excite larger accelerations, or fix one"
                f" of them from the data sheet; here {self.held} is held at {self.value:.6g} {self.unit}, and the"
                " intervals of the others are those beside it"
            )
        what, which = f"this data cannot tell {listed} apart", self.held
        if self.ratios:
            what = f"only the ratios of {listed} are determined: any common factor gives the same motion"
            which += " from the data sheet"
        return (
            f"{what}: fix one of them in the model, e.g. {which}; here it is held at {self.value:.6g} {self.unit}, and"
            " the others are those that go with it"
        )

    def fixed(self, model: Model) -> Model:
        """The model with the held parameter fixed."""
        return model.with_free(name for name in model.free if name != self.held)

    def ratios_of(self, fitted: Model) -> tuple[Ratio, ...]:
        """Ratios to the held parameter of a model with standard errors of the others."""
        return tuple(
            Ratio(f"{p.name} / {self.held}", p.value / self.value, p.stderr / self.value, f"{p.unit} / ({self.unit})")
            for p in fitted.parameters
            if p.name in self.names and p.name != self.held and p.stderr is not None
        )

    def extended(self, model: Model, fitted: FitResult) -> FitResult:
        """Result for the whole model from a fit of the fixed one: no standard errors of these, but ratios."""
        names = model.free
        place = [names.index(name) for name in fitted.names]
        values = np.array([self.value if name == self.held else np.nan for name in names])
        values[place] = fitted.values
        covariance = np.full((len(names), len(names)), np.nan)
        covariance[np.ix_(place, place)] = fitted.covariance
        members = [i for i, name in enumerate(names) if name in self.names]
        covariance[members, :] = covariance[:, members] = np.nan
        ratios = self.ratios_of(fitted.model) if self.ratios else ()
        freed = fitted.model.with_free(names)
        parameters = tuple(replace(p, stderr=None) if p.name in self.names else p for p in freed.parameters)
        return replace(
            fitted,
            model=replace(freed, parameters=parameters),
            names=tuple(names),
            values=values,
            stderr=np.sqrt(np.diag(covariance)),
            covariance=covariance,
            warnings=(self.text, *fitted.warnings),
            ratios=(*ratios, *fitted.ratios),
        )


def common_scale(engine: Engine, data: list[Data]) -> Undetermined | None:
    """The forces of which only ratios are determined, at the model's starting values; None where a force is known."""
    model = engine.model
    forces = proportional_to_force(model)
    names = tuple(name for name in model.free if name in forces)
    inertias = [f"{body}.inertia" for body in model.bodies]
    if not {_drive_scale(model), *inertias} <= set(names) or not _same_motion(engine, data, names):
        return None
    held = model.parameter(inertias[0])
    return Undetermined(names, held.name, held.value, held.unit, ratios=True)


def common_factor(model: Model, covariance: Array) -> Undetermined | None:
    """The free parameters that a fit determines up to a common factor only, within the noise of its data.

    Where the inertia hardly shows, as in slow motion, forces that are known relative to it share such a factor.

    `model`: fitted.
    `covariance` (k, k): of its free parameters, and of others behind them.
    """
    values, (lower, upper) = model.theta, model.bounds
    covariance = covariance[: len(values), : len(values)]
    inside = np.flatnonzero(np.isfinite(np.diag(covariance)) & (values > lower) & (values < upper) & (values != 0.0))
    if len(inside) < 2:
        return None
    relative = covariance[np.ix_(inside, inside)] / np.outer(values[inside], values[inside])
    powers, directions = np.linalg.eigh(relative)
    sharing = _sharing(directions[:, -1])
    share = [int(inside[place]) for place in sharing]
    most = float(np.max(np.abs(directions[sharing, -1]), initial=0.0))
    if len(share) < 2 or not np.sqrt(powers[-1]) * most > _ANY_FACTOR:
        return None
    names = tuple(model.free[place] for place in share)
    held = model.parameter(next((name for name in names if name.startswith("drive.")), names[0]))
    return Undetermined(names, held.name, held.value, held.unit, ratios=True, exact=False)


def standard_errors(model: Model, covariance: Array) -> dict[str, float | None]:
    """Standard errors of free parameters, None for what the data do not determine.

    Of parameters of which only the ratios are determined one is held.

    `model`: fitted.
    `covariance` (k, k): of its free parameters, and of others behind them.
    """
    covariance = covariance[: len(model.free), : len(model.free)]
    factor = common_factor(model, covariance)
    if factor is not None:
        column = covariance[:, model.free.index(factor.held)]
        held = model.free.index(factor.held)
        covariance = covariance - np.outer(column, column) / covariance[held, held]
        covariance[held, :] = covariance[:, held] = np.nan
    return {
        name: float(np.sqrt(max(variance, 0.0))) if np.isfinite(variance) else None
        for name, variance in zip(model.free, np.diag(covariance), strict=True)
    }


def effect_scales(model: Model, records: Sequence[Record]) -> list[Undetermined]:
    """Effects of a fitted model of which only ratios are determined, as one of their parameters is held at its default.

    A supply voltage is one: only the winding's resistance gives its unit and that of the back-EMF.
    """
    values, free = model.values, model.free
    found = []
    for active in model.effects:
        specs = {f"{active.name}.{p.name}": p for p in active.effect.parameters if p.estimated}
        names = tuple(name for name in free if name in specs)
        held = [
            name for name, p in specs.items()
            if p.held and name in values and name not in free and values[name] == p.start != 0.0
        ]  # fmt: skip
        if not names or len(held) != 1:
            continue
        engine = Engine(model.with_free([*free, *held]))
        data = prepare(engine.model, records)
        # A parameter without influence of its own is no part of a ratio.
        if _same_motion(engine, data, (*names, *held)) and not _same_motion(engine, data, held):
            known = model.parameter(held[0])
            found.append(Undetermined((*names, known.name), known.name, known.value, known.unit, ratios=True))
    return found


def _same_motion(engine: Engine, data: list[Data], names: Sequence[str]) -> bool:
    """Whether a common factor of some free parameters does not change the motion."""
    theta = engine.model.theta
    scaled = np.array([_FACTOR if name in names else 1.0 for name in engine.model.free]) * theta
    rule = SimulationCriterion(engine, data)
    start = rule.nuisance()[0]
    for record in range(len(data)):
        one, two = rule.simulated(theta, start, record), rule.simulated(scaled, start, record)
        # A simulation that diverges is compared up to there.
        finite = np.isfinite(one) & np.isfinite(two)
        if not np.any(finite) or np.max(np.abs(one - two)[finite]) > _SAME * np.ptp(one[finite]):
            return False
    return True


def exactly_tied(model: Model, jacobian: Array, values: Array) -> Undetermined | None:
    """Parameters that only rounding separates, from a Jacobian of the errors; the last one is held.

    The last parameter is the one that was added last to a model. Where they share a factor their ratios are determined.

    `model`: before the fit: the held parameter keeps its value.
    `jacobian` (n, k + m): of the errors, free parameters first.
    `values` (k,): at which the Jacobian was taken.
    """
    hessian = jacobian.T @ jacobian
    tied, _ = ties(hessian, len(model.free))
    for tie in tied:
        if tie.exact:
            names = tuple(model.free[i] for i in tie.members)
            held = model.parameter(names[-1])
            members = list(tie.members)
            relative = reduced_hessian(hessian, len(values))[np.ix_(members, members)]
            least = np.linalg.eigh(relative * np.outer(values[members], values[members]))[1][:, 0]
            factor = len(_sharing(least)) == len(members)
            return Undetermined(names, held.name, held.value, held.unit, ratios=factor, exact=not factor)
    return None


def _sharing(direction: Array) -> list[int]:
    """Places of the parameters that move by the same part along a direction (k,) of relative changes."""
    direction = direction * np.sign(np.sum(direction))
    return [int(place) for place in np.flatnonzero(direction > (1.0 - _ALIKE) * float(np.max(direction)))]


def proportional_to_force(model: Model) -> set[str]:
    """Parameters that are proportional to a force."""
    found, output = {_drive_scale(model)}, _drive_scale(model) != "drive.gain"
    if model.loop is not None and output:
        found |= {f"drive.{p.name}" for p in model.loop.effect.parameters if p.unit.startswith("{input}")}
    found |= {f"{body}.{own}" for body in model.bodies for own in BODY_PARAMETERS}
    found |= {f"{coupling}.{own}" for coupling in model.couplings for own in COUPLING_PARAMETERS}
    for active in model.effects:
        scaled = "{input}" if active.effect.site == INPUT else "{force}"
        if output or scaled == "{force}":
            found |= {f"{active.name}.{p.name}" for p in active.effect.parameters if p.unit.startswith(scaled)}
    return found


def _drive_scale(model: Model) -> str:
    """Parameter that scales the drive's force: its gain, or that of a loop that is estimated."""
    loop = "drive.proportional"
    return loop if model.loop is not None and loop in model.free else "drive.gain"
