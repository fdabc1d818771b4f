"""Effects written as text, on the command line and in node parameters."""

from __future__ import annotations

import re

from idloop.errors import InputError

EFFECT_TEXT = re.compile(r"^\s*(\w+)\s*@\s*([^()\s]+)\s*(?:\((.*)\))?\s*$")


def parse_effect(text: str) -> tuple[str, str, dict[str, float]]:
    """Read an effect written as ``NAME@SITE`` or ``NAME@SITE(parameter=value, ...)``.

    Raises InputError: the text does not have this form.
    """
    match = EFFECT_TEXT.match(text)
    form = f"effect '{text}': write NAME@SITE or NAME@SITE(parameter=value, ...), such as dead_zone@input(width=0.1)"
    if match is None:
        raise InputError(form)
    name, at, inside = match.groups()
    values: dict[str, float] = {}
    for part in (inside or "").split(","):
        if not part.strip():
            continue
        key, equals, number = part.partition("=")
        if not equals:
            raise InputError(form)
        try:
            values[key.strip()] = float(number)
        except ValueError as error:
            raise InputError(f"effect '{text}': {key.strip()} = {number.strip()} is no number") from error
    return name, at, values
