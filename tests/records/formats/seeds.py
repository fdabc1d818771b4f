"""Small valid files of every form, to be damaged."""

from __future__ import annotations

import io
import json
import tempfile
from functools import cache
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType, Writer
from tests.records.formats.writers import (
    Ref,
    mat_hdf5,
    mat_objects,
    mat_objects_hdf5,
    torch_archive,
    torch_legacy,
    wpilog,
)

T = np.arange(1, 41) * 0.005
SIGNALS = {"t": T, "u": np.sign(np.sin(90.0 * T)), "angle": np.sin(50.0 * T), "speed": np.cos(50.0 * T)}
ROWS = list(zip(*SIGNALS.values(), strict=True))


def _bytes(write):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "file"
        write(path)
        return path.read_bytes()


def _hdf5(path, version):
    import h5py

    with h5py.File(path, "w", libver=version) as file:
        for name, values in SIGNALS.items():
            file.create_dataset(f"run/{name}", data=values, chunks=(16,), compression="gzip", shuffle=True)
            file[f"run/{name}"].attrs["units"] = "V"
        file["table"] = np.array(ROWS[:8], dtype=[(name, "f8") for name in SIGNALS])
        file["names"] = ["one", "two"]


def _parquet(path, compression):
    import pyarrow as pa
    from pyarrow import parquet

    parquet.write_table(
        pa.table(SIGNALS | {"state": ["on"] * len(T)}), path, compression=compression, row_group_size=16
    )


def _arrow(path, compression):
    import pyarrow as pa
    from pyarrow import feather

    feather.write_feather(pa.table(SIGNALS | {"state": ["on"] * len(T)}), path, compression=compression)


def _wpilog():
    entries = [("u", "double", "Volt"), ("angle", "float", ""), ("speed", "double[]", ""), ("n", "int64", ""),
               ("sysid-test-state-axis", "string", ""), ("/.schema/struct:P", "structschema", ""),
               ("p", "struct:P", "")]  # fmt: skip
    records = [(5, 0, "double x;double y"), (4, 0, "dynamic-forward")]
    for k, (t, u, angle, speed) in enumerate(ROWS):
        stamp = int(t * 1e6)
        records += [
            (0, stamp, u),
            (1, stamp, angle),
            (2, stamp, [speed, -speed]),
            (3, stamp, k),
            (6, stamp, b"\0" * 16),
        ]
    return wpilog(entries, [*records, (4, 300_000, "none")])


def _mcap(path, compression):
    with path.open("wb") as file:
        writer = Writer(file, compression=compression)
        writer.start("", "a logger")
        state = writer.register_channel("/state", "json", 0)
        for t, u, angle, speed in ROWS:
            content = json.dumps({"u": u, "angle": angle, "speed": [speed, -speed]}).encode()
            writer.add_message(state, int(1e9 * t), content, int(1e9 * t))
        writer.finish()


def _codesys():
    text = "[key]; [value]\nVersion; 0x03050000\n"
    for k, (name, values) in enumerate(SIGNALS.items()):
        text += f"{k}.Variable; GVL.{name}\n{k}.Class; 14\n{k}.Data; \n"
        text += "".join(f"; {row}; {value:.6g}\n" for row, value in enumerate(values))
    return text.encode()


def _twincat():
    names, periods, units = (";".join(f"{key};{value}" for value in values) for key, values in (
        ("Name", SIGNALS), ("SampleTime[ms]", [2] * len(SIGNALS)), ("Unit", ["Nm"] * len(SIGNALS))))  # fmt: skip
    rows = (";".join(f"{2 * k};{value:.6g}" for value in row) for k, row in enumerate(ROWS))
    return "\n".join(["Name;Bench", names, periods, units, *rows]).encode()


def _tektronix():
    keys = ["Record Length,100,Points", "Source,CH1,", "Vertical Units,V,"]
    rows = (f"{0.01 * k:.6g},{value:.6g}" for k, value in enumerate(next(iter(SIGNALS.values()))))
    return "\n".join(f"{keys[k] if k < len(keys) else ',,'},{row}" for k, row in enumerate(rows)).encode()


def _lvm():
    rows = "\n".join("\t".join(f"{v:.6g}" for v in row) for row in ROWS)
    return (
        "LabVIEW Measurement\t\nSeparator\tTab\nDecimal_Separator\t.\n***End_of_Header***\t\n\t\nChannels\t3\n"
        f"X_Dimension\tTime\tTime\tTime\n***End_of_Header***\t\t\t\nX_Value\tu\tangle\tspeed\tComment\n{rows}\n"
    ).encode()


def _message(row):
    t, u, angle, _ = row
    stamp = f"stamp:\n  sec: 1\n  nanosec: {t * 1e9:.0f}\n"
    return f"{stamp}position:\n- {angle:.6g}\n- 0.5\neffort: [{u:.6g}]\n---\n"


def _mat_hdf5(path):
    mat_hdf5(path, {"log": SIGNALS, "cells": ["a", "bc"], "name": "x"})


def _mat_objects():
    inner = {"data": [SIGNALS["u"][:, None], SIGNALS["angle"][:, None]], "varNames": ["u", "angle"], "rowTimes": Ref(2)}
    objects = [("timetable", {"any": inner}, True), ("duration", {"millis": 1000.0 * T[:, None]}, False)]
    return [lambda path, write=write: write(path, {"tt": 1}, objects) for write in (mat_objects, mat_objects_hdf5)]


def _several(write, *variants):
    return [_bytes(lambda path, one=one: write(path, one)) for one in variants]


def _npy(array):
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


def _npz():
    file = io.BytesIO()
    np.savez_compressed(file, **SIGNALS)
    return file.getvalue()


def _mat():
    from scipy.io import savemat

    file = io.BytesIO()
    savemat(file, {"log": SIGNALS, "gain": 2.5}, do_compression=True)
    return file.getvalue()


@cache
def seeds() -> dict[str, tuple[str, list[bytes]]]:
    """Suffix and valid files of each form."""
    samples = [dict(zip(SIGNALS, row, strict=True)) | {"list": [1, 2]} for row in ROWS]
    tests = {name: [list(row) for row in ROWS] for name in ("slow-forward", "fast-backward")}
    series = {name: list(values) for name, values in SIGNALS.items()}
    blocks = "".join(f"{name}\n" + "".join(f"{t:.6g},{v:.6g}\n" for t, v in zip(T, values, strict=True))
                     for name, values in SIGNALS.items())  # fmt: skip
    rows = "\n".join(",".join(f"{v:.6g}" for v in row) for row in ROWS)
    return {
        "csv": (".csv", [f"{','.join(SIGNALS)}\n{rows}\n".encode()]),
        "mat": (".mat", [_mat(), _bytes(_mat_hdf5), *map(_bytes, _mat_objects())]),
        "hdf5": (".h5", _several(_hdf5, "earliest", "latest")),
        "parquet": (".parquet", _several(_parquet, "snappy", "none")),
        "feather": (".feather", _several(_arrow, "lz4", "uncompressed")),
        "npz": (".npz", [_npz()]),
        "npy": (".npy", [_npy(np.array(ROWS)), _npy(np.array(ROWS, dtype=[(name, "f8") for name in SIGNALS]))]),
        "torch": (".pt", [torch_archive(SIGNALS | {"gain": 2.5}), torch_legacy(SIGNALS)]),
        "wpilog": (".wpilog", [_wpilog()]),
        "mcap_json": (".mcap", _several(_mcap, CompressionType.NONE, CompressionType.ZSTD)),
        "codesys": (".trace.csv", [_codesys()]),
        "lvm": (".lvm", [_lvm()]),
        "twincat": (".csv", [_twincat()]),
        "tektronix": (".csv", [_tektronix()]),
        "sysid": (".json", [json.dumps(tests | {"units": "Rotations"}).encode()]),
        "jsonl": (".jsonl", ["\n".join(map(json.dumps, samples)).encode()]),
        "json": (".json", [json.dumps(samples).encode(), json.dumps(series).encode()]),
        "blocks": (".txt", [blocks.encode()]),
        "echo": (".txt", ["".join(map(_message, ROWS)).encode()]),
        "labels": (".txt", ["\n".join(",".join(map("{}:{:.6g}".format, SIGNALS, row)) for row in ROWS).encode()]),
    }  # fmt: skip
