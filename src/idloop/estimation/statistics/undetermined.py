"""Parameters that the motion shows only together: one of them has to be held for the others to have a value.

The usual case is a drive of which neither gain nor inertia nor friction is known: forces multiplied by one number leave
the motion as it is, so that only ratios can be told. No criterion has a minimum along such a direction, and a force
balance is even perfect where all forces are 0; so it is found before a search, not by it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from idloop.estimation.dataset import prepare
from idloop.estimation.result import FitResult, Ratio
from idloop.estimation.simulation import SimulationCriterion
from idloop.estimation.statistics.uncertainty import ties
from idloop.physics import Engine
from idloop.physics.schema import BODY_PARAMETERS, COUPLING_PARAMETERS

if TYPE_CHECKING:
    from idloop.estimation.dataset import Data
    from idloop.physics import Model
    from idloop.records import Record

Array = NDArray[np.float64]

# A power of two, so that a scaled simulation differs in no digit but for constants that the scale must not have.
_FACTOR = 2.0
_SAME = 1e-9


@dataclass(frozen=True)
class Undetermined:
    """Parameters that the motion shows only together.

    Attributes
    ----------
    names : tuple of str
        All of them.
    held : str
        The one that is held at its value, so that the others have one.
    value : float
        That value.
    unit : str
        Its unit.
    ratios : bool
        Whether one factor for all of them changes nothing, so that their ratios are known.
    """

    names: tuple[str, ...]
    held: str
    value: float
    unit: str
    ratios: bool

    @property
    def text(self) -> str:
        """What the data cannot tell, which parameters form it, and what to do."""
        listed = f"{', '.join(name for name in self.names if name != self.held)} and {self.held}"
        what, which = f"this data cannot tell {listed} apart", self.held
        if self.ratios:
            what = f"only the ratios of {listed} can be told, any common factor gives the same motion"
            which += " from the data sheet"
        return (
            f"{what}: fix one of them in the model, e.g. {which}; here it is held at {self.value:.6g} {self.unit}, and"
            " the others are those that go with it"
        )

    def fixed(self, model: Model) -> Model:
        """The model with the held parameter known."""
        return model.with_free(name for name in model.free if name != self.held)

    def of_all(self, model: Model, fitted: FitResult) -> FitResult:
        """A fit of the fixed model as one of the whole model: what the data tell only together has no error.

        Parameters
        ----------
        model : Model
            Before the parameter was fixed.
        fitted : FitResult
            Fit of the fixed model.

        Returns
        -------
        FitResult
            With NaN for the standard errors of what cannot be told, and the ratios that can.
        """
        names = model.free
        place = [names.index(name) for name in fitted.names]
        values = np.array([self.value if name == self.held else np.nan for name in names])
        values[place] = fitted.values
        covariance = np.full((len(names), len(names)), np.nan)
        covariance[np.ix_(place, place)] = fitted.covariance
        members = [i for i, name in enumerate(names) if name in self.names]
        covariance[members, :] = covariance[:, members] = np.nan
        ratios = tuple(
            Ratio(f"{name} / {self.held}", value / self.value, error / self.value, _quotient(unit, self.unit))
            for name, value, error in zip(fitted.names, fitted.values, fitted.stderr, strict=True)
            if self.ratios and name in self.names and np.isfinite(error)
            for unit in [model.parameter(name).unit]
        )
        told = fitted.model.with_free(names)
        parameters = tuple(replace(p, stderr=None) if p.name in self.names else p for p in told.parameters)
        return replace(
            fitted,
            model=replace(told, parameters=parameters),
            names=tuple(names),
            values=values,
            stderr=np.sqrt(np.diag(covariance)),
            covariance=covariance,
            warnings=(self.text, *fitted.warnings),
            ratios=(*ratios, *fitted.ratios),
        )


def common_scale(engine: Engine, data: list[Data]) -> Undetermined | None:
    """Find the forces of which only the ratios can be told.

    Parameters
    ----------
    engine : Engine
        Compiled model, at its starting values.
    data : list of Data
        Records, whose command moves the model.

    Returns
    -------
    Undetermined or None
        None where some force is known.
    """
    model = engine.model
    forces = _forces(model)
    names = tuple(name for name in model.free if name in forces)
    inertias = [f"{body}.inertia" for body in model.bodies]
    if not {"drive.gain", *inertias} <= set(names) or not _same_motion(engine, data, names):
        return None
    held = model.parameter(inertias[0])
    return Undetermined(names, held.name, held.value, held.unit, ratios=True)


def effect_scales(model: Model, records: Sequence[Record]) -> list[Undetermined]:
    """Find the effects of which only ratios can be told, one of their parameters being held at its default.

    A supply voltage is one: in what units it and the back-EMF are, only the winding's resistance says.

    Parameters
    ----------
    model : Model
        Fitted to the records.
    records : sequence of Record
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
        # What does nothing by itself is no part of a ratio.
        if _same_motion(engine, data, (*names, *held)) and not _same_motion(engine, data, held):
            known = model.parameter(held[0])
            found.append(Undetermined((*names, known.name), known.name, known.value, known.unit, ratios=True))
    return found


def _same_motion(engine: Engine, data: list[Data], names: Sequence[str]) -> bool:
    """Whether one factor for all these free parameters leaves the motion as it is."""
    theta = engine.model.theta
    scaled = np.array([_FACTOR if name in names else 1.0 for name in engine.model.free]) * theta
    rule = SimulationCriterion(engine, data)
    start = rule.nuisance()[0]
    for record in range(len(data)):
        one, two = rule.simulated(theta, start, record), rule.simulated(scaled, start, record)
        # A start that does not stay finite is judged by what there is before.
        told = np.isfinite(one) & np.isfinite(two)
        if not np.any(told) or np.max(np.abs(one - two)[told]) > _SAME * np.ptp(one[told]):
            return False
    return True


def exactly_tied(model: Model, jacobian: Array) -> Undetermined | None:
    """Find parameters that nothing but rounding tells apart where a search has ended.

    Parameters
    ----------
    model : Model
    jacobian : array, shape (n, k + m)
        Slopes of the errors, parameters first.

    Returns
    -------
    Undetermined or None
        The last of them is held: what was added to a model comes last.
    """
    tied, _ = ties(jacobian.T @ jacobian, len(model.free))
    for tie in tied:
        if tie.exact:
            names = tuple(model.free[i] for i in tie.members)
            held = model.parameter(names[-1])
            return Undetermined(names, held.name, held.value, held.unit, ratios=False)
    return None


def _forces(model: Model) -> set[str]:
    """Parameters that are forces, or forces per command or per motion."""
    found = {"drive.gain"}
    found |= {f"{body}.{own}" for body in model.bodies for own in BODY_PARAMETERS}
    found |= {f"{coupling}.{own}" for coupling in model.couplings for own in COUPLING_PARAMETERS}
    for active in model.effects:
        found |= {f"{active.name}.{p.name}" for p in active.effect.parameters if p.unit.startswith("{force}")}
    return found


def _quotient(unit: str, below: str) -> str:
    return f"{unit} / ({below})"
