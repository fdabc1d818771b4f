"""Words that a reader meets everywhere: names of effects, what data served for, p-values, sentences."""

from __future__ import annotations

import re

# What data served for; the keys are those that the errors of a ladder's steps and the JSON documents have.
FITTED, UNSEEN = "fitted", "unseen"
DATA_USE = {"train": FITTED, "validation": UNSEEN}

# Effects that bear the name of someone.
_PEOPLE = ("coulomb", "stribeck")
_ORDINALS = {"1": "first", "2": "second", "3": "third"}
# Space between a number and its unit.
_UNIT = re.compile(r"(?<=[\d)⁰¹²³⁴⁵⁶⁷⁸⁹]) (?=(?:%|°|·|µ?s|ms|k?Hz|rad|mm?|kg|N|V|A|W|K|J|Ω|1/s)(?!\w))")
_P_VALUE = re.compile(r"\bp (=|<) (?=\d)")


def effect_words(effect: str) -> str:
    """Write ``coulomb_friction@axis`` as "Coulomb friction @ axis", ``cogging#2@axis`` as "second cogging @ axis"."""
    kind, at, site = effect.partition("@")
    kind, _, number = kind.partition("#")
    name = " ".join(part.capitalize() if part in _PEOPLE else part for part in kind.split("_"))
    name = f"{_ORDINALS.get(number, f'{number}th')} {name}" if number else name
    return f"{name} @ {site}" if at else name


def in_words(text: str) -> str:
    """Write every ``effect@site`` of a sentence in words."""
    return re.sub(r"\b[a-z]\w*(?:#\d+)?@[\w\[\]]+", lambda found: effect_words(found[0]), text)


def capitalised(text: str) -> str:
    """A text with a capital at its beginning."""
    return text[:1].upper() + text[1:]


def unbroken(text: str) -> str:
    """A text in which a number stays on one line with its unit and its interval, and a p-value with its sign."""
    joined = _P_VALUE.sub("p\u00a0\\1\u00a0", text.replace(" ± ", "\u00a0±\u00a0").replace(" · 10", "\u00a0·\u00a010"))
    return _UNIT.sub("\u00a0", joined)


def sentence(text: str) -> str:
    """A text with a capital and a full stop; empty where it is."""
    return f"{capitalised(text)}." if text else ""
