"""The libraries of the optional extra `fleet`, imported where they are needed."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from idloop.errors import InputError

# Module: its name on PyPI and what it does here.
NEEDED = {
    "distributed": ("distributed", "runs the work in processes"),
    "duckdb": ("duckdb", "reads the results"),
    "fsspec": ("fsspec", "opens addresses"),
    "pyarrow.parquet": ("pyarrow", "writes the results"),
    "statsmodels.stats.meta_analysis": ("statsmodels", "combines the results"),
}


def library(name: str) -> Any:
    """Import a module of `NEEDED`. Raises InputError: it is not installed."""
    try:
        return import_module(name)
    except ImportError as error:
        package, use = NEEDED[name]
        raise InputError(f"{package}, which {use} of a fleet, is not installed: pip install 'idloop[fleet]'") from error
