"""What of a model a format cannot carry, in one line each."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from idloop.physics.model import ActiveEffect, Model
from idloop.physics.parameter import Parameter


def parameters_of(model: Model, active: ActiveEffect) -> dict[str, Parameter]:
    """Parameters of an effect of the model, by their names in the effect."""
    start = f"{active.name}."
    return {p.name.removeprefix(start): p for p in model.parameters if p.name.startswith(start)}


def values_of(model: Model, active: ActiveEffect) -> dict[str, float]:
    """Values of an effect of the model, by their names in the effect."""
    return {name: parameter.value for name, parameter in parameters_of(model, active).items()}


def acts(model: Model, active: ActiveEffect) -> bool:
    """Whether the effect does anything: its first parameter is not at the neutral value."""
    specs = active.effect.parameters
    return not specs or values_of(model, active)[specs[0].name] != specs[0].neutral


def effects_left_out(
    model: Model, carried: Collection[str] = (), partly: Mapping[str, str] | None = None
) -> tuple[str, ...]:
    """Lines for the effects that a format has no place for.

    Parameters
    ----------
    model : Model
    carried : collection of str
        Names of the effects that it carries whole, such as ``coulomb_friction@motor``.
    partly : mapping, optional
        Name of an effect that it carries in part, to what is lost of it.
    """
    lines = []
    for active in model.effects:
        if active.name in carried or not acts(model, active):
            continue
        numbers = ", ".join(f"{name} {quantity(p)}" for name, p in parameters_of(model, active).items())
        lost = (partly or {}).get(active.name, active.effect.text)
        lines.append(f"{active.name} ({numbers}): {lost}")
    return tuple(lines)


def quantity(parameter: Parameter) -> str:
    """Value of a parameter with its unit."""
    return f"{parameter.value:.6g} {'' if parameter.unit == '-' else parameter.unit}".strip()


def statistics_left_out(model: Model, *, intervals: bool = False) -> tuple[str, ...]:
    """Lines for what a fit found beside the values; with `intervals` the format has those of the parameters."""
    known = [] if intervals else [p.name for p in model.parameters if p.stderr is not None]
    lines = [f"standard errors of {', '.join(known)}: format json has them"] if known else []
    if model.disturbance is not None:
        lines.append(f"disturbance force: random walk of intensity {model.disturbance:.6g} {model.units.force}²/s")
    return tuple(lines)


def controller_left_out(model: Model) -> tuple[str, ...]:
    """Line for the controller, where a format has no place for one."""
    if model.controller is None:
        return ()
    return (f"controller of type {model.controller.get('type')}: --format ros2_control or json",)


def comment_lines(model: Model, what: str, notes: Collection[str], left_out: Collection[str]) -> list[str]:
    """Head of a file: what it is, how to read it, and what it leaves out."""
    head = [f"{what} of the model {model.name}, written by idloop export.", *notes]
    lost = (
        ["Not carried by this format:", *(f"- {line}" for line in left_out)] if left_out else ["Nothing is left out."]
    )
    return [" ".join(line.split()) for line in (*head, *lost)]
