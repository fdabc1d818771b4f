"""Effects as a reader calls them."""

from __future__ import annotations

# Effects that bear the name of someone.
_PEOPLE = ("coulomb", "stribeck")


def words(effect: str) -> str:
    """Write ``coulomb_friction@axis`` as "Coulomb friction @ axis".

    Parameters
    ----------
    effect : str

    Returns
    -------
    str
    """
    name, at, site = effect.partition("@")
    name = " ".join(part.capitalize() if part in _PEOPLE else part for part in name.split("_"))
    return f"{name} @ {site}" if at else name
