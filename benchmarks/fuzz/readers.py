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
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from idloop.errors import InputError
from idloop.parameter_table import REQUIRED

if TYPE_CHECKING:
    from idloop.diagnosis import Ladder
    from idloop.records.tables.mapping import Mapping

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
    bombs : callable
        Inputs that unpack to a thousand times their size, within what a table or a chunk may take.
    """

    name: str
    suffix: str
    read: Callable[[Path, Path], object]
    seeds: Callable[[], list[bytes]]
    packages: tuple[str, ...]
    words: tuple[str, ...] = ()
    share: float = 1.0
    bombs: Callable[[], list[bytes]] = list


def _signals() -> dict[str, np.ndarray]:
    time = STAMPS * 1e-9
    return {"t": time, "u": np.sign(np.sin(90.0 * time)), "angle": np.sin(50.0 * time), "speed": np.cos(50.0 * time)}


# model, mapping, launch files


def _read_model(path: Path, target: Path) -> object:
    from idloop.physics import Engine, load_model

    model = load_model(path)
    Engine(model).layout(None)
    return model.to_yaml()


def _presets() -> list[bytes]:
    from idloop.physics import load_model
    from idloop.physics.model_file import preset_names

    return [load_model(name).to_yaml().encode() for name in preset_names()]


def _models() -> list[bytes]:
    from idloop.physics import Engine, load_model

    # What is compiled comes from numba's cache as pickles, which no reader may open.
    Engine(load_model("axis")).layout(None)
    return _presets()


def _read_controller(path: Path, target: Path) -> object:
    from idloop.control.controller_file import load_controller

    return load_controller(path)


def _controllers() -> list[bytes]:
    from idloop.control.document import EXAMPLES

    return [f"controller: {text}\n".encode() for text in EXAMPLES.values()]


def _read_experiment(path: Path, target: Path) -> object:
    from idloop.documents import read_text
    from idloop_nodes.excitation.experiment import Limits, read_experiment

    limits = Limits(amplitude=5.0, position_min=-5.0, position_max=5.0, velocity=50.0)
    experiment = read_experiment(read_text(path), "reference", 0.01)
    limits.refuse(experiment)
    return experiment


def _experiments() -> list[bytes]:
    from idloop.signals import SIGNALS

    own = {name: "".join(f", {one.name}: {_plain(one.default)}" for one in kind.parameters
                         if one.default not in (None, REQUIRED)) for name, kind in SIGNALS.items()}  # fmt: skip
    needed = {
        "multisine": ", frequencies: [0.5, 1.5]", "sine": ", frequency: 0.5", "square": ", frequency: 0.5",
        "triangle": ", frequency: 0.5", "saw": ", frequency: 0.5", "stepped_sine": ", frequencies: [0.5, 1.5]",
        "chirp": ", start_frequency: 0.1, end_frequency: 2.0", "smooth": ", points: [1.0, -1.0]",
    }  # fmt: skip
    return [
        f"{{signal: {{name: {name}, duration: 4.0, amplitude: 1.0, offset: 0.1{needed.get(name, '')}{more}}},"
        " adds_to: reference}".encode()
        for name, more in own.items()
    ]


def _plain(value: object) -> str:
    return json.dumps(list(value) if isinstance(value, tuple) else value)


def _read_mapping(path: Path, target: Path) -> object:
    from idloop.records.tables.mapping import load_mapping

    return load_mapping(path)


def _ready_mappings() -> list[bytes]:
    from idloop.records.tables.mapping import ready_mappings

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
        from idloop.records.tables.importing import import_bag

        return import_bag(path, target / "bag", _mapping(kind))

    return read


@functools.cache
def _mapping(kind: str) -> Mapping:
    from ruamel.yaml import YAML

    from idloop.records.tables.mapping import parse_mapping

    return parse_mapping(YAML(typ="safe").load(_MAPPING.format(format=kind)), "mapping.yaml")


def _read_mapped(path: Path, target: Path) -> object:
    """A table that is as it should be, with a mapping that may not be."""
    from idloop.records.tables.importing import import_bag

    table = path.with_name("table.csv")
    table.write_bytes(_csvs()[0])
    return import_bag(table, target / "bag", path)


def _table_mappings() -> list[bytes]:
    plain = _MAPPING.format(format="csv")
    more = """
csv: {delimiter: ",", header: true, skip_rows: 0, decimal: "."}
reference: {position: {column: angle, offset: 0.1, unit: rad}}
rows: {start: 1, stop: 30}
attributes: [kp]
"""
    wrapped = plain.replace("unit: deg", "unit: deg, wrap: 360, scale: 2.5, decode: {sign_bit: 10}")
    even = plain.replace("time: {column: t, unit: s}", "time: {period: 0.005}")
    return [text.encode() for text in (plain + more, wrapped, even, even.replace("period: 0.005", "rate: 200.0"))]


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


def _mat_bombs() -> list[bytes]:
    from scipy.io import savemat

    file = io.BytesIO()
    savemat(file, {**_signals(), "zeros": np.zeros(3_000_000)}, do_compression=True)
    return [file.getvalue()]


def _npz_bombs() -> list[bytes]:
    packed, endless = io.BytesIO(), io.BytesIO()
    np.savez_compressed(packed, **_signals(), zeros=np.zeros(3_000_000))
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": (10**12,)})
    with zipfile.ZipFile(endless, "w") as archive:
        archive.writestr("t.npy", header.getvalue())
    return [packed.getvalue(), endless.getvalue()]


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


# Forms of files that are damaged by the tests as well, with the same valid ones.
_FORMS = {
    "hdf5": "h5py", "parquet": "pyarrow", "feather": "pyarrow", "npy": "numpy", "torch": "pickletools", "wpilog": "",
    "codesys": "", "lvm": "", "twincat": "", "tektronix": "", "sysid": "", "jsonl": "", "blocks": "", "labels": "",
    "echo": "",
}  # fmt: skip


def _read_form(kind: str) -> Callable[[Path, Path], object]:
    def read(path: Path, target: Path) -> object:
        from idloop.records.tables.table_files import read_table

        with contextlib.suppress(InputError):
            read_table(path, kind)
        return read_table(path)

    return read


def _form_readers() -> list[Reader]:
    from tests.records.formats.seeds import seeds

    return [
        Reader(kind, seeds()[kind][0], _read_form(kind), lambda kind=kind: seeds()[kind][1],  # type: ignore[misc]
               ("idloop.records", *([library] if library else [])))
        for kind, library in _FORMS.items()
    ]  # fmt: skip


# recordings: the first byte says which file of the bag the rest takes the place of


def _bag(folder: Path, storage: str) -> Path:
    from idloop.records import write_bag
    from idloop.records.bags.write import make_stream

    signals = _signals()
    streams = [
        make_stream("joint_command", STAMPS, {"axis": {"effort": signals["u"]}}),
        make_stream("joint_states", STAMPS, {"axis": {"position": signals["angle"], "velocity": signals["speed"]}}),
    ]
    if storage in ("mcap", "sqlite3"):
        return write_bag(folder / "bag", streams, storage=storage)
    mcap = next(write_bag(folder / "mcap", streams).glob("*.mcap"))
    (folder / "bag").mkdir()
    if storage == "packed":
        import zstandard

        (folder / "bag" / "bag_0.mcap.zstd").write_bytes(zstandard.compress(mcap.read_bytes()))
    else:
        _ros1_bag(folder / "bag" / "bag.bag", mcap)
    return folder / "bag"


def _ros1_bag(path: Path, mcap: Path) -> None:
    """The messages of a recording of ROS 2 in a bag of ROS 1."""
    from rosbags.rosbag1 import Writer
    from rosbags.rosbag2 import Reader as Ros2Reader
    from rosbags.typesys import Stores, get_typestore

    old, new = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.LATEST)
    with Ros2Reader(mcap) as reader, Writer(path) as writer:
        topics = {one.topic: writer.add_connection(one.topic, one.msgtype, typestore=old) for one in reader.connections}
        for connection, stamp, data in reader.messages():
            writer.write(topics[connection.topic], stamp, new.cdr_to_ros1(data, connection.msgtype))


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
        tempfile.tempdir = str(target)  # for what is unpacked
        try:
            return self._use(bag, target)
        finally:
            tempfile.tempdir = None

    def files(self) -> dict[str, bytes]:
        if not self._files:
            with tempfile.TemporaryDirectory() as folder:
                bag = _bag(Path(folder), self._storage)
                self._files = {file.name: file.read_bytes() for file in bag.iterdir()}
        return self._files

    def seeds(self) -> list[bytes]:
        return [bytes([place]) + content for place, (_, content) in enumerate(sorted(self.files().items()))]

    def bombs(self) -> list[bytes]:
        """A chunk of zeros, compressed, in place of the file that is not metadata."""
        if self._storage != "mcap":
            return []
        from mcap.writer import CompressionType, Writer

        place = next(place for place, name in enumerate(sorted(self.files())) if name.endswith(".mcap"))
        found = []
        for compression in (CompressionType.ZSTD, CompressionType.LZ4):
            file = io.BytesIO()
            writer = Writer(file, compression=compression, chunk_size=1 << 26)
            writer.start(profile="ros2", library="fuzz")
            schema = writer.register_schema("sensor_msgs/msg/JointState", "ros2msg", b"string data")
            writer.add_message(writer.register_channel("/joint_states", "cdr", schema), 1, bytes(12_000_000), 1, 0)
            writer.finish()
            found.append(bytes([place]) + file.getvalue())
        return found


def _use_bag(bag: Path, target: Path) -> object:
    from idloop.physics import load_model
    from idloop.records import read_record
    from idloop.records.inspection.inspection import inspect_bag

    inspect_bag(bag).to_dict()
    return read_record(bag, load_model("axis"))


def _recover(bag: Path, target: Path) -> object:
    from idloop.records.bags.recover import recover_bag

    return recover_bag(bag, target / "saved")


# ladders and models of other kinds


def _ladder() -> Ladder:
    from idloop.diagnosis import Ladder
    from idloop.diagnosis.ladder import Step
    from idloop.physics import load_model

    model = load_model("dc_motor")
    errors = {"nrmse": {"motor.position": 0.12}, "fit": {"motor.position": 87.6}, "force": None}
    return Ladder(steps=(Step(None, model, train=errors, validation=errors),), criterion="prediction", level=0.01)


def _ladder_text() -> str:
    ladder = _ladder()
    return json.dumps({**ladder.to_dict(), "bags": ["a"], "validate": [], "model_folder": None, "provenance": {}})


def _read_ladder(path: Path, target: Path) -> object:
    from idloop.reporting.ladder_folder import read_ladder

    shutil.copyfile(path, target / "ladder.json")
    return read_ladder(target).ladder.to_dict()


def _ladders() -> list[bytes]:
    return [_ladder_text().encode()]


def _read_next(path: Path, target: Path) -> object:
    from idloop.reporting.ladder_folder import Kept, read_next_experiment

    shutil.copyfile(path, target / "next.json")
    ladder = replace(_ladder(), suggested_experiment={"signal": {}})
    return read_next_experiment(target, Kept(ladder))


def _nexts() -> list[bytes]:
    from idloop.diagnosis.design.expected_outcome import Outcome
    from idloop.diagnosis.design.suggest import Limits, Suggestion
    from idloop.json_values import to_json
    from idloop.physics import load_model
    from idloop.reporting.next_experiment import next_document

    motor = load_model("dc_motor")
    rivals = tuple((name, motor.with_effects([f"{name}@motor"])) for name in ("coulomb_friction", "load_torque"))
    signal = {"name": "triangle", "sample_time": 0.01, "duration": 4.0, "amplitude": 1.0, "frequency": 0.5}
    outcomes = tuple(Outcome(name, 40.0, "the other", {}, f"if {name}: it leads") for name, _ in rivals)
    limits = Limits(command=2.0, position=(-20.0, 20.0))
    found = Suggestion(
        signal, "command", 4.0, 40.0, outcomes, "expected to tell them apart", limits, 0.0, None, 0.01, rivals,
        (0.002, 0.01),
    )  # fmt: skip
    return [json.dumps(to_json(next_document(found))).encode()]


def _read_network(path: Path, target: Path) -> object:
    from idloop.estimation.networks import load

    return load(path)


def _networks() -> list[bytes]:
    from idloop.estimation.black_box.sampled import SampledData
    from idloop.estimation.networks import narx_wavelet, save

    command = np.repeat(np.random.default_rng(1).uniform(-1.0, 1.0, 50), 4)[:, None]
    answer = np.convolve(command[:, 0], 0.1 * 0.9 ** np.arange(60))[:200, None]
    data = SampledData("run", command, answer, 0.05, ("u",), ("V",), ("y",), ("rad",))
    with tempfile.TemporaryDirectory() as folder:
        return [save(narx_wavelet(data, units=2), Path(folder) / "model.json").read_bytes()]


def _read_linear(path: Path, target: Path) -> object:
    from idloop.estimation.linear.model_file import load

    return load(path)


def _linears() -> list[bytes]:
    from idloop.estimation.linear.model import LinearModel
    from idloop.estimation.linear.model_file import save

    model = LinearModel(
        method="n4sid", a=np.array([[0.9, 0.1], [0.0, 0.8]]), b=np.array([[0.0], [1.0]]), c=np.array([[1.0, 0.0]]),
        d=np.zeros((1, 1)), gain=np.zeros((2, 1)), covariance=np.eye(1), sample_time=0.01, input_names=("u",),
        input_units=("V",), output_names=("y",), output_units=("rad",), samples=100, free=4,
    )  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        return [save(model, Path(folder) / name).read_bytes() for name in ("model.json", "model.npz")]


# messages


def _read_message(path: Path, target: Path) -> object:
    from idloop.records.bags.cdr import read_layout
    from idloop_nodes.codec import CdrError, JointReader

    data = path.read_bytes()
    readers = JointReader([("axis", "position"), ("axis", "velocity")]), JointReader([("*", "effort")])
    for reader in readers:
        with contextlib.suppress(CdrError):
            reader.read(data)
    with contextlib.suppress(CdrError):
        return read_layout(data)
    return None


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
    documents, records, rosbags = "idloop.documents", "idloop.records", "rosbags"
    bags = [
        Reader(f"{name}_{storage}", ".bin", one, one.seeds, (records, rosbags), share=0.25, bombs=one.bombs)
        for name, use in (("bag", _use_bag), ("recover", _recover))
        for storage in ("mcap", "sqlite3", "packed", "ros1")
        for one in [_BagReader(storage, use)]
    ]
    return [
        Reader("model", ".yaml", _read_model, _models, (documents, "idloop.physics.model",
               "idloop.physics.model_file", "idloop.physics.schema"), _names_in(_presets())),
        Reader("controller", ".yaml", _read_controller, _controllers, (documents, "idloop.control"),
               _names_in(_controllers())),
        Reader("experiment", ".yaml", _read_experiment, _experiments, (documents, "idloop.signals"),
               _names_in(_experiments())),
        Reader("mapping", ".yaml", _read_mapping, _mappings, (documents, "idloop.records.tables.mapping"),
               _names_in(_ready_mappings())),
        Reader("mapped", ".yaml", _read_mapped, _table_mappings, (documents, records), _names_in(_table_mappings())),
        Reader("graph", ".yaml", _read_graph, _graphs, (documents, "idloop.graph.description"),
               _names_in(_ready_graphs())),
        Reader("csv", ".csv", _read_table("csv"), _csvs, (records,), share=2.0),
        Reader("mat", ".mat", _read_table("mat"), _mats, (records, "scipy.io.matlab"), share=2.0,
               bombs=_mat_bombs),
        Reader("npz", ".npz", _read_table("npz"), _npzs, (documents, records), share=2.0, bombs=_npz_bombs),
        Reader("json", ".json", _read_table("json"), _jsons, (documents, records), share=2.0),
        *_form_readers(),
        *bags,
        Reader("ladder", ".json", _read_ladder, _ladders, ("idloop.diagnosis.ladder", "idloop.reporting.ladder_folder"),
               _names_in(_ladders())),
        Reader("next", ".json", _read_next, _nexts, ("idloop.diagnosis", "idloop.reporting.next_experiment"),
               _names_in(_nexts())),
        Reader("network", ".json", _read_network, _networks, ("idloop.estimation.networks.model",
               "idloop.estimation.networks.model"), _names_in(_networks())),
        Reader("linear", ".json", _read_linear, _linears, ("idloop.estimation.linear.model_file",), share=3.0),
        Reader("message", ".bin", _read_message, _messages, ("idloop_nodes.codec", records), share=4.0),
    ]  # fmt: skip
