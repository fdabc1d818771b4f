"""Effects as a reader calls them."""

from __future__ import annotations

import re

# Effects that bear the name of someone.
_PEOPLE = ("coulomb", "stribeck")


def words(effect: str) -> str:
    """Write ``coulomb_friction@axis`` as "Coulomb friction @ axis"."""
    name, at, site = effect.partition("@")
    name = " ".join(part.capitalize() if part in _PEOPLE else part for part in name.split("_"))
    return f"{name} @ {site}" if at else name


def in_words(text: str) -> str:
    """Write every ``effect@site`` of a sentence in words."""
    return re.sub(r"\b[a-z]\w*(?:#\d+)?@[\w\[\]]+", lambda found: words(found[0]), text)
