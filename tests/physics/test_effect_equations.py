"""Effects without a memory: what their equation says is what their compiled function gives."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

import numpy as np
import pytest

from idloop.physics.effect import Effect, built_in

# Functions of the equations, and brackets that are one.
FUNCTIONS = {"sin": math.sin, "exp": math.exp, "abs": abs, "floor": math.floor, "min": min, "max": max,
             "tanh": math.tanh, "sign": lambda x: (x > 0) - (x < 0)}  # fmt: skip
WRITTEN = {
    r"\left|": "abs(", r"\right|": ")", r"\left\lfloor": "floor(", r"\right\rfloor": ")", r"\left": "", r"\right": "",
    r"\,": " ", r"\min": "min", r"\max": "max", r"\sin": "sin", r"\tanh": "tanh", "^": "**",
}  # fmt: skip

MEASURED = {"temperature": r"\Theta", "supply": "U_s"}


def value_of(latex: str, known: Mapping[str, float]) -> float:
    """What an equation's right-hand side gives, for numbers of its symbols."""
    latex = re.sub(r"\\operatorname\{sign\}\s*(\\Delta )?(@\w)", r" sign(\1\2)", latex)
    # Symbols first, for u_{\max} is none of the functions.
    names = sorted(known, key=len, reverse=True)
    whole = "|".join(("" if name[0] == "\\" else r"(?<![a-z\\])") + re.escape(name) + "(?![a-z])" for name in names)
    latex = re.sub(whole, lambda found: f" n{names.index(found[0])} ", latex)
    latex = re.sub(r"\\t?frac\{([^{}]*)\}\{([^{}]*)\}", r"((\1)/(\2))", latex)
    latex = re.sub(r"e\^\{([^{}]*)\}", r"exp(\1)", latex)
    for sign, meaning in WRITTEN.items():
        latex = latex.replace(sign, meaning)
    # What stands side by side is multiplied.
    words, before = [], ""
    for word in re.findall(r"n\d+|[a-z]+|\d+|\*\*|\S", latex):
        ends = before == ")" or re.fullmatch(r"n\d+|\d+", before)
        if ends and re.match(r"[a-z\d(]", word):
            words.append("*")
        words.append(word)
        before = word
    numbers = {f"n{place}": known[name] for place, name in enumerate(names)}
    return float(eval(" ".join(words), {"__builtins__": {}}, FUNCTIONS | numbers))


def numbers_for(effect: Effect, chance: np.random.Generator) -> list[float]:
    """Values of the parameters within their bounds."""
    found = []
    for spec in effect.parameters:
        low, high = max(spec.min, 0.0 if spec.min >= 0.0 else -3.0), min(spec.max, 3.0)
        number = chance.uniform(low, high)
        found.append(float(max(round(number), spec.min)) if spec.integer else number)
    return found


def sides(effect: Effect) -> tuple[str, str]:
    """Equation and term, without the words behind it."""
    assert effect.equation is not None
    return effect.equation.text.split(r"\text{, }")[0], effect.equation.term


PLAIN = [
    effect
    for several in built_in().values()
    for effect in several
    if not effect.settle and not effect.delay and not effect.splits
]


@pytest.mark.parametrize("effect", PLAIN, ids=lambda one: f"{one.name}@{one.site}")
def test_the_equation_is_what_is_computed(effect: Effect) -> None:
    chance = np.random.default_rng(1)
    text, term = sides(effect)
    for _ in range(200):
        parameters = numbers_for(effect, chance)
        q, v, u, y, k, c = (float(number) for number in chance.uniform(-3.0, 3.0, 6))
        known = {"@q": q, "@v": v, "@u": u, "@y": y, r"\Delta @q": q, r"\Delta @v": v, "k_{@s}": k, "c_{@s}": c,
                 r"\pi": math.pi}  # fmt: skip
        known |= dict(zip(effect.equation.symbols.values(), parameters, strict=True))
        arriving = abs(u)
        # Of an effect that depends on a measured condition, the first state is how far that is from its reference.
        measured, state = chance.uniform(0.1, 3.0), []
        if effect.condition:
            known |= {MEASURED[effect.condition]: measured}
            state = [measured - parameters[[spec.name for spec in effect.parameters].index(effect.reference)]]
        known[r"@F_{\text{in}}"] = u
        if effect.command:
            computed = effect.command(u, v, u, 0.0, state, parameters)
            written = value_of(text.partition(" = ")[2], known)
        elif effect.force:
            computed = effect.force(q, v, 1.0, 0.0, state, parameters)
            written = value_of(text.partition(" = ")[2], known) * -1.0 if text else value_of(term, known)
            assert not text or term.startswith("-")
        elif effect.friction:
            direction = math.copysign(1.0, v)
            computed = -direction * effect.friction(direction, abs(v), arriving, 0.0, state, parameters)
            assert term.startswith("-")
            written = -value_of(text.partition(" = ")[2], known)
        elif effect.coupling:
            bare = k * q + c * v
            computed = effect.coupling(bare, q, k, 0.0, state, parameters)
            gap, _, beyond = text.partition(r"\text{, else } ")
            if beyond:
                inside = gap.partition(r"\text{ while } ")[2].split(r" \le ")
                closed = value_of(inside[0], known) <= value_of(inside[1], known)
                written = 0.0 if closed else value_of(beyond, known)
            else:
                written = bare + value_of(term, known)
        else:
            computed = effect.reading(y, q, v, 0.0, state, parameters)
            written = value_of(text.partition(" = ")[2], known)
        assert computed == pytest.approx(written, rel=1e-9, abs=1e-12)
