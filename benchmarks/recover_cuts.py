"""What `idloop recover` saves of recordings that are cut off anywhere.

A recording of some seconds at 1 kHz is cut at random places, in both storages. Every time the verb must end with 0
(saved) or 1 (nothing to save), without a traceback; what it saved must be the recording's own messages, without a hole
where the storage keeps their order; and every chunk (mcap) that was complete must be in it.

    .venv/bin/python benchmarks/recover_cuts.py --cuts 1000
"""

from __future__ import annotations

import argparse
import contextlib
import io
import os
import sys
import tempfile
from collections import Counter
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from rich.console import Console
from rich.progress import track

from idloop.cli import main as idloop
from idloop.records import read_streams, write_bag
from idloop.records.bags.write import make_stream
from idloop_nodes.codec import JointSample, encode_joint_state
from idloop_nodes.streams.bag_writer import BagWriter

_DONE, _COULD_NOT = 0, 1


def _file(bag: Path) -> Path:
    return next(one for one in bag.iterdir() if one.suffix in (".mcap", ".db3"))


def _recorded(folder: Path, stamps: np.ndarray) -> Path:
    """A recording in mcap, as the recorder node writes it."""
    writer = BagWriter(folder, {"/joint_states": "sensor_msgs/msg/JointState"}, "kilted")
    for stamp in stamps.tolist():
        sample = JointSample(stamp, ("motor",), (np.sin(1e-9 * stamp),), (0.0,))
        writer.write("/joint_states", stamp, encode_joint_state(sample))
    writer.close()
    return folder


def _complete(file: Path) -> list[tuple[int, int]]:
    """Where each chunk of an mcap file ends, and how many messages there are up to there."""
    from mcap.reader import make_reader

    with file.open("rb") as stream:
        summary = make_reader(stream).get_summary()
        stream.seek(0)
        times = np.array([message.log_time for _, _, message in make_reader(stream).iter_messages()])
    chunks = summary.chunk_indexes if summary is not None else []
    return [
        (one.chunk_start_offset + one.chunk_length, int(np.searchsorted(times, one.message_end_time, side="right")))
        for one in chunks
    ]


def _recover(cut: Path, saved: Path) -> tuple[int, str]:
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        code = idloop.run(["recover", str(cut), str(saved)])
    return code, said.getvalue()


def main() -> int:
    """Run the campaign from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cuts", type=int, default=1000, help="in each storage (default 1000)")
    parser.add_argument("--seconds", type=float, default=20.0, help="of the recording at 1 kHz (default 20)")
    parser.add_argument("--seed", type=int, default=0, help="of the places (default 0)")
    arguments = parser.parse_args()
    places = np.random.default_rng(arguments.seed)
    screen = Console(stderr=True)
    stamps = np.arange(1, round(1000 * arguments.seconds) + 1, dtype=np.int64) * 1_000_000
    stream = make_stream("joint_states", stamps, {"motor": {"position": np.sin(1e-9 * stamps)}})
    wrong = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for storage in ("mcap", "sqlite3"):
            if storage == "mcap":
                whole = _file(_recorded(folder / storage, stamps))
            else:
                whole = _file(write_bag(folder / storage, [stream], storage=storage))
            data = whole.read_bytes()
            chunks = _complete(whole) if storage == "mcap" else []
            codes: Counter[int] = Counter()
            shares = []
            for index in track(range(arguments.cuts), storage, console=screen, disable=not screen.is_terminal):
                at = int(places.integers(0, len(data)))
                cut, saved = folder / f"cut{whole.suffix}", folder / f"{storage}_{index}"
                cut.write_bytes(data[:at])
                code, said = _recover(cut, saved)
                codes[code] += 1
                got = read_streams(saved)["/joint_states"].stamp_ns if code == _DONE else stamps[:0]
                due = max((count for end, count in chunks if end <= at), default=0)
                shares.append((len(got) / len(stamps), at / len(data)))
                good = code in (_DONE, _COULD_NOT) and "Traceback" not in said
                good &= (
                    len(got) >= due and np.array_equal(got, stamps[: len(got)]) and saved.exists() == (code == _DONE)
                )
                if not good:
                    wrong += 1
                    print(f"{storage} cut at {at}: exit {code}, {len(got)} of at least {due} messages: {said.strip()}")
            kept = np.array(shares)
            print(
                f"{storage}: {arguments.cuts} cuts, exit codes {dict(sorted(codes.items()))}; saved "
                f"{kept[:, 0].mean():.1%} of the messages in the mean, of {kept[:, 1].mean():.1%} of the bytes"
            )
    print(f"{wrong} wrong")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
