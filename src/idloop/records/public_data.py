"""Where the public data sets lie on this machine; the project ships none of them."""

from __future__ import annotations

import os
from pathlib import Path

VARIABLE = "IDLOOP_DATA"
DEFAULT = Path(__file__).resolve().parents[4] / "shared" / "data"


def public_data(name: str) -> Path | None:
    """Folder of a public data set in ``IDLOOP_DATA`` or in ``../shared/data`` beside the checkout; None without."""
    folder = Path(os.environ.get(VARIABLE) or DEFAULT) / name
    return folder if folder.is_dir() else None
