"""Write the catalogue of effects as a page: ``python -m idloop.physics.document > docs/effects.md``."""

from __future__ import annotations

import re
import sys

from idloop.physics.effect import BODY, COUPLING, INPUT, OUTPUT, Effect, EffectParameter, catalogue

HEAD = """\
# The catalogue of effects

Written by `python -m idloop.physics.document` from the effect files in `src/idloop/physics/effects`.

An axis is a chain of bodies joined by couplings and driven at the first. Sites: `input`, a body's
name (`motor`), a coupling (`motor-load`), the coupling inside a body that `compliance` splits in two
(`motor-motor_far`), an output (`position[motor]`). Units in braces are those of the model: `{input}` of the command,
`{force}` N·m or N, `{position}` rad or m, `{output}` of the sensor. Add an effect in a model file
(`- {effect: dead_zone, at: input, width: {value: 0.1}}`), on the
command line (`--effect "dead_zone@input(width=0.1)"`) or on a running node (parameter `effects`). Effects
[of your own](how-to/own-effect.md) are Python files in a folder `effects` beside a model file, which run only
after `idloop trust`, or with `--trust-effects`.

In the equations q, v, F and J are position, velocity, force and inertia (θ, ω, T and J of a rotary axis, x, v, F and
m of a linear one), u is the command and y a reading. Discontinuities are not smoothed: the simulator finds the instants
at which dry friction stops or reverses a body, and at which the sides of a gap touch or separate.

Θ and U_s are a temperature and a supply voltage, [measured beside the axis](how-to/conditions.md). An effect that
depends on one of them is a candidate only in records that contain it; a simulation without it leaves the effect out.

"""
PLACES = {INPUT: "the command", BODY: "a body", COUPLING: "a coupling", OUTPUT: "a sensor"}

# What the equations of a site are part of. Raw, for they hold LaTeX.
RULES = {
    INPUT: r"""
The effects act in the order of this list, each on the u of the previous one. The drive's force on the first body is K u
of the last one, with the drive gain K. v is the velocity of the first body.
""",
    BODY: r"""
The forces of all effects at a body add up in its force balance, with the viscous friction B v of the body itself, the
drive and the couplings. $`F_{\text{f}}`$ is dry friction. At v = 0 it balances the other forces while these are within
the sum of the $`F_{\text{f}}`$ at v = 0 in their direction; beyond that the body breaks away. A negative sum of the
$`F_{\text{f}}`$ counts as zero.
""",
    COUPLING: r"""
A coupling from body a to body b has the twist Δq = q of a − q of b. The force F = k Δq + c Δv acts on b, and −F on a.
The equations are those of each effect alone; several act in the order of this list. The same effects act inside a body
that `compliance` splits, where k and c are its stiffness and damping.
""",
    OUTPUT: r"""
A reading y is first q or v of the sensor's body, times the `scale` of the output. The effects act in the order of this
list, each on the y of the previous one; the measurement noise is added before the quantisation. With a delay, the q of
a ripple is delayed with y.
""",
}


def _parameter(spec: EffectParameter) -> str:
    if spec.chosen:
        return f"`{spec.name}` [{spec.unit}], chosen, {spec.start:g} when not given"
    whole = ", whole number" if spec.integer else ""
    optional = f", that of {spec.optional} when not given" if spec.optional else ""
    return f"`{spec.name}` [{spec.unit}], neutral {spec.neutral:g}{whole}{optional}"


def _row(effect: Effect) -> str:
    parameters = "; ".join(_parameter(spec) for spec in effect.parameters) or "none"
    like = ", ".join(f"`{name}`" for name in effect.looks_like) or "–"
    return f"| `{effect.name}` | {effect.text} | {parameters} | {like} |"


def _place_in_chain(effect: Effect) -> tuple[bool, int, int, str]:
    """Sort key: the order in which the effects of a site act, whatever that in a model file."""
    rank = 0
    if effect.site == INPUT:
        rank = 0 if effect.delay else 1
    elif effect.site == OUTPUT:
        rank = 0 if effect.settle else 1 if effect.delay else 2
    return effect.final, rank, effect.order if effect.site != BODY else 0, effect.name


def _plain(latex: str) -> str:
    """Put plain letters in place of the marks."""
    for mark, letter in {"_{@s}": "", "@i": "", "@q": "q", "@v": "v", "@F": "F", "@u": "u", "@y": "y"}.items():
        latex = latex.replace(mark, letter)
    # GitHub refuses \operatorname.
    return re.sub(r"(?:\\,)?\\operatorname\{(\w+)\}", r"\\,\\mathrm{\1}\\,", latex)


def _equation(effect: Effect) -> str:
    """Return an effect's equation and the symbols in it; empty where it gives none."""
    equation = effect.equation
    if equation is None:
        return ""
    term, text = _plain(equation.term), _plain(equation.text)
    if effect.site == BODY and term:
        balance = rf"J\,\frac{{dv}}{{dt}} = \dots {term[:1]} {term[1:]}"
        text = rf"{balance}, \qquad {text}" if text else balance
    elif effect.site == COUPLING and term:
        text = rf"F = k\,\Delta q + c\,\Delta v {term[:1]} {term[1:]}"
    symbols = ", ".join(f"$`{_plain(symbol)}`$ is `{name}`" for name, symbol in equation.symbols.items())
    return f"`{effect.name}`\n\n```math\n{text}\n```\n\n" + (f"{symbols}\n\n" if symbols else "")


def page() -> str:
    """Return the page as Markdown."""
    lines = [HEAD]
    for site, words in PLACES.items():
        lines.append(f"## Effects at {words}\n\n")
        lines.append("| effect | what happens | parameters | looks like |\n|---|---|---|---|\n")
        effects = [effect for several in catalogue().values() for effect in several if effect.site == site]
        lines += [_row(effect) + "\n" for effect in sorted(effects, key=lambda effect: effect.name)]
        lines.append(f"\n### Equations at {words}\n{RULES[site]}\n")
        lines += [_equation(effect) for effect in sorted(effects, key=_place_in_chain)]
    return "".join(lines).rstrip("\n") + "\n"


if __name__ == "__main__":
    sys.stdout.write(page())
