"""The forms of log files that are read, and which of them a file is."""

from __future__ import annotations

import re
from pathlib import Path

from idloop.errors import InputError
from idloop.records.formats import (
    arrow,
    blocks,
    echo,
    hdf5,
    json_file,
    labels,
    mat,
    mcap_json,
    numpy_arrays,
    tool_exports,
    torch_file,
    wpilog,
)
from idloop.records.formats.form import TEXT, Form, text_of
from idloop.spelling import check_known, listed

# In the order in which a file is held against them: what begins with a sign of its own first.
FORMS: tuple[Form, ...] = (
    mat.FORM, hdf5.FORM, arrow.PARQUET, arrow.FEATHER, numpy_arrays.FORM, numpy_arrays.ONE, torch_file.FORM,
    wpilog.FORM, mcap_json.FORM, tool_exports.CODESYS, tool_exports.LABVIEW, tool_exports.TWINCAT,
    tool_exports.TEKTRONIX,
    json_file.SYSID, json_file.LINES, json_file.FORM, blocks.FORM, echo.FORM, labels.FORM,
)  # fmt: skip
_ALL = (TEXT, *FORMS)
_BINARY = ("mat", "hdf5", "parquet", "feather", "npz", "npy", "torch", "wpilog")
HEAD = 1 << 16
_WORKBOOK = (
    "a workbook of Excel; save its sheet as CSV, there or by pandas.read_excel('x.xlsx').to_csv('x.csv', index=False)"
)
_PICKLE = (
    "a pickle of Python, which may run any code and is never opened; where it was made, save its arrays by"
    " numpy.savez('x.npz', **arrays), or a frame of pandas by frame.to_parquet('x.parquet')"
)
_FRAMES = "raw frames of a CAN bus; export the signals that they carry, decoded by the DBC file of the drive, as CSV"
# Texts without signals: as candump prints them, and as SavvyCAN and other loggers write them.
_TEXTS = (
    (re.compile(r"\s*(\(\d+\.\d+\)\s+)?\w+\s+[0-9A-F]{3,8}(#|\s+\[\d+\]\s)"), _FRAMES),
    (re.compile(r"[^\n]*\b(CAN[ _]?)?ID\b[^\n]*\b(LEN|DLC)\b[^\n]*\b(D1|DATA)", re.IGNORECASE), _FRAMES),
)
# What other files begin with, and what to do with them.
_OTHERS = (
    (b"\x1f\x8b", "a gzip archive; unpack it with gunzip"),
    (b"\xfd7zXZ\0", "an xz archive; unpack it with unxz"),
    (b"BZh", "a bzip2 archive; unpack it with bunzip2"),
    (b"\x28\xb5\x2f\xfd", "a zstd archive; unpack it with unzstd"),
    (b"7z\xbc\xaf\x27\x1c", "a 7z archive; unpack it"),
    (b"\xd0\xcf\x11\xe0", _WORKBOOK),
    (b"SQLite format 3\0", "an SQLite file; a rosbag2 recording of it is read with its suffix .db3"),
    (b"MDF ", "a measurement file of a Vector or ETAS tool; export it as CSV, MAT or Parquet, there or by asammdf"),
    (b"TDSm", "a TDMS file of LabVIEW; save it as .lvm or CSV, or read it by nptdms and write CSV"),
    (b"ULog\x01\x12\x35", "a log of PX4; turn its topics into CSV by ulog2csv of pyulog"),
    *((bytes((0x80, protocol)), _PICKLE) for protocol in range(2, 6)),
)


def form_of(path: Path, kind: str | None = None) -> Form:
    """Return the form of a file: `kind` where it is known, by its first bytes, else by its suffix.

    Raises InputError: it is none of those that are read.
    """
    known = {form.kind: form for form in _ALL}
    if kind is not None:
        check_known(kind, known, f"{path}: unknown format", 20)
        return known[kind]
    with path.open("rb") as stream:
        head = stream.read(HEAD)
    for form in FORMS:
        if form.sniff(head):
            return form
    if len(head) == HEAD and TEXT.sniff(head):
        for form in FORMS:
            if form.sniff_on(path):
                return form
    if head.startswith(b"PK\x03\x04") and b"xl/" in head:
        raise InputError(f"{path}: {_WORKBOOK}")
    for begin, advice in _OTHERS:
        if head.startswith(begin):
            raise InputError(f"{path}: {advice}")
    for text, advice in _TEXTS:
        if text.match(text_of(head)):
            raise InputError(f"{path}: {advice}")
    name = path.name.lower()
    by_suffix = [(len(suffix), form) for form in known.values() for suffix in form.suffixes if name.endswith(suffix)]
    if by_suffix:
        found = max(by_suffix, key=lambda one: one[0])[1]
        # As `save -ascii x.mat` of MATLAB writes it.
        return TEXT if found.kind in _BINARY and TEXT.sniff(head) else found
    if TEXT.sniff(head):
        return TEXT
    raise InputError(
        f"{path}: unknown format {path.suffix!r}; known are {listed(suffixes(), 40)}, or set `format:` in the mapping"
    )


def table_of_forms() -> str:
    """Return all forms as a table of a page: file, `format`, columns."""
    rows = ["| file | `format` | columns |", "|---|---|---|"]
    for form in _ALL:
        names = ", ".join(f"`{suffix}`" for suffix in form.suffixes)
        rows.append(f"| {form.about}{': ' if names else ''}{names} | `{form.kind}` | {form.columns} |")
    return "\n".join(rows)


def suffixes() -> list[str]:
    """Return the suffixes of all forms."""
    return [suffix for form in _ALL for suffix in form.suffixes]


def kinds() -> list[str]:
    """Return the names of all forms."""
    return [form.kind for form in _ALL]
