"""Places where nothing can be written: full, read-only, or closed for new files."""

from __future__ import annotations

import contextlib
import subprocess
from collections.abc import Iterator, Sequence
from pathlib import Path

FULL = 1_000_000  # bytes until a full disk is full


def _done(*words: str) -> bool:
    try:
        return subprocess.run(words, capture_output=True, check=False).returncode == 0
    except OSError:
        return False


@contextlib.contextmanager
def full(folder: Path) -> Iterator[tuple[Path, Sequence[str], str]]:
    """A place that is soon full: (place, words before the command, how it is done).

    A file system of its own where that is permitted, otherwise a limit on the size of a file.
    """
    folder.mkdir()
    if _done("mount", "-t", "tmpfs", "-o", f"size={FULL}", "tmpfs", str(folder)):
        try:
            yield folder, (), "a small file system"
        finally:
            _done("umount", "-l", str(folder))
    else:
        yield folder, ("prlimit", f"--fsize={FULL}"), "a limit on the size of a file"


@contextlib.contextmanager
def read_only(folder: Path) -> Iterator[Path | None]:
    """A place that cannot be written to, for root neither; None where that takes a right that we have not."""
    folder.mkdir()
    folder.chmod(0o500)
    if not _writable(folder):
        yield folder
    elif _done("mount", "-t", "tmpfs", "-o", "ro", "tmpfs", str(folder)):
        try:
            yield folder
        finally:
            _done("umount", "-l", str(folder))
    else:
        yield None
    folder.chmod(0o700)


def close_for_new_files(folder: Path) -> bool:
    """Let nobody make a file in a folder any more; False where that takes a right that we have not."""
    folder.chmod(0o500)
    return not _writable(folder) or (_done("chattr", "+i", str(folder)) and not _writable(folder))


def open_again(folder: Path) -> None:
    """Take that back."""
    _done("chattr", "-i", str(folder))
    folder.chmod(0o700)


def _writable(folder: Path) -> bool:
    probe = folder / "probe"
    try:
        probe.touch()
        probe.unlink()
    except OSError:
        return False
    return True
