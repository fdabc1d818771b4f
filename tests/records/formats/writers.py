"""Files of binary forms, written from their public descriptions."""

from __future__ import annotations

import io
import itertools
import pickle
import struct
import zipfile

import numpy as np

_NUMBERS = itertools.count()  # names of what is referred to
STORAGES = {"f8": "DoubleStorage", "f4": "FloatStorage", "i8": "LongStorage", "i4": "IntStorage", "i2": "ShortStorage",
            "i1": "CharStorage", "u1": "ByteStorage", "b1": "BoolStorage", "f2": "HalfStorage"}  # fmt: skip


# PyTorch


def _opcodes(value, storages):
    """Opcodes of protocol 2 that put a value on the stack, as torch writes them."""
    if isinstance(value, np.ndarray):
        key = str(len(storages))
        storages[key] = value
        steps = tuple(size // value.itemsize for size in value.strides)
        name = STORAGES[value.dtype.str[1:]]
        persistent = (
            b"(" + _text("storage") + _global("torch", name) + _text(key) + _text("cpu") + _int(value.size) + b"t"
        )
        call = b"(" + persistent + b"Q" + _int(0) + _ints(value.shape) + _ints(steps) + b"\x89"
        return _global("torch._utils", "_rebuild_tensor_v2") + call + _global("collections", "OrderedDict") + b")RtR"
    if isinstance(value, dict):
        return b"}(" + b"".join(_opcodes(one, storages) for pair in value.items() for one in pair) + b"u"
    if isinstance(value, list):
        return b"](" + b"".join(_opcodes(one, storages) for one in value) + b"e"
    # Without the header and the last opcode.
    return pickle.dumps(value, protocol=2)[2:-1]


def _global(module, name):
    return f"c{module}\n{name}\n".encode()


def _text(text):
    return b"X" + struct.pack("<I", len(text)) + text.encode()


def _int(number):
    return b"J" + struct.pack("<i", number)


def _ints(numbers):
    return b"(" + b"".join(map(_int, numbers)) + b"t"


def torch_archive(content, pickled=None):
    """What torch.save writes since version 1.6."""
    storages = {}
    opcodes = b"\x80\x02" + _opcodes(content, storages) + b"." if pickled is None else pickled
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr("archive/data.pkl", opcodes)
        archive.writestr("archive/byteorder", "little")
        for key, array in storages.items():
            archive.writestr(f"archive/data/{key}", array.tobytes("A"))
        archive.writestr("archive/version", "3\n")
    return file.getvalue()


def torch_legacy(content):
    """What it wrote before."""
    storages = {}
    opcodes = b"\x80\x02" + _opcodes(content, storages) + b"."
    machine = {"protocol_version": 1001, "little_endian": True, "type_sizes": {"short": 2, "int": 4, "long": 4}}
    parts = [pickle.dumps(one, protocol=2) for one in (0x1950A86A20F9469CFC6C, 1001, machine)]
    parts += [opcodes, pickle.dumps(list(storages), protocol=2)]
    parts += [struct.pack("<q", array.size) + array.tobytes("A") for array in storages.values()]
    return b"".join(parts)


# WPILib


def wpilog(entries, records, extra=b""):
    """A data log: entries as (name, type, metadata), records as (entry from 0, stamp in us, value)."""
    parts = [b"WPILOG", struct.pack("<HI", 0x0100, len(extra)), extra]
    for number, (name, type_, metadata) in enumerate(entries, 1):
        texts = b"".join(struct.pack("<I", len(one.encode())) + one.encode() for one in (name, type_, metadata))
        parts.append(wpilog_record(0, 0, b"\0" + struct.pack("<I", number) + texts))
    parts += [wpilog_record(number + 1, stamp, _payload(entries[number][1], value)) for number, stamp, value in records]
    return b"".join(parts)


def wpilog_record(entry, stamp, payload):
    """One record, with as few bytes for its numbers as they need."""
    numbers = [(entry, 4), (len(payload), 4), (stamp, 8)]
    wide = [min(max(1, (number.bit_length() + 7) // 8), most) for number, most in numbers]
    head = (wide[0] - 1) | (wide[1] - 1) << 2 | (wide[2] - 1) << 4
    written = b"".join(number.to_bytes(width, "little") for (number, _), width in zip(numbers, wide, strict=True))
    return bytes([head]) + written + payload


def _payload(type_, value):
    codes = {"double": "<d", "float": "<f", "int64": "<q", "boolean": "<?"}
    if type_ in codes:
        return struct.pack(codes[type_], value)
    if type_ == "double[]":
        return struct.pack(f"<{len(value)}d", *value)
    return value.encode() if isinstance(value, str) else value


# MATLAB 7.3


def mat_hdf5(path, variables):
    """A MAT file of version 7.3: arrays transposed, texts as numbers, cells and structure arrays as references."""
    import h5py

    with h5py.File(path, "w", userblock_size=512) as file:
        references = file.create_group("#refs#")
        for name, value in variables.items():
            _mat_value(file, references, name, value)
    data = bytearray(path.read_bytes())
    data[:128] = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(116) + bytes(8) + b"\x00\x02IM"
    path.write_bytes(data)


def _mat_value(group, references, name, value):
    import h5py

    kind, empty = np.bytes_, False
    if isinstance(value, dict):
        inner = group.create_group(name)
        inner.attrs["MATLAB_class"] = kind("struct")
        for key, one in value.items():
            _mat_value(inner, references, key, one)
        return
    if isinstance(value, str):
        characters = np.array([[ord(one)] for one in value] or [[0]], dtype=np.uint16)
        data = group.create_dataset(name, data=characters)
        class_, empty = "char", not value
    elif isinstance(value, list) and all(isinstance(one, dict) for one in value):
        inner = group.create_group(name)
        inner.attrs["MATLAB_class"] = kind("struct")
        for key in value[0]:
            _cells(inner, references, key, [one[key] for one in value])
        return
    elif isinstance(value, list):
        data = _cells(group, references, name, value)
        class_ = "cell"
    else:
        array = np.atleast_2d(np.asarray(value))
        array = array.T if np.ndim(value) == 1 else array  # a column
        class_ = "logical" if array.dtype == bool else {"float64": "double", "float32": "single"}.get(
            array.dtype.name, array.dtype.name)  # fmt: skip
        data = group.create_dataset(name, data=array.astype(np.uint8).T if array.dtype == bool else array.T)
    data.attrs["MATLAB_class"] = kind(class_)
    if empty:
        data.attrs["MATLAB_empty"] = np.uint8(1)
    assert isinstance(data, h5py.Dataset)


def _cells(group, references, name, values):
    import h5py

    found = []
    for value in values:
        key = f"r{next(_NUMBERS)}"
        _mat_value(references, references, key, value)
        found.append(references[key].ref)
    return group.create_dataset(name, data=np.array([[one] for one in found], dtype=h5py.ref_dtype))


# MATLAB objects: each (class, properties, whether a method of its own saved it); a value is an array, a text, a list
# (of cells), a mapping (a structure) or the number of another object as `Ref`.


class Ref(int):
    """Number of an object, from 1."""


def object_numbers(number, class_number):
    """What a variable holds that is one object."""
    return np.array([[0xDD000000], [2], [1], [1], [number], [class_number]], dtype=np.uint32)


def subsystem_cells(objects):
    """Cells in which the properties of objects lie, and the number of each one's class."""
    names, values = [], []

    def index(name):
        if name not in names:
            names.append(name)
        return names.index(name) + 1

    classes = list(dict.fromkeys(class_ for class_, _, _ in objects))
    numbers = [classes.index(class_) + 1 for class_, _, _ in objects]
    class_table = struct.pack("<4i", 0, 0, 0, 0) + b"".join(struct.pack("<4i", 0, index(one), 0, 0) for one in classes)
    object_table, tables, counts = struct.pack("<6i", *[0] * 6), {True: bytes(8), False: bytes(8)}, {True: 0, False: 0}
    for place, (_, properties, saved) in enumerate(objects):
        counts[saved] += 1
        ids = (counts[saved], 0) if saved else (0, counts[saved])
        object_table += struct.pack("<6i", numbers[place], 0, 0, *ids, place + 1)
        block = struct.pack("<i", len(properties))
        for name, value in properties.items():
            block += struct.pack("<3i", index(name), 1, len(values))
            values.append(value)
        tables[saved] += block + bytes(-len(block) % 8)
    texts = b"".join(name.encode() + b"\0" for name in names)
    texts += bytes(-len(texts) % 8)
    places, place = [], 40 + len(texts)
    for table in (class_table, tables[True], object_table, tables[False]):
        places.append(place)
        place += len(table)
    places += [place] * 4
    head = struct.pack("<10i", 4, len(names), *places)
    data = head + texts + class_table + tables[True] + object_table + tables[False]

    def resolved(value):
        if isinstance(value, Ref):
            return object_numbers(int(value), numbers[value - 1])
        if isinstance(value, dict):
            return {key: resolved(one) for key, one in value.items()}
        return [resolved(one) for one in value] if isinstance(value, list) else value

    cells = [np.frombuffer(data, dtype=np.uint8)[None], np.zeros((0, 0)), *map(resolved, values)]
    return cells, numbers


def mat_objects_hdf5(path, variables, objects):
    """A file of version 7.3 whose variables are objects (a name and a number each)."""
    import h5py

    cells, numbers = subsystem_cells(objects)
    mat_hdf5(path, {"plain": np.arange(3.0)})
    with h5py.File(path, "a") as file:
        wrapper = _cells(file.create_group("#subsystem#"), file["#refs#"], "MCOS", cells)
        wrapper.attrs["MATLAB_class"], wrapper.attrs["MATLAB_object_decode"] = np.bytes_("FileWrapper__"), np.int32(3)
        for name, number in variables.items():
            data = file.create_dataset(name, data=object_numbers(number, numbers[number - 1]).T)
            data.attrs["MATLAB_class"] = np.bytes_(objects[number - 1][0])
            data.attrs["MATLAB_object_decode"] = np.int32(3)


def mat_objects(path, variables, objects):
    """A file of version 5 to 7 with the same."""
    from scipy.io import savemat

    cells, numbers = subsystem_cells(objects)

    def element(kind, data):
        return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)

    def opaque(name, class_, content):
        texts = b"".join(element(1, one.encode()) for one in (name, "MCOS", class_) if one is not None)
        return element(14, element(6, struct.pack("<II", 17, 0)) + texts + content)

    def variable(value):
        file = io.BytesIO()
        savemat(file, {"x": value})
        return file.getvalue()[128:]

    wrapper = opaque("", "FileWrapper__", variable(_in_cells(cells)))
    names = element(5, struct.pack("<i", 5)) + element(1, b"MCOS\0")
    head = element(6, struct.pack("<II", 2, 0)) + element(5, struct.pack("<ii", 1, 1)) + element(1, b"")
    inner = b"\x00\x01IM" + bytes(4) + element(14, head + names + wrapper)
    data = element(6, struct.pack("<II", 9, 0)) + element(5, struct.pack("<ii", 1, len(inner))) + element(1, b"")
    whole = io.BytesIO()
    savemat(whole, {"plain": np.arange(3.0)})
    content = whole.getvalue()
    for name, number in variables.items():
        content += opaque(name, objects[number - 1][0], variable(object_numbers(number, numbers[number - 1])))
    path.write_bytes(content + element(14, data + element(2, inner)))


def _in_cells(value):
    """A value with a cell array for each list."""
    if isinstance(value, dict):
        return {key: _in_cells(one) for key, one in value.items()}
    if not isinstance(value, list):
        return value
    box = np.empty((len(value), 1), dtype=object)
    for place, one in enumerate(value):
        box[place, 0] = _in_cells(one)
    return box
