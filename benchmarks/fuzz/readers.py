"""Every reader of files and messages that come from elsewhere, with valid inputs to begin from.

A reader takes a folder with one input in it and reads it as a verb or a node would. It may refuse it with an
`IdloopError`, whose text is one line; anything else that it raises is a finding.
"""

from __future__ import annotations

import contextlib
import functools
import io
import json
import re
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from idloop.records.mapping import Mapping

# Small inputs are read quickly, and more of their damage hits what matters.
STAMPS = np.arange(1, 41, dtype=np.int64) * 5_000_000


@dataclass(frozen=True)
class Reader:
    """One way in.

    Attributes
    ----------
    name : str
    suffix : str
        Of the file that the input is put into.
    read : callable
        Reads the input (a path) and may write into a folder that is there for it.
    seeds : callable
        Valid inputs.
    packages : tuple of str
        Modules whose branches guide the search.
    words : tuple of str
        What a valid input is made of.
    share : float
        Inputs of this reader for one of the others: a quick reader gets more.
    """

    name: str
    suffix: str
    read: Callable[[Path, Path], object]
    seeds: Callable[[], list[bytes]]
    packages: tuple[str, ...]
    words: tuple[str, ...] = ()
    share: float = 1.0


def _signals() -> dict[str, np.ndarray]:
    time = STAMPS * 1e-9
    return {"t": time, "u": np.sign(np.sin(90.0 * time)), "angle": np.sin(50.0 * time), "speed": np.cos(50.0 * time)}


# model, mapping, launch files


def _read_model(path: Path, target: Path) -> object:
    from idloop.physics import Engine, load_model

    model = load_model(path)
    Engine(model).layout(None)
    return model.to_yaml()


def _models() -> list[bytes]:
    from idloop.physics import load_model
    from idloop.physics.model_file import preset_names

    return [load_model(name).to_yaml().encode() for name in preset_names()]


def _read_mapping(path: Path, target: Path) -> object:
    from idloop.records.mapping import load_mapping

    return load_mapping(path)


def _ready_mappings() -> list[bytes]:
    from idloop.records.mapping import ready_mappings

    return [path.read_bytes() for path in ready_mappings().values()]


def _mappings() -> list[bytes]:
    return sorted(_ready_mappings(), key=len)[:4]


def _read_graph(path: Path, target: Path) -> object:
    from idloop.graph.description import load_graph

    return load_graph(str(path), {}, to_run=False)


# Everything that a launch file may have, once: ours repeat it.
_GRAPH = b"""
launch:
  - arg: {name: mode, default: lockstep, description: "lockstep or realtime"}
  - arg: {name: config, default: $(find-pkg-share idloop_bringup)/config/dc_motor.yaml}
  - let: {name: place, value: $(dirname)/$(env HOME nowhere)}
  - node:
      pkg: idloop_nodes
      exec: plant
      name: plant
      namespace: axis
      if: "true"
      on_exit: shutdown
      args: --one $(var place)
      param:
        - from: $(var config)
        - {name: mode, value: $(var mode)}
        - {name: effects, value: "['']"}
      remap:
        - {from: joint_states, to: /joint_states}
"""


def _graphs() -> list[bytes]:
    return [_GRAPH, _GRAPH.replace(b"if:", b"unless:").replace(b'"true"', b"$(env IDLOOP_SAYS false)")]


def _ready_graphs() -> list[bytes]:
    from idloop.graph.find import graph_names, graph_path

    return [graph_path(name).read_bytes() for name in graph_names()]


# tables


_MAPPING = """
schema: idloop/mapping/1
name: fuzz
format: {format}
joint: axis
time: {{column: t, unit: s}}
command: {{column: u, unit: V}}
position: {{column: angle, unit: deg}}
velocity: {{column: speed, unit: rpm, optional: true}}
"""


def _read_table(kind: str) -> Callable[[Path, Path], object]:
    def read(path: Path, target: Path) -> object:
        from idloop.records.importing import import_bag

        return import_bag(path, target / "bag", _mapping(kind))

    return read


@functools.cache
def _mapping(kind: str) -> Mapping:
    from ruamel.yaml import YAML

    from idloop.records.mapping import parse_mapping

    return parse_mapping(YAML(typ="safe").load(_MAPPING.format(format=kind)), "mapping.yaml")


def _csvs() -> list[bytes]:
    signals = _signals()
    rows = zip(*signals.values(), strict=True)
    comma = ",".join(signals) + "\n" + "\n".join(",".join(f"{v:.6g}" for v in row) for row in rows) + "\n"
    return [comma.encode(), comma.replace(",", ";").replace(".", ",").encode(), comma.replace(",", "\t").encode()]


def _mats() -> list[bytes]:
    from scipy.io import savemat

    found = []
    for version in ("5", "4"):
        file = io.BytesIO()
        savemat(file, _signals(), format=version)
        found.append(file.getvalue())
    file = io.BytesIO()
    savemat(file, {"log": _signals(), "kp": 2.0}, do_compression=True)
    return [*found, file.getvalue()]


def _npzs() -> list[bytes]:
    plain, packed, pickled = io.BytesIO(), io.BytesIO(), io.BytesIO()
    np.savez(plain, **_signals())
    np.savez_compressed(packed, **_signals())
    np.savez(pickled, **{**_signals(), "u": np.array([{"a": 1}], dtype=object)})
    return [plain.getvalue(), packed.getvalue(), pickled.getvalue()]


def _jsons() -> list[bytes]:
    signals = {name: values.tolist() for name, values in _signals().items()}
    rows = [dict(zip(signals, row, strict=True)) for row in zip(*signals.values(), strict=True)]
    return [json.dumps(signals).encode(), json.dumps(rows).encode(), json.dumps({"entries": rows, "kp": 3}).encode()]


# recordings: the first byte says which file of the bag the rest takes the place of


def _bag(folder: Path, storage: str) -> Path:
    from idloop.records import write_bag
    from idloop.records.write import make_stream

    signals = _signals()
    streams = [
        make_stream("joint_command", STAMPS, {"axis": {"effort": signals["u"]}}),
        make_stream("joint_states", STAMPS, {"axis": {"position": signals["angle"], "velocity": signals["speed"]}}),
    ]
    return write_bag(folder / "bag", streams, storage=storage)


class _BagReader:
    """Reads a recording of which one file is the input."""

    def __init__(self, storage: str, use: Callable[[Path, Path], object]) -> None:
        self._storage, self._use = storage, use
        self._files: dict[str, bytes] = {}

    def __call__(self, path: Path, target: Path) -> object:
        files = self.files()
        data = path.read_bytes()
        names = sorted(files)
        damaged = names[(data[0] if data else 0) % len(names)]
        bag = path.parent / "bag"
        bag.mkdir(exist_ok=True)
        for name, content in files.items():
            (bag / name).write_bytes(data[1:] if name == damaged else content)
        return self._use(bag, target)

    def files(self) -> dict[str, bytes]:
        if not self._files:
            with tempfile.TemporaryDirectory() as folder:
                bag = _bag(Path(folder), self._storage)
                self._files = {file.name: file.read_bytes() for file in bag.iterdir()}
        return self._files

    def seeds(self) -> list[bytes]:
        return [bytes([place]) + content for place, (_, content) in enumerate(sorted(self.files().items()))]


def _use_bag(bag: Path, target: Path) -> object:
    from idloop.physics import load_model
    from idloop.records import read_record
    from idloop.records.inspection import inspect_bag

    inspect_bag(bag).to_dict()
    return read_record(bag, load_model("axis"))


def _recover(bag: Path, target: Path) -> object:
    from idloop.records.recover import recover_bag

    return recover_bag(bag, target / "saved")


# ladders and models of other kinds


def _ladder_text() -> str:
    from idloop.diagnose import Ladder
    from idloop.diagnose.ladder import Step
    from idloop.physics import load_model

    model = load_model("dc_motor")
    errors = {"nrmse": {"motor.position": 0.12}, "fit": {"motor.position": 87.6}, "force": None}
    ladder = Ladder(steps=(Step(None, model, train=errors, validation=errors),), criterion="prediction", level=0.01)
    return json.dumps({**ladder.to_dict(), "bags": ["a"], "validate": [], "model_folder": None, "provenance": {}})


def _read_ladder(path: Path, target: Path) -> object:
    from idloop.cli._ladder_folder import read_ladder

    shutil.copyfile(path, target / "ladder.json")
    return read_ladder(target).ladder.to_dict()


def _ladders() -> list[bytes]:
    return [_ladder_text().encode()]


def _read_linear(path: Path, target: Path) -> object:
    from idloop.estimate.linear.model_file import load

    return load(path)


def _linears() -> list[bytes]:
    from idloop.estimate.linear.model import LinearModel
    from idloop.estimate.linear.model_file import save

    model = LinearModel(
        method="n4sid", a=np.array([[0.9, 0.1], [0.0, 0.8]]), b=np.array([[0.0], [1.0]]), c=np.array([[1.0, 0.0]]),
        d=np.zeros((1, 1)), gain=np.zeros((2, 1)), covariance=np.eye(1), sample_time=0.01, input_names=("u",),
        input_units=("V",), output_names=("y",), output_units=("rad",), samples=100, free=4,
    )  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        return [save(model, Path(folder) / name).read_bytes() for name in ("model.json", "model.npz")]


# messages


def _read_message(path: Path, target: Path) -> object:
    from idloop.records.cdr import read_layout
    from idloop_nodes.codec import CdrError, JointReader

    data = path.read_bytes()
    readers = JointReader([("axis", "position"), ("axis", "velocity")]), JointReader([("*", "effort")])
    for reader in readers:
        with contextlib.suppress(CdrError):
            reader.read(data)
    return read_layout(data)


def _messages() -> list[bytes]:
    from idloop_nodes.codec import JointSample, encode_joint_state

    return [
        encode_joint_state(JointSample(10**9, ("axis",), (1.0,), (2.0,), (3.0,))),
        encode_joint_state(JointSample(10**9, ("motor", "axis"), (1.0, 2.0), (), (), "base")),
        encode_joint_state(JointSample(0, ())),
    ]


def _names_in(texts: list[bytes]) -> tuple[str, ...]:
    """Words of valid inputs."""
    return tuple(
        sorted({word for text in texts for word in re.findall(r"[A-Za-z_]{3,}", text.decode(errors="ignore"))})
    )


def readers() -> list[Reader]:
    """All of them."""
    records, rosbags = "idloop.records", "rosbags"
    bags = [
        Reader(f"{name}_{storage}", ".bin", one, one.seeds, (records, rosbags), share=0.25)
        for name, use in (("bag", _use_bag), ("recover", _recover))
        for storage in ("mcap", "sqlite3")
        for one in [_BagReader(storage, use)]
    ]
    return [
        Reader("model", ".yaml", _read_model, _models, ("idloop.physics.model", "idloop.physics.model_file",
               "idloop.physics.schema"), _names_in(_models())),
        Reader("mapping", ".yaml", _read_mapping, _mappings, ("idloop.records.mapping",),
               _names_in(_ready_mappings())),
        Reader("graph", ".yaml", _read_graph, _graphs, ("idloop.graph.description",), _names_in(_ready_graphs())),
        Reader("csv", ".csv", _read_table("csv"), _csvs, (records,), share=2.0),
        Reader("mat", ".mat", _read_table("mat"), _mats, (records, "scipy.io.matlab"), share=2.0),
        Reader("npz", ".npz", _read_table("npz"), _npzs, (records,), share=2.0),
        Reader("json", ".json", _read_table("json"), _jsons, (records,), share=2.0),
        *bags,
        Reader("ladder", ".json", _read_ladder, _ladders, ("idloop.diagnose.ladder", "idloop.cli._ladder_folder"),
               _names_in(_ladders())),
        Reader("linear", ".json", _read_linear, _linears, ("idloop.estimate.linear.model_file",), share=3.0),
        Reader("message", ".bin", _read_message, _messages, ("idloop_nodes.codec", records), share=4.0),
    ]  # fmt: skip
