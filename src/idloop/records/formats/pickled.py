"""Pickles as data: numbers, texts and containers are built, nothing that they name is imported or called.

Source: Python, *pickle*, "Restricting Globals". Read in a process of its own, whose memory is limited: see `isolated`.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable, Mapping
from typing import Any, BinaryIO

from idloop.errors import InputError
from idloop.records.formats.form import reason_of


class _DataOnly(pickle.Unpickler):
    """Builds what is data; a name stands for one of `known`, or is refused."""

    def __init__(self, stream: BinaryIO, known: Mapping[str, Any], stored: Callable[[Any], Any] | None) -> None:
        super().__init__(stream)
        self._known, self._stored = known, stored

    def find_class(self, module: str, name: str, /) -> Any:
        full = f"{module}.{name}"
        if full not in self._known:
            raise InputError(f"it holds an object of {full}, which is not read: only numbers, texts and tensors are")
        return self._known[full]

    def persistent_load(self, key: Any, /) -> Any:
        if self._stored is None:
            raise InputError("it holds an object of another file, which is not read")
        return self._stored(key)


def read_pickle(
    stream: BinaryIO, known: Mapping[str, Any] | None = None, stored: Callable[[Any], Any] | None = None
) -> Any:
    """Build what the next pickle of a stream holds.

    `known`: what stands for a name that is read, by ``module.name``; every other name is refused.
    `stored`: value of what is kept beside the pickle, by its key; refused by default.
    Raises InputError: damaged, or an object that is no data.
    """
    try:
        return _DataOnly(stream, known or {}, stored).load()
    except InputError:
        raise
    except (EOFError, pickle.UnpicklingError) as error:
        raise InputError("it is cut off" if isinstance(error, EOFError) else f"it is damaged ({error})") from None
    except Exception as error:  # noqa: BLE001 - damaged data fail in any way
        raise InputError(f"it is damaged ({reason_of(error, 80)})") from None
