"""Damaged inputs for every reader: no traceback, no hang, nothing written elsewhere, no pickle opened.

Each reader runs in a process of its own. With atheris (`pip install atheris`) the branches that an input reaches
guide the search; without it, inputs are damaged at random. What breaks a reader is kept, and tried again by naming it:

    python benchmarks/fuzz/run.py --inputs 100000
    python benchmarks/fuzz/run.py --only csv mat --keep findings
    python benchmarks/fuzz/run.py --only csv --again findings/csv-0123abcd
"""

from __future__ import annotations

import argparse
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
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("NUMBA_DISABLE_JIT", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
sys.path.insert(0, str(Path(__file__).resolve().parent))

from damage import LONGEST, damaged
from readers import Reader, readers
from trial import ForbiddenError, Trial

# How long an input may take [s].
_HANG = 60
# Share of the inputs that unpack to a thousand times their size.
_BOMBS = 0.01
# Address space that a reader may use [bytes].
_MEMORY = 6 << 30


def at_random(reader: Reader, trial: Callable[[bytes], None], inputs: int, seed: int) -> None:
    """Without a guide."""
    chance, seeds = random.Random(seed), reader.seeds()  # noqa: S311 (damage, no secrets)

    def hung(*_: object) -> None:
        raise ForbiddenError(f"no answer within {_HANG} s")

    signal.signal(signal.SIGALRM, hung)
    pools = [seeds, reader.bombs()]
    for number in range(inputs):
        if number < len(seeds):
            one = seeds[number]
        else:
            pool = pools[bool(pools[1]) and chance.random() < _BOMBS]
            one = damaged(chance.choice(pool), reader.words, seeds, chance)
        signal.alarm(_HANG)
        trial(one)
        signal.alarm(0)


def guided(reader: Reader, trial: Trial, inputs: int, seed: int, folder: Path, tell: Callable[[], None]) -> None:
    """With the branches that an input reaches as a guide; ends the process."""
    import atheris

    def one(data: bytes) -> None:
        trial(data)
        if trial.inputs >= inputs:
            # The fuzzer would end the process without a word of ours.
            tell()
            os._exit(0)

    corpus = folder / "corpus"
    corpus.mkdir()
    seeds = reader.seeds()
    for place, content in enumerate([*seeds, *reader.bombs()]):
        (corpus / str(place)).write_bytes(content[:LONGEST])
    chance = random.Random(seed)  # noqa: S311 (damage, no secrets)

    def change(data: bytes, most: int, number: int) -> bytes:
        if chance.random() < 0.5:
            return bytes(atheris.Mutate(data, most))
        return damaged(data, reader.words, seeds, chance)[:most]

    options = [
        "-runs=-1", f"-seed={seed + 1}", f"-max_len={LONGEST}", f"-timeout={_HANG}",
        f"-artifact_prefix={folder}/", "-verbosity=0", str(corpus),
    ]  # fmt: skip
    atheris.Setup([reader.name, *options], one, custom_mutator=change, enable_python_coverage=True)
    atheris.Fuzz()


def one_reader(reader: Reader, inputs: int, seed: int, folder: Path, keep: Path, guide: bool) -> None:
    """In this process; the counts go to standard output when it ends."""
    warnings.simplefilter("ignore")
    logging.disable()
    # An input that asks for more is an error of the reader, not the end of the machine.
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    trial = Trial(reader, folder, keep)
    begin = time.monotonic()

    def tell() -> None:
        found = {"inputs": trial.inputs, "refused": trial.refused, "seconds": round(time.monotonic() - begin, 1),
                 "findings": sorted(trial.findings.values())}  # fmt: skip
        print(json.dumps(found), flush=True)

    if guide:
        import atheris

        with atheris.instrument_imports(include=list(reader.packages), enable_loader_override=False):
            for one in reader.seeds():
                trial(one)
        guided(reader, trial, inputs, seed, folder, tell)
    else:
        at_random(reader, trial, inputs, seed)
        tell()


def _in_a_process(reader: Reader, arguments: argparse.Namespace) -> tuple[dict[str, Any], str]:
    """Counts of one reader, and how its process ended where it did not end well."""
    with tempfile.TemporaryDirectory(prefix="idloop_fuzz_") as folder:
        ended = subprocess.run(
            [sys.executable, __file__, "--one", folder, "--only", reader.name, "--inputs",
             str(round(arguments.inputs * reader.share)), "--seed", str(arguments.seed), "--keep", str(arguments.keep),
             *(["--plain"] if arguments.plain else [])],
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        line = next((one for one in reversed(ended.stdout.splitlines()) if one.startswith('{"inputs"')), None)
        found = json.loads(line) if line else {"inputs": 0, "refused": 0, "seconds": 0.0, "findings": []}
        if line and ended.returncode == 0:
            return found, ""
        kept = ""
        last = Path(folder, "input", f"input{reader.suffix}")
        if last.exists():
            arguments.keep.mkdir(parents=True, exist_ok=True)
            kept = f"{reader.name}-last"
            shutil.copyfile(last, arguments.keep / kept)
        return found, f"{kept}: ended with {ended.returncode}: {' '.join(ended.stderr.split())[-200:]}"


def main() -> int:
    """Run the campaign from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--inputs", type=int, default=10_000, help="for a reader; quick ones get more, slow ones fewer (default 10000)"
    )
    parser.add_argument("--only", nargs="+", metavar="READER", help="some readers; all when left out")
    parser.add_argument("--seed", type=int, default=0, help="of the damage (default 0)")
    parser.add_argument("--keep", type=Path, default=Path("findings"), help="folder for what breaks a reader")
    parser.add_argument("--plain", action="store_true", help="damage at random, even where atheris is installed")
    parser.add_argument("--again", type=Path, metavar="FILE", help="read this input once, with its traceback")
    parser.add_argument("--one", type=Path, help=argparse.SUPPRESS)
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
        one_reader(known[names[0]], arguments.inputs, arguments.seed, arguments.one, arguments.keep.resolve(), guide)
        return 0
    print(
        f"{'reader':>16} {'inputs':>8} {'refused':>8} {'seconds':>8}  findings ({'guided' if guide else 'at random'})"
    )
    total = broken = 0
    for name in names:
        found, last_words = _in_a_process(known[name], arguments)
        total, broken = total + found["inputs"], broken + len(found["findings"]) + bool(last_words)
        print(
            f"{name:>16} {found['inputs']:8d} {found['refused']:8d} {found['seconds']:8.1f}  {len(found['findings'])}"
        )
        for one in [*found["findings"], *([last_words] if last_words else [])]:
            print(f"{'':>16}  {one}")
        sys.stdout.flush()
    print(f"{total} inputs, {broken} findings")
    return 1 if broken else 0


def _has_atheris() -> bool:
    return importlib.util.find_spec("atheris") is not None


if __name__ == "__main__":
    sys.exit(main())
