"""A loop in the drive whose gains were logged beside its set-points, as in the protocol of the MIT mini cheetah."""

from __future__ import annotations

from collections.abc import Mapping as Map

import numpy as np

from idloop.records.recognition.guess import Given, Guess, quoted
from idloop.records.recognition.roles import is_feed_forward
from idloop.records.recognition.table_column import TableColumn

_GAINS = (("kp", "position", "reference"), ("kd", "velocity", "reference velocity"))


def loop_beside_command(columns: Map[str, TableColumn], chosen: Map[str, Guess], given: Map[str, Given]) -> list[str]:
    """Return the option with the force of drive that adds a loop to what it was sent, none where no loop acted.

    The drive makes ``kp (p_des - p) + kd (v_des - v) + t_ff``.
    """
    command = chosen.get("command")
    if command is None or given.get("command", Given()).column:
        return []
    terms = []
    for name, motion, wanted in _GAINS:
        gain = next((one for one in columns.values() if one.parsed.words == (name,)), None)
        measured = chosen.get(motion)
        if gain is None or measured is None or not np.nan_to_num(gain.value).any():
            continue
        if set(measured.options) - {"scale"}:
            return []
        target = next((one for one in columns.values() if one.by_name.role == wanted), None)
        error = f"{quoted(target.name)} - " if target is not None else "-"
        terms.append(f"{quoted(gain.name)} * ({error}{quoted(measured.column)})")
    if not terms:
        return []
    fed = next((one for one in columns.values() if is_feed_forward(one.parsed)), None)
    terms += [quoted(fed.name)] if fed is not None and np.nan_to_num(fed.value).any() else []
    text = "command: the gains of a loop in the drive are on record, which adds to what was sent; as one command:"
    return [f"{text} --command '{' + '.join(terms)}={command.unit or 'UNIT'}'"]
