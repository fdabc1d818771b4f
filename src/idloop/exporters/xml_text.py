"""XML elements as the text of a file with comments in front."""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree import ElementTree as ET


def xml_text(root: ET.Element, comments: Sequence[str]) -> str:
    """Return an indented XML document whose first lines inside the root are comments.

    Parameters
    ----------
    root : Element
    comments : sequence of str
        One comment each; two hyphens in a row, which XML forbids there, are set apart.
    """
    for place, line in enumerate(comments):
        safe = line
        while "--" in safe:
            safe = safe.replace("--", "- -")
        root.insert(place, ET.Comment(f" {safe} "))
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"
