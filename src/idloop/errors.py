"""The errors that idloop raises for its user."""

from __future__ import annotations

# Most characters of a line, whatever it quotes.
LONGEST_LINE = 2_000


def one_line(text: str) -> str:
    """Return a text as one printable line of limited length, without line breaks and escape sequences."""
    if not text.isprintable():
        text = " ".join(text.split())
        text = "".join(c if c.isprintable() else c.encode("unicode_escape", "backslashreplace").decode() for c in text)
    return text if len(text) <= LONGEST_LINE else f"{text[: LONGEST_LINE // 2]} ... {text[-LONGEST_LINE // 3 :]}"


class IdloopError(Exception):
    """A valid task that failed (exit code 1).

    Parameters
    ----------
    what : str
        What is wrong, and where.
    cure : str
        What to do, where that depends on the verb: another one leaves it out.
    """

    def __init__(self, what: str, cure: str = "") -> None:
        super().__init__(f"{what}; {cure}" if cure else what)
        self.what = what

    def __str__(self) -> str:
        return one_line(super().__str__())


class InputError(IdloopError):
    """Wrong use or bad input: one line with the error, its place and the correction (exit code 2)."""
