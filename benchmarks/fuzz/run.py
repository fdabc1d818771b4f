"""Damaged inputs for every reader: no traceback, no hang, nothing written elsewhere, no pickle opened.

Each reader runs in a process of its own. With atheris (`pip install atheris`) the branches that an input reaches
guide the search; without it, inputs are damaged at random. What breaks a reader is kept, and tried again by naming it:

    python benchmarks/fuzz/run.py --inputs 100000
    python benchmarks/fuzz/run.py --only csv mat --keep findings
    python benchmarks/fuzz/run.py --only csv --again findings/csv-0123abcd
"""

from __future__ import annotations

import argparse
import atexit
import hashlib
import importlib.util
import json
import logging
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("NUMBA_DISABLE_JIT", "1")
sys.path.insert(0, str(Path(__file__).resolve().parent))

from readers import Reader, readers

from idloop.errors import IdloopError

# Longest input [bytes], and how long one may take [s].
_LONGEST, _HANG = 60_000, 60
# Address space that a reader may use [bytes].
_MEMORY = 6 << 30
_WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC


class ForbiddenError(Exception):
    """Something that a reader must not do."""


class Watch:
    """Refuses what a reader has no business with, wherever in the process it is tried."""

    def __init__(self, folder: Path) -> None:
        self._folder = os.path.realpath(folder)
        self.on = False
        sys.addaudithook(self._see)

    def _see(self, event: str, arguments: tuple[Any, ...]) -> None:
        if not self.on:
            return
        if event in ("pickle.find_class", "subprocess.Popen", "os.system", "socket.connect", "os.exec"):
            raise ForbiddenError(f"{event} {arguments[:2]}")
        if event == "open" and isinstance(arguments[0], str | bytes):
            mode, flags = arguments[1], arguments[2]
            if (isinstance(mode, str) and set(mode) & set("wax+")) or (mode is None and flags & _WRITES):
                self._inside(event, arguments[0])
        if event in ("os.mkdir", "os.rename", "os.remove", "os.rmdir", "os.truncate", "os.link", "os.symlink"):
            self._inside(event, arguments[0])

    def _inside(self, event: str, path: str | bytes) -> None:
        place = os.path.realpath(os.fsdecode(path))
        if place != os.devnull and not place.startswith(self._folder + os.sep) and "__pycache__" not in place:
            raise ForbiddenError(f"{event} outside the target: {place}")


class Trial:
    """Reads one input after the other and keeps what breaks the reader."""

    def __init__(self, reader: Reader, folder: Path, keep: Path) -> None:
        self._reader, self._folder, self._keep = reader, folder, keep
        self._watch = Watch(folder)
        self.inputs = self.refused = 0
        self.findings: dict[str, str] = {}

    def __call__(self, data: bytes) -> None:
        """Read it."""
        place = self._folder / "input"
        _empty(place)
        path, target = place / f"input{self._reader.suffix}", place / "target"
        target.mkdir(parents=True)
        path.write_bytes(data)
        self.inputs += 1
        self._watch.on = True
        try:
            self._reader.read(path, target)
        except IdloopError as error:
            self.refused += 1
            if "\n" in str(error).strip():
                self._found(data, f"refused in more than one line: {str(error)[:200]!r}")
        except Exception as error:  # noqa: BLE001 (that is what is looked for)
            last = traceback.extract_tb(error.__traceback__)[-1]
            own = [f for f in traceback.extract_tb(error.__traceback__) if "idloop" in f.filename]
            at = f"{Path(own[-1].filename).name}:{own[-1].lineno}" if own else ""
            self._found(
                data,
                f"{type(error).__name__} in {Path(last.filename).name}:{last.lineno} from {at}: {str(error)[:120]}",
            )
        finally:
            self._watch.on = False

    def _found(self, data: bytes, what: str) -> None:
        self._watch.on = False
        key = what.split(":", 2)[0] + what.partition(" from ")[2].split(": ")[0]
        if key in self.findings:
            return
        self._keep.mkdir(parents=True, exist_ok=True)
        name = f"{self._reader.name}-{hashlib.sha256(data).hexdigest()[:8]}"
        (self._keep / name).write_bytes(data)
        self.findings[key] = f"{name}: {' '.join(what.split())}"


def _empty(folder: Path) -> None:
    shutil.rmtree(folder, ignore_errors=True)


def damaged(seed: bytes, words: tuple[str, ...], others: list[bytes], chance: random.Random) -> bytes:
    """A valid input with some bytes, words or stretches of it changed."""
    data = bytearray(seed)
    for _ in range(chance.choice((1, 1, 2, 4, 16))):
        at = chance.randrange(len(data) + 1)
        kind = chance.randrange(7)
        if kind == 0 and at < len(data):
            data[at] ^= 1 << chance.randrange(8)
        elif kind == 1 and at < len(data):
            data[at] = chance.choice(b"\x00\xff\x7f\x80-.,:;{}[]\"'0e9 \n\t")
        elif kind == 2:
            del data[at : at + chance.choice((1, 4, 64, 4096))]
        elif kind == 3:
            there = chance.randrange(len(data) + 1)
            data[at:at] = data[there : there + chance.choice((1, 8, 64, 512))]
        elif kind == 4 and words:
            data[at:at] = chance.choice(words).encode()
        elif kind == 5:
            other = chance.choice(others)
            there = chance.randrange(len(other) + 1)
            data[at : at + 64] = other[there : there + 64]
        else:
            data[at : at + 8] = chance.choice((b"nan", b"1e400", b"-1", b"null", b"[]", b"{}", b"\xff" * 8, b"\0" * 8))
    return bytes(data[:_LONGEST])


def at_random(reader: Reader, trial: Callable[[bytes], None], inputs: int, seed: int) -> None:
    """Without a guide."""
    chance, seeds = random.Random(seed), reader.seeds()  # noqa: S311 (damage, no secrets)

    def hung(*_: object) -> None:
        raise ForbiddenError(f"no answer within {_HANG} s")

    signal.signal(signal.SIGALRM, hung)
    for number in range(inputs):
        one = seeds[number] if number < len(seeds) else damaged(chance.choice(seeds), reader.words, seeds, chance)
        signal.alarm(_HANG)
        trial(one)
        signal.alarm(0)


def guided(reader: Reader, trial: Callable[[bytes], None], inputs: int, seed: int, folder: Path) -> None:
    """With the branches that an input reaches as a guide; ends the process."""
    import atheris

    corpus = folder / "corpus"
    corpus.mkdir()
    seeds = reader.seeds()
    for place, content in enumerate(seeds):
        (corpus / str(place)).write_bytes(content[:_LONGEST])
    chance = random.Random(seed)  # noqa: S311 (damage, no secrets)

    def change(data: bytes, most: int, number: int) -> bytes:
        if chance.random() < 0.5:
            return bytes(atheris.Mutate(data, most))
        return damaged(data, reader.words, seeds, chance)[:most]

    options = [
        f"-runs={inputs}", f"-seed={seed + 1}", f"-max_len={_LONGEST}", f"-timeout={_HANG}",
        f"-artifact_prefix={folder}/", "-verbosity=0", str(corpus),
    ]  # fmt: skip
    atheris.Setup([reader.name, *options], trial, custom_mutator=change, enable_python_coverage=True)
    atheris.Fuzz()


def one_reader(reader: Reader, inputs: int, seed: int, keep: Path, guide: bool) -> None:
    """In this process; the counts go to standard output when it ends."""
    warnings.simplefilter("ignore")
    logging.disable()
    # An input that asks for more is an error of the reader, not the end of the machine.
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    folder = Path(tempfile.mkdtemp(prefix="idloop_fuzz_"))
    trial = Trial(reader, folder, keep)
    begin = time.monotonic()

    def tell() -> None:
        found = {"inputs": trial.inputs, "refused": trial.refused, "seconds": round(time.monotonic() - begin, 1),
                 "findings": sorted(trial.findings.values())}  # fmt: skip
        print(json.dumps(found), flush=True)
        _empty(folder)

    atexit.register(tell)
    if guide:
        import atheris

        with atheris.instrument_imports(include=list(reader.packages), enable_loader_override=False):
            for one in reader.seeds():
                trial(one)
        guided(reader, trial, inputs, seed, folder)
    else:
        at_random(reader, trial, inputs, seed)


def main() -> int:
    """Run the campaign from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--inputs", type=int, default=10_000, help="for each reader (default 10000)")
    parser.add_argument("--only", nargs="+", metavar="READER", help="some readers; all when left out")
    parser.add_argument("--seed", type=int, default=0, help="of the damage (default 0)")
    parser.add_argument("--keep", type=Path, default=Path("findings"), help="folder for what breaks a reader")
    parser.add_argument("--plain", action="store_true", help="damage at random, even where atheris is installed")
    parser.add_argument("--again", type=Path, metavar="FILE", help="read this input once, with its traceback")
    parser.add_argument("--one", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    known = {reader.name: reader for reader in readers()}
    strange = [name for name in arguments.only or [] if name not in known]
    if strange:
        parser.error(f"no reader {strange[0]}; choose from {', '.join(known)}")
    names = arguments.only or list(known)
    if arguments.again:
        with tempfile.TemporaryDirectory() as folder:
            path, target = Path(folder) / f"input{known[names[0]].suffix}", Path(folder) / "target"
            target.mkdir()
            path.write_bytes(arguments.again.read_bytes())
            print(known[names[0]].read(path, target))
        return 0
    guide = not arguments.plain and _has_atheris()
    if arguments.one:
        one_reader(known[names[0]], arguments.inputs, arguments.seed, arguments.keep.resolve(), guide)
        return 0
    print(
        f"{'reader':>16} {'inputs':>8} {'refused':>8} {'seconds':>8}  findings ({'guided' if guide else 'at random'})"
    )
    total = broken = 0
    for name in names:
        ended = subprocess.run(
            [sys.executable, __file__, "--one", "--only", name, "--inputs", str(arguments.inputs), "--seed",
             str(arguments.seed), "--keep", str(arguments.keep), *(["--plain"] if arguments.plain else [])],
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        line = next((one for one in reversed(ended.stdout.splitlines()) if one.startswith('{"inputs"')), None)
        if line is None:
            print(f"{name:>16}  ended with {ended.returncode}: {ended.stderr.strip()[-300:]}")
            broken += 1
            continue
        found = json.loads(line)
        total, broken = total + found["inputs"], broken + len(found["findings"])
        hung = [] if ended.returncode == 0 else [f"ended with {ended.returncode}: {ended.stderr.strip()[-200:]}"]
        broken += len(hung)
        print(
            f"{name:>16} {found['inputs']:8d} {found['refused']:8d} {found['seconds']:8.1f}  {len(found['findings'])}"
        )
        for one in [*found["findings"], *hung]:
            print(f"{'':>16}  {one}")
        sys.stdout.flush()
    print(f"{total} inputs, {broken} findings")
    return 1 if broken else 0


def _has_atheris() -> bool:
    return importlib.util.find_spec("atheris") is not None


if __name__ == "__main__":
    sys.exit(main())
