"""The two ways in which idloop tells its user that something went wrong."""

from __future__ import annotations

# Characters of a line: what was typed or read, and is quoted in it, may have a million.
LONGEST_LINE = 2_000


def one_line(text: str) -> str:
    """Return a text as one line that can be printed: no line breaks, no escape sequences, an end."""
    if not text.isprintable():
        text = " ".join(text.split())
        text = "".join(c if c.isprintable() else c.encode("unicode_escape", "backslashreplace").decode() for c in text)
    return text if len(text) <= LONGEST_LINE else f"{text[: LONGEST_LINE // 2]} ... {text[-LONGEST_LINE // 3 :]}"


class IdloopError(Exception):
    """The work was understood but could not be done (exit code 1)."""

    def __str__(self) -> str:
        return one_line(super().__str__())


class InputError(IdloopError):
    """Wrong use or bad input: one line that says what, where and how to mend it (exit code 2)."""
