"""The peers' own environment: made once, and anew when peers.txt changes."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from pathlib import Path

from speed.progress import say

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / ".peers"
LIST = Path(__file__).with_name("peers.txt")


def peers_python(folder: Path = FOLDER, listed: Path = LIST) -> Path | None:
    """Interpreter of the peers' environment, made if need be; none where none can be made.

    Versions are those of `listed`; packages come from wherever pip is set up to load them. What cannot be installed
    is left out with a line, and the rows that need it say so.
    """
    python, stamp = folder / "bin" / "python", folder / ".made-of"
    wanted = hashlib.sha256(listed.read_bytes() + sys.version.encode()).hexdigest()
    if python.exists() and stamp.exists() and stamp.read_text() == wanted:
        return python
    say(f"making {folder.name}/ with the packages of {listed.name} (once, some minutes)")
    made = subprocess.run(
        [sys.executable, "-m", "venv", "--clear", str(folder)], capture_output=True, text=True, check=False
    )
    if made.returncode:
        say(f"no environment for the peers: {(made.stderr or made.stdout).strip().splitlines()[-1]}")
        return None
    names = [line for line in listed.read_text().splitlines() if line and not line.startswith("#")]
    if _install(python, names):
        stamp.write_text(wanted)
        return python
    # One that is not to be had must not take the others with it. Nothing is stamped, so that the next run tries again.
    for name in names:
        if not _install(python, [name]):
            say(f"not installed: {name}")
    return python


def _install(python: Path, names: list[str]) -> bool:
    command = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *names]
    return subprocess.run(command, capture_output=True, check=False).returncode == 0
