"""Effects as the command line takes them: words of users and names without a site are answered with what to write."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from idloop.errors import InputError
from idloop.spelling import listed

if TYPE_CHECKING:
    from idloop.physics import Model

_MOST = 6  # that are listed


def effect_text(text: str, model: Model) -> str:
    """Return an effect as `Model.with_effects` takes it, with `dead zone` written as `dead_zone`.

    `text`: ``NAME@SITE`` or ``NAME@SITE(parameter=value, ...)``.
    `model`: has the sites.
    Raises InputError: there is no site; the message has those of the model where the effect acts.
    """
    name, at, rest = text.partition("@")
    name = re.sub(r"[\s\-]+", "_", name.strip())
    if at:
        return f"{name}@{rest}"
    from idloop.physics.effect import catalogue, unknown_effect

    known = catalogue()
    word = name.partition("(")[0].lower()
    meant = [word] if word in known else [one for one, several in known.items() if word in several[0].also_called]
    if not meant:
        raise unknown_effect(word, known)
    places = [f"{one}@{site}" for one in meant for effect in known[one] for site in model.sites(effect.site)]
    if not places:
        raise InputError(f"--effect {text}: model {model.name} has no site at which {' or '.join(meant)} acts")
    raise InputError(f"--effect {text}: give the site as well: {listed(places, _MOST)}")
