"""Where a result comes from: the data with checksums, versions, seed and the commands that made it."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

from idloop import __version__

# What the numbers depend on.
LIBRARIES = ("numpy", "scipy", "numba")


def provenance(
    bags: Sequence[Path], validate: Sequence[Path], *, commands: Sequence[str] = (), seed: int | None = None
) -> dict[str, Any]:
    """Describe where a result comes from; no time of day, so that equal work gives equal files.

    `bags`, `validate`: recordings that were fitted, and those that were not.
    `commands`: command lines that made the result, in their order.
    Returns: ``commands``, ``seed``, ``versions``, and ``bags`` with ``path``, ``use``, ``bytes``, ``sha256``.
    """
    used = [(bag, "fitted") for bag in bags] + [(bag, "unseen") for bag in validate]
    return {
        "commands": list(commands),
        "seed": seed,
        "versions": versions(),
        "bags": [{"path": str(bag), "use": use, **checksum(bag)} for bag, use in used],
    }


def versions() -> dict[str, str]:
    """Version of idloop, of Python and of what the numbers depend on."""
    return {
        "idloop": __version__,
        "python": platform.python_version(),
        **{name: metadata.version(name) for name in LIBRARIES},
    }


def checksum(bag: Path) -> dict[str, Any]:
    """Size and SHA-256 of a recording; of a folder that of its files' names and contents, in order.

    Returns: ``bytes`` and ``sha256``; both None where the recording cannot be read.
    """
    digest, size = hashlib.sha256(), 0
    folder = bag.is_dir()
    try:
        for path in sorted(p for p in bag.rglob("*") if p.is_file()) if folder else [bag]:
            if folder:
                digest.update(f"{path.relative_to(bag).as_posix()}\n".encode())
            with path.open("rb") as file:
                while block := file.read(1 << 20):
                    digest.update(block)
                    size += len(block)
    except OSError:
        return {"bytes": None, "sha256": None}
    return {"bytes": size, "sha256": digest.hexdigest()}
