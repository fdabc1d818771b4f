"""Places where nothing can be written: full, read-only, or closed for new files."""

from __future__ import annotations

import contextlib
import resource
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

ROOM = 64 * 2**20  # of the small file system [bytes]: nothing fills it by itself in time


def _done(*words: str) -> bool:
    try:
        return subprocess.run(words, capture_output=True, check=False).returncode == 0
    except OSError:
        return False


@contextlib.contextmanager
def soon_full(folder: Path) -> Iterator[tuple[Path, Callable[[int, int], None]]]:
    """A place, and what fills it up for a process whose file there has so many bytes.

    A file system of its own where that is permitted, otherwise a limit on the size of the files of the process.
    """
    folder.mkdir()
    if _done("mount", "-t", "tmpfs", "-o", f"size={ROOM}", "tmpfs", str(folder)):
        try:
            yield folder, lambda _process, _size: _fill(folder / "filler")
        finally:
            _done("umount", "-l", str(folder))
    else:
        yield folder, _limit


def _limit(process: int, size: int) -> None:
    resource.prlimit(process, resource.RLIMIT_FSIZE, (size, size))


def _fill(file: Path) -> None:
    with contextlib.suppress(OSError), file.open("wb", buffering=0) as filler:
        for size in (2**20, 2**12):
            with contextlib.suppress(OSError):
                while filler.write(bytes(size)):
                    pass


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
