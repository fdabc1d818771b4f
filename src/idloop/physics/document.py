"""Write the catalogue of effects as a page: ``python -m idloop.physics.document > docs/effects.md``."""

from __future__ import annotations

import sys

from idloop.physics.effect import Effect, ParameterSpec, catalogue

HEAD = """\
# The catalogue of effects

Written by `python -m idloop.physics.document` from the effect files in `src/idloop/physics/effects`.

An axis is a chain of bodies joined by couplings and driven at the first. Sites: `input`, a body's
name (`motor`), a coupling (`motor-load`), an output (`position[motor]`). Units in braces are those of
the model: `{input}` of the command, `{force}` N·m or N, `{position}` rad or m, `{output}` of the
sensor. Add an effect in a model file (`- {effect: dead_zone, at: input, width: {value: 0.1}}`), on the
command line (`--effect "dead_zone@input(width=0.1)"`) or on a running node (parameter `effects`).

"""
PLACES = {"input": "the command", "body": "a body", "coupling": "a coupling", "output": "a sensor"}


def _parameter(spec: ParameterSpec) -> str:
    whole = ", whole number" if spec.integer else ""
    optional = f", that of {spec.optional} when not given" if spec.optional else ""
    return f"`{spec.name}` [{spec.unit}], neutral {spec.neutral:g}{whole}{optional}"


def _row(effect: Effect) -> str:
    parameters = "; ".join(_parameter(spec) for spec in effect.parameters) or "none"
    like = ", ".join(f"`{name}`" for name in effect.looks_like) or "–"
    return f"| `{effect.name}` | {effect.text} | {parameters} | {like} |"


def page() -> str:
    """Return the page as Markdown."""
    lines = [HEAD]
    for site, words in PLACES.items():
        lines.append(f"## Effects at {words}\n\n")
        lines.append("| effect | what happens | parameters | looks like |\n|---|---|---|---|\n")
        effects = [effect for several in catalogue().values() for effect in several if effect.site == site]
        lines += [_row(effect) + "\n" for effect in sorted(effects, key=lambda effect: effect.name)]
        lines.append("\n")
    return "".join(lines).rstrip("\n") + "\n"


if __name__ == "__main__":
    sys.stdout.write(page())
