"""A model's equations in LaTeX and, for a browser that sets them by itself, in MathML."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import TYPE_CHECKING

from idloop.physics.effect import BODY, COUPLING, INPUT, OUTPUT, EffectEquation
from idloop.physics.schema import COUPLING_PARAMETERS

if TYPE_CHECKING:
    from idloop.physics import Model
    from idloop.physics.model import ActiveEffect, OutputSignal

# Position, velocity, force and inertia of an axis by the unit of its position.
_LETTERS = {
    "rad": (r"\theta", r"\omega", "T", "J"),
    "m": ("x", "v", "F", "m"),
}
# A term whose factor is a symbol less itself: one parameter stands for another one.
_CANCELLED = re.compile(r" \+ \(([^()]+) - \1\)\\,e\^\{[^{}]*\}")
_OTHER_LETTERS = ("q", r"\dot{q}", "F", "m")


@dataclass(frozen=True)
class Equation:
    """One line."""

    latex: str
    about: str  # what it says, in a few words
    effect: str = ""  # ``effect@site`` that it belongs to; empty for the linear part


@dataclass
class _Writer:
    """Collects lines and symbols of one model."""

    model: Model
    newest: str = ""
    lines: list[Equation] = field(default_factory=list)
    symbols: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.q, self.v, self.force, self.inertia = _LETTERS.get(self.model.units.position, _OTHER_LETTERS)

    def of(self, letter: str, site: str) -> str:
        """A letter with its body or coupling as index; without one where there is only one body."""
        if len(self.model.bodies) == 1:
            return letter
        return rf"{letter}_{{\text{{{plain_words(site)}}}}}"

    def filled(self, text: str, site: str = "", *, body: str = "", signal: str = "") -> str:
        """Put the letters of the axis in place of the marks."""
        q, v = (self.of(letter, body) if body else letter for letter in (self.q, self.v))
        known = {"@q": q, "@v": v, "@F": self.force, "@u": signal, "@y": signal}
        for mark, letter in known.items():
            text = text.replace(mark, letter)
        index = rf"\text{{, {plain_words(body)}}}" if body and len(self.model.bodies) > 1 else ""
        return text.replace("@s", rf"\text{{{plain_words(site)}}}").replace("@i", index)

    def equation_of(self, active: ActiveEffect, kind: str) -> EffectEquation:
        """The effect's own, or a function of what the effect depends on."""
        known = active.effect.equation
        if known is not None:
            text, lacking = known.text, []
            for spec in active.effect.parameters:
                symbol = known.symbols.get(spec.name)
                if symbol is not None and f"{active.name}.{spec.name}" not in self.model.values:
                    if spec.optional:
                        text = text.replace(symbol, known.symbols[spec.optional])
                    else:
                        lacking.append(symbol)
            kept = (part for part in _summands(_CANCELLED.sub("", text)) if not any(s in part for s in lacking))
            return replace(known, text="".join(kept))
        name = rf"\text{{{plain_words(active.effect.name)}}}"
        symbols = {spec.name: rf"p_{{\text{{{plain_words(spec.name)}}}}}" for spec in active.effect.parameters}
        letter, of = {
            BODY: ("@F", "@q, @v"),
            COUPLING: ("@F", r"\Delta @q"),
            INPUT: ("u", "@u"),
            OUTPUT: ("y", "@y"),
        }[kind]
        force = rf"{letter}_{{{name}}}"
        return EffectEquation(f"+{force}" if kind in {BODY, COUPLING} else force, rf"{force} = f({of})", symbols)

    def keep_symbols(self, active: ActiveEffect, equation: EffectEquation) -> None:
        """Remember the symbol of each parameter."""
        body = active.at if active.at in self.model.bodies else ""
        for name, symbol in equation.symbols.items():
            self.symbols[f"{active.name}.{name}"] = self.filled(symbol, body=body)

    def term(self, active: ActiveEffect, equation: EffectEquation, site: str = "", body: str = "") -> str:
        """What an effect adds to a balance, marked where it is the newest."""
        text = self.filled(equation.term, site, body=body)
        return rf" \class{{new}}{{{text}}}" if active.name == self.newest else f" {text}"

    def effects(self, kind: str, at: str) -> list[ActiveEffect]:
        """What acts at a site, in the order in which it acts."""
        acting = (one for one in self.model.effects if one.at == at)
        return sorted(acting, key=lambda one: (one.effect.final, one.effect.order))


def plain_words(name: str) -> str:
    """A user's name without the characters that mean something in LaTeX."""
    return re.sub(r"[^\w.\- ]|_", " ", name)


def equations(model: Model, newest: str = "") -> tuple[list[Equation], dict[str, str]]:
    """Write a model's equations; the term of the effect `newest` in a balance is marked, of the class ``new``.

    Returns: balance of every body, couplings, what happens to the command and to the readings; and the symbol of each
    parameter, by its name.
    """
    writer = _Writer(model, newest)
    acting = _command(writer)
    for index, body in enumerate(model.bodies):
        _balance(writer, index, body, acting)
    for coupling, (first, second) in zip(
        model.couplings, zip(model.bodies[:-1], model.bodies[1:], strict=True), strict=True
    ):
        stiffness, damping = (rf"{x}_{{\text{{{plain_words(coupling)}}}}}" for x in ("k", "c"))
        writer.symbols |= {f"{coupling}.stiffness": stiffness, f"{coupling}.damping": damping}
        twist = f"Δ{{}} = {first} − {second}".format(_named(writer.q).partition(" ")[0])
        _coupling(writer, coupling, f"{coupling}: what passes, {twist}")
    for coupling, active in model.inner_couplings.items():
        if writer.effects(COUPLING, coupling):
            for own in COUPLING_PARAMETERS:
                writer.symbols[f"{coupling}.{own}"] = writer.symbols[f"{active.name}.{own}"]
            _coupling(writer, coupling, f"{coupling}: what passes", body=active.at)
    for output in model.outputs:
        _reading(writer, output)
    return writer.lines, {name: symbol for name, symbol in writer.symbols.items() if name in model.values}


def _command(writer: _Writer) -> str:
    """What of the command acts; its effects one after the other."""
    signal = "u"
    loop = [] if writer.model.loop is None else [writer.model.loop]
    for active in (*loop, *writer.effects(INPUT, "input")):
        equation = writer.equation_of(active, INPUT)
        body = writer.model.bodies[0]
        writer.lines.append(Equation(writer.filled(equation.text, body=body, signal=signal), "command", active.name))
        writer.keep_symbols(active, equation)
        signal = equation.term
    return signal


def _balance(writer: _Writer, index: int, body: str, acting: str) -> None:
    model = writer.model
    inertia, drag = writer.of(writer.inertia, body), writer.of("B", body)
    place, speed = writer.of(writer.q, body), writer.of(writer.v, body)
    writer.symbols |= {f"{body}.inertia": inertia, f"{body}.viscous_friction": drag, "drive.gain": "K"}
    terms = _between(writer, model.couplings[index - 1]) if index else rf"K\,{acting}"
    if index < len(model.couplings):
        terms += f" - {_between(writer, model.couplings[index])}"
    terms += rf" - {drag}\,{speed}"
    definitions = []
    for active in writer.effects(BODY, body):
        equation = writer.equation_of(active, BODY)
        terms += writer.term(active, equation, body=body)
        if equation.text:
            definitions.append(Equation(writer.filled(equation.text, body=body), "force", active.name))
        writer.keep_symbols(active, equation)
    left = rf"{inertia}\,\frac{{d{speed}}}{{dt}}"
    about = f"{body}: balance of forces, {_named(place)}" + ("" if index else ", u the command")
    writer.lines.append(Equation(f"{left} = {terms}", about))
    writer.lines += definitions


def _named(place: str) -> str:
    return {r"\theta": "θ the angle", "x": "x the position"}.get(place.partition("_")[0], "q the position")


def _between(writer: _Writer, coupling: str) -> str:
    return rf"{writer.force}_{{\text{{{plain_words(coupling)}}}}}"


def _coupling(writer: _Writer, coupling: str, about: str, body: str = "") -> None:
    stiffness, damping = (writer.symbols[f"{coupling}.{own}"] for own in COUPLING_PARAMETERS)
    twist, rate = (writer.filled(rf"\Delta {x}", body=body) for x in ("@q", "@v"))
    plain = rf"{stiffness}\,{twist} + {damping}\,{rate}"
    right, definitions = plain, []
    for active in writer.effects(COUPLING, coupling):
        equation = writer.equation_of(active, COUPLING)
        right += writer.term(active, equation, coupling) if equation.term else ""
        if equation.text:
            text = equation.text.replace("k_{@s}", stiffness).replace("c_{@s}", damping)
            definitions.append(Equation(writer.filled(text, coupling), about, active.name))
        writer.keep_symbols(active, equation)
    # What one effect says of the whole, the plain coupling would contradict.
    if right != plain or len(definitions) != 1:
        writer.lines.append(Equation(f"{_between(writer, coupling)} = {right}", about))
    writer.lines += definitions


def _reading(writer: _Writer, output: OutputSignal) -> None:
    letter = writer.of(writer.q if output.field == "position" else writer.v, output.body)
    factor = "" if output.scale == 1.0 else rf"{output.scale:.6g}\,"
    signal, noise = factor + letter, " + e"
    site = output.site
    for active in writer.effects(OUTPUT, site):
        if active.effect.final and noise:
            # What the converter rounds has its noise already.
            signal, noise = rf"({signal} + e)", ""
        equation = writer.equation_of(active, OUTPUT)
        text = writer.filled(equation.text, site, body=output.body, signal=signal)
        writer.lines.append(Equation(text, f"reading {output.name}", active.name))
        writer.keep_symbols(active, equation)
        signal = equation.term
    reading = rf"y_{{\text{{{plain_words(output.name)}}}}} = {signal}{noise}"
    writer.lines.append(Equation(reading, f"reading {output.name}, noise e"))


@lru_cache(maxsize=512)
def to_mathml(latex: str, *, block: bool = False) -> str:
    """Turn a line of LaTeX, without dollar signs, into a ``<math>`` element.

    `block`: one element for each summand, in a ``<span>``: a browser breaks no line within an element.
    """
    from latex2mathml.converter import convert

    if not block:
        return str(convert(latex, display="inline"))
    first, *rest = (str(convert(one, display="block")) for one in _summands(latex))
    return "".join(["<span>", first, *(one.replace("<mo>", '<mo form="infix">', 1) for one in rest), "</span>"])


def _summands(latex: str) -> list[str]:
    """Cut a line of LaTeX before the signs, and the words after a comma, that stand in no bracket."""
    parts, depth = [""], 0
    for place, part in enumerate(
        re.split(r"((?<!=) (?=[+-]|\\class)|(?=\\text\{, )|\\left.|\\right.|\\.|[{}()])", latex)
    ):
        depth += part in ("{", "(") or part.startswith(r"\left")
        depth -= part in ("}", ")") or part.startswith(r"\right")
        if place % 2 and part in ("", " ") and not depth:
            parts.append("")
        parts[-1] += part
    return parts
