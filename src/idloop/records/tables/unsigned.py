"""Signed integers that were stored as unsigned ones."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from idloop.errors import InputError

Floats = NDArray[np.float64]

_BITS = {"int8": 8, "int16": 16, "int32": 32}


def twos_complement(raw: Floats, kind: str) -> Floats:
    """Read unsigned values as two's complement of 8, 16 or 32 bits (65535 of int16 is -1); NaN stays NaN.

    Values that are negative already pass unchanged.
    """
    span = 2.0 ** _BITS[kind]
    _check_integers(raw, span, kind)
    return np.where(raw >= span / 2, raw - span, raw)


def sign_magnitude(raw: Floats, sign_bit: int) -> Floats:
    """Read values whose bit `sign_bit` (from 0) means negative, the bits below being the magnitude; NaN stays NaN."""
    sign = 2.0**sign_bit
    _check_integers(raw, 2 * sign, f"sign bit {sign_bit}")
    return np.where(raw >= sign, -(raw - sign), raw)


def _check_integers(raw: Floats, span: float, what: str) -> None:
    known = raw[np.isfinite(raw)]
    if np.any(known != np.round(known)) or np.any(np.abs(known) >= span):
        bad = known[(known != np.round(known)) | (np.abs(known) >= span)][0]
        raise InputError(f"decode {what}: value {bad:g} is no such integer; check column and decode in the mapping")
