"""The two ways in which idloop tells its user that something went wrong."""

from __future__ import annotations


class IdloopError(Exception):
    """The work was understood but could not be done (exit code 1)."""


class InputError(IdloopError):
    """Wrong use or bad input: one line that says what, where and how to mend it (exit code 2)."""
