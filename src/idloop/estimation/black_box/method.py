"""A black-box method: what one chooses of it, what it is for, and what it gives."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

if TYPE_CHECKING:
    from idloop.estimation.linear import LinearModel
    from idloop.estimation.networks import NarxModel
    from idloop.estimation.nonparametric import FrequencyResponse, ImpulseResponse
    from idloop.estimation.recursive import CoefficientHistory

    Result: TypeAlias = LinearModel | NarxModel | FrequencyResponse | ImpulseResponse

Kind = Literal["response", "linear", "recursive", "network"]
Numbers = int | tuple[int, ...] | Literal["auto"]


@dataclass(frozen=True)
class Choices:
    """What a user chooses; each method reads what it `needs`."""

    # int, tuple of int or "auto": number of states, or degree of every polynomial; of several the one with the least
    # BIC (`Method.selects`)
    order: Numbers = "auto"
    delay: Numbers = 1  # int, tuple of int or "auto": lag of the first coefficient of B [samples]
    # Degrees that differ from `order`, by ``na``, ``nb``, ``nc``, ``nd``, ``nf``
    structure: Mapping[str, int] = field(default_factory=dict)
    horizon: int | None = None  # of subspace methods [samples]
    window: int | None = None  # lag window, segment, or largest lag of a response [samples]
    period: float | None = None  # of a periodic excitation [s]
    units: int | None = None  # of a network
    focus: Literal["prediction", "simulation"] = "prediction"
    # Frequencies that a fit is weighed towards [Hz]; 0 and infinity leave a side open
    band: tuple[float, float] | None = None
    stable: bool = False  # reflect poles into the unit circle
    integrates: bool | None = None  # put the pole nearest 1 there; by default n4sid, moesp and cva let the data decide
    closed_loop: bool = False  # go by way of the reference where a method can
    controller: Mapping[str, Any] | None = None  # ``controller:`` section of a model file
    seed: int = 0  # of networks


@dataclass(frozen=True)
class Trial:
    """One order and delay that were tried."""

    order: int | Literal["auto"]
    delay: int
    bic: float = float("nan")
    error: str = ""  # why there is no model; empty where there is one


@dataclass(frozen=True, eq=False)
class Identified:
    """What a method found."""

    method: Method
    model: Result
    order: int | Literal["auto"] = "auto"  # that the method was given: number of states, or degree of the polynomials
    delay: int | None = None  # [samples]; None where the method has none
    trials: tuple[Trial, ...] = ()  # what was tried on the way to the order and the delay
    history: tuple[CoefficientHistory, ...] = ()  # of each output, from recursive methods

    @property
    def at_limit(self) -> bool:
        """Whether the order is the highest of several that were tried, so that a higher one might be better."""
        tried = {trial.order for trial in self.trials if isinstance(trial.order, int)}
        return len(tried) > 1 and self.order == max(tried)

    @property
    def predicts(self) -> bool:
        """Whether the result simulates and predicts; responses do not."""
        return self.method.kind != "response"

    @property
    def linear(self) -> LinearModel | None:
        """The result as a linear model, where it is one."""
        from idloop.estimation.linear import LinearModel

        return self.model if isinstance(self.model, LinearModel) else None

    def plot(self, axes: Any = None) -> Any:
        """Draw the result as it draws itself: Bode diagram, impulse response or training of a network."""
        return self.model.plot(axes)

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        return {
            "method": self.method.name,
            "kind": self.method.kind,
            "order": self.order,
            "order_at_limit": self.at_limit,
            "delay": self.delay,
            "trials": [vars(trial) for trial in self.trials],
            "model": self.model.to_dict(),
            "history": [one.to_dict() for one in self.history],
        }


@dataclass(frozen=True)
class Method:
    """A black-box method."""

    # `summary`: what it is for
    name: str
    kind: Kind  # "response", "linear", "recursive" or "network"
    summary: str
    loop: str  # which loop its theory allows: "open", "any", or "closed, controller known"
    source: str
    needs: tuple[str, ...]  # names of the `Choices` that it reads
    run: Callable[..., Any]  # ``run(data, choices, order, delay)`` to a result, or to a result and its history
    polynomials: tuple[str, ...] = ()  # degrees that `Choices.structure` may set
    automatic: tuple[int, ...] = ()  # orders tried for "auto"; empty where the method chooses itself
    # Errors whose BIC chooses between orders. Instrumental variables and output errors have no noise model: errors one
    # step ahead do not measure their quality.
    selects: Literal["prediction", "free run"] = "prediction"
