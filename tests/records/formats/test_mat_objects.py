"""Objects of MATLAB become columns with their stamps, whatever the version of the file; others are named."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
from tests.records.formats.writers import Ref, mat_objects, mat_objects_hdf5

from idloop.errors import InputError
from idloop.records.tables.table_files import read_table

T, U = np.arange(5.0)[:, None] * 0.01, np.array([[1.0], [-1.0], [0.5], [0.0], [2.0]])
TEXT = "motor speed".encode("utf-16-le")
STRING = np.frombuffer(np.array([1, 2, 1, 1, 11], dtype="<u8").tobytes() + TEXT + bytes(-len(TEXT) % 8), dtype="<u8")


def _timetable(times):
    inner = {"data": [U, 2.0 * U], "varNames": ["u", "speed"], "varUnits": ["V", "rpm"], "rowTimes": times,
             "numRows": np.array([[5.0]])}  # fmt: skip
    return ("timetable", {"any": inner}, True)


OBJECTS = [
    _timetable(Ref(2)),  # 1
    ("duration", {"millis": T * 1000.0}, False),
    _timetable({"origin": Ref(4), "stepSize": np.zeros((0, 0)), "sampleRate": np.array([[100.0]])}),  # 3
    ("duration", {"millis": np.array([[2000.0]])}, False),
    ("timeseries", {"Data_": U, "Time_": T, "DataInfo": {"Units": "rad/s"}, "Name": "speed"}, False),  # 5
    ("timeseries", {"Data_": U, "Time_": np.zeros((0, 0)), "TimeInfo": Ref(7)}, False),  # 6
    ("tsdata.timemetadata", {"Start": np.array([[1.0]]), "Increment": np.array([[0.5]])}, False),
    ("table", {"data": [T, U], "varnames": ["t", "u"], "props": {"VariableUnits": ["s", "A"]}}, False),  # 8
    ("string", {"any": STRING[None]}, True),  # 9
    ("Bench", {"speed": Ref(5), "Kp": np.array([[2.5]]), "itself": Ref(10)}, False),  # 10
    ("categorical", {"categoryNames": ["off", "on"], "codes": np.array([[1], [2], [2]], dtype=np.uint8)}, False),  # 11
]
VARIABLES = {"tt": 1, "even": 3, "speed": 5, "steps": 6, "tab": 8, "note": 9, "bench": 10, "state": 11}
WRITERS = [mat_objects, mat_objects_hdf5]


@pytest.mark.parametrize("write", WRITERS)
def test_objects(tmp_path, write):
    write(tmp_path / "log.mat", VARIABLES, OBJECTS)
    table = read_table(tmp_path / "log.mat")
    assert table.notes == []
    time, values = T.ravel(), U.ravel()
    clocks = {"tt.u": "tt.Time", "even.speed": "even.Time", "speed.Data": "speed.Time", "tab.u": "tab.t",
              "steps.Data": "steps.Time", "bench.speed.Data": "bench.speed.Time"}  # fmt: skip
    for name, clock in clocks.items():
        assert table.clocks[name] == clock
        np.testing.assert_array_equal(table.numbers(name), 2.0 * values if name == "even.speed" else values)
    np.testing.assert_allclose(table.numbers("tt.Time"), time)
    np.testing.assert_allclose(table.numbers("even.Time"), 2.0 + time)
    np.testing.assert_allclose(table.numbers("steps.Time"), 1.0 + 0.5 * np.arange(5.0))
    assert {"tt.u": "V", "tt.speed": "rpm", "tab.u": "A", "speed.Data": "rad/s"}.items() <= table.units.items()
    assert table.raw("state") == ["off", "on", "on"]
    assert table.attributes["note"] == "motor speed"
    assert table.attributes["bench.Kp"] == 2.5
    np.testing.assert_array_equal(table.numbers("plain"), [0.0, 1.0, 2.0])


def _logged(*values):
    """Signals of Simulink, of which only the paths of their blocks say what they are."""
    blocks = ("model/bench//axis/Drive Command", "model/rad//s")
    elements = [{"Name": "", "BlockPath": [block], "Values": one} for block, one in zip(blocks, values, strict=True)]
    storage = ("MatFileDatasetStorage", {"any": {"Elements": elements}}, True)
    return [("Dataset", {"any": {"Name": "data", "Storage": Ref(2)}}, True), storage]


@pytest.mark.parametrize("write", WRITERS)
def test_signals_that_simulink_has_logged(tmp_path, write):
    write(tmp_path / "log.mat", {"data": 1}, _logged({"Time": T, "Data": U}, {"Time": T, "Data": 2.0 * U}))
    table = read_table(tmp_path / "log.mat")
    names = ("data.Drive Command", "data.[rad/s]")
    assert table.clocks == {f"{name}.Data": f"{name}.Time" for name in names}
    np.testing.assert_array_equal(table.numbers("data.[rad/s].Data"), 2.0 * U.ravel())


def test_signals_that_simulink_has_logged_into_a_file(tmp_path):
    """Their values lie apart, as bytes; even stamps are a first one, a step and a number."""
    stamps, kinds = np.array([1.0, 0.5, 5.0]), ("double", "single")
    apart = [
        {"CompressedTime": stamps, "DataR2": np.array([[float(k)]]), "SignalAttributes": {"ClassName": kind}}
        for k, kind in enumerate(kinds)
    ]
    mat_objects_hdf5(tmp_path / "log.mat", {"data": 1}, _logged(*apart))
    with h5py.File(tmp_path / "log.mat", "a") as file:
        for place, (kind, values) in enumerate(zip(kinds, (U, np.hstack([U, -U])), strict=True)):
            raw = np.frombuffer(values.astype(kind).tobytes(), dtype=np.uint8)
            file.create_dataset(f"#sigstream#/{place}/#data#", data=raw)
    table = read_table(tmp_path / "log.mat")
    np.testing.assert_array_equal(table.numbers("data.Drive Command.Data"), U.ravel())
    np.testing.assert_array_equal(table.numbers("data.[rad/s].Data[1]"), -U.ravel())
    np.testing.assert_array_equal(table.numbers("data.[rad/s].Time"), 1.0 + 0.5 * np.arange(5.0))


@pytest.mark.parametrize("write", WRITERS)
def test_what_is_not_read_is_named(tmp_path, write):
    write(tmp_path / "log.mat", {"tt": 1}, [_timetable({"origin": Ref(1)})])
    (note,) = read_table(tmp_path / "log.mat").notes
    assert note.startswith("'tt' is an object that only MATLAB reads")


@pytest.mark.parametrize("write", WRITERS)
@pytest.mark.parametrize("place", [0.3, 0.5, 0.6, 0.7, 0.8, 0.9])
def test_damaged_files(tmp_path, write, place):
    write(tmp_path / "log.mat", VARIABLES, OBJECTS)
    data = bytearray((tmp_path / "log.mat").read_bytes())
    at = int(place * len(data))
    for start in range(at, at + 120, 8):
        changed = data[:start] + b"\xff\xff\xff\x7f" + data[start + 4 :]
        (tmp_path / "log.mat").write_bytes(changed)
        try:
            read_table(tmp_path / "log.mat")
        except InputError as error:
            assert "\n" not in str(error)  # noqa: PT017 - it may also be read
