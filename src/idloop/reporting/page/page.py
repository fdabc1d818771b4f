"""The report as one HTML page that loads nothing: words, figures and the browser code that draws them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from idloop.reporting.page.equations import equations, to_mathml
from idloop.reporting.page.page_figures import page_figures
from idloop.reporting.page.page_words import page_words
from idloop.reporting.page.sheet import TEMPLATES, render_sheet
from idloop.reporting.terms import effect_words

if TYPE_CHECKING:
    from idloop.reporting.page.contents import Contents


def render_page(contents: Contents) -> str:
    """Write the page.

    Returns: HTML. It loads nothing, and its own policy forbids the browser to.
    """
    from markupsafe import Markup

    lines, symbols = equations(contents.ladder.model)
    # Markup: MathML of our own.
    return render_sheet(
        TEMPLATES / "report.html",
        page_figures(contents),
        name=contents.ladder.model.name,
        equations=[
            (Markup(to_mathml(line.latex, block=True)), line.about, effect_words(line.effect))  # noqa: S704
            for line in lines
        ],
        symbols={name: Markup(to_mathml(symbol)) for name, symbol in symbols.items()},  # noqa: S704
        **page_words(contents),
    )
