"""A model in another tool's format: the text, and what it leaves out."""

from __future__ import annotations

import re
from dataclasses import dataclass


@dataclass(frozen=True)
class Exported:
    """A file for another tool.

    Attributes
    ----------
    format : str
        Name of the format.
    file_name : str
        What to call the file.
    text : str
        Its content.
    left_out : tuple of str
        What of the model the format cannot carry, a line each; the file has them as comments.
    """

    format: str
    file_name: str
    text: str
    left_out: tuple[str, ...]


def file_name(model_name: str, suffix: str) -> str:
    """Name of a file for a model, whatever characters the model's name has."""
    return re.sub(r"[^\w-]+", "_", model_name).strip("_")[:100] + suffix
