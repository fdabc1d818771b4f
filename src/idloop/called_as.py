"""How the user calls the program, so that commands that are printed can be run as they stand."""

from __future__ import annotations

import shlex
import shutil
import sys
from pathlib import Path

_NAME = "idloop"


def program() -> str:
    """Return the word that runs the program in the shell of the user.

    It is ``idloop`` where the shell finds this program by that name, or where it was not called as a program; else the
    path by which it was called, as in ``.venv/bin/idloop``.
    """
    called = sys.argv[0] if sys.argv else _NAME
    if not called.endswith(f"/{_NAME}") or not Path(called).is_file():
        return _NAME
    found = shutil.which(_NAME)
    return _NAME if found and Path(found).samefile(called) else shlex.quote(called)
