"""Build steps of the site: equations become MathML, and notebooks become pages of the tutorial."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import jupytext
from latex2mathml.converter import convert
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).parents[2]
NOTEBOOKS = ROOT / "examples" / "notebooks"


def notebook_page(source: Path) -> str:
    """Return a notebook in percent format as Markdown, with a line that says where the notebook is."""
    notebook = jupytext.read(source)
    cells = [
        cell.source if cell.cell_type == "markdown" else f"```python\n{cell.source}\n```" for cell in notebook.cells
    ]
    title, _, rest = cells[0].partition("\n")
    origin = f"*This page is the notebook `{source.relative_to(ROOT)}`: `jupyter lab` opens it with jupytext.*"
    return "\n\n".join([title, origin, rest.strip(), *cells[1:]]) + "\n"


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add a page of the tutorial for each notebook."""
    for source in sorted(NOTEBOOKS.glob("*.py")):
        name = f"tutorial/{source.stem.replace('_', '-')}.md"
        files.append(File.generated(config, name, content=notebook_page(source)))
    return files


def on_page_markdown(markdown: str, page: Page, **_: Any) -> str:
    """Set equations as MathML, which every browser reads by itself."""
    markdown = re.sub(
        r"^```math\n(.*?)\n```$",
        lambda m: f"\n{convert(m[1], display='block')}\n",
        markdown,
        flags=re.DOTALL | re.MULTILINE,
    )
    return re.sub(r"\$`(.+?)`\$", lambda m: convert(m[1]), markdown)
