"""Equations that a browser sets by itself: MathML from LaTeX, no script and no network needed."""

from __future__ import annotations

from functools import lru_cache


@lru_cache(maxsize=512)
def to_mathml(latex: str, *, block: bool = False) -> str:
    """Turn an equation into MathML.

    Parameters
    ----------
    latex : str
        One line, without dollar signs.
    block : bool
        On a line of its own instead of within one.

    Returns
    -------
    str
        A ``<math>`` element.
    """
    from latex2mathml.converter import convert

    return str(convert(latex, display="block" if block else "inline"))
