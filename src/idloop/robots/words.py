"""An identified robot in words: its joints, what each lacks, its links, its payload."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from idloop.estimation.statistics.interval_text import interval_text
from idloop.p_values import p_value_text
from idloop.physics.parameter import NORMAL_95
from idloop.reporting.text.blocks import Block, Table, number
from idloop.reporting.verdicts import VERDICTS


def robot_blocks(document: Mapping[str, Any]) -> Iterator[Block]:
    """Yield the parts of the summary of a document of schema ``idloop/robot/1``."""
    yield from (f"note: {text}" for text in document["findings"])
    yield joint_table(document)
    use = "unseen" if any(one["unseen"] for one in document["records"]) else "fitted"
    false_alarms = f"{100.0 * document['level']:g} % false alarms over all joints"
    yield f"(torque errors of the {use} records where the joint moves; {false_alarms})"
    for joint in document["joints"]:
        yield from _joint(joint)
    yield ""
    yield link_table(document)
    base = document["base"]
    yield (
        f"{len(base)} base parameters are determined by the data, condition number {document['condition']:.3g};"
        " what they leave open is that of the URDF"
    )
    payload = document["payload"]
    if payload is not None:
        yield ""
        yield from payload_lines(payload)
    if document["excite"]:
        yield ""
        yield from (f"next: {text}" for text in document["excite"])


def joint_table(document: Mapping[str, Any]) -> Table:
    """Table with a row for each joint."""
    rows = []
    for joint in document["joints"]:
        judged = judged_error(joint)
        values = {key.partition(".")[2]: one["value"] for key, one in joint["parameters"].items()}
        dry = values.get("level", values.get("coulomb"))
        missing = ", ".join(one["effect"].partition("@")[0] for one in joint["added"]) or "-"
        relative = f"{100.0 * judged['relative']:.2g} %" if joint["moves"] else "-"
        error = (number(judged["rms"], 3), joint["unit"], relative)
        own = (number(one, 4) for one in (values.get("inertia"), values.get("viscous_friction"), dry))
        rows.append((joint["name"], missing, joint["verdict"], *error, *own))
    header = ("joint", "missing effects", "verdict", "torque error", "unit", "of torque", "inertia", "viscous", "dry")
    return Table.of(header, rows)


def judged_error(joint: Mapping[str, Any]) -> dict[str, Any]:
    """Torque error of a joint on all unseen records, or on the fitted ones where there are none."""
    errors = [one for one in joint["errors"] if one["unseen"]] or joint["errors"]
    return {
        key: (sum(one[key] ** 2 for one in errors) / len(errors)) ** 0.5 for key in ("rms", "relative", "rigid_rms")
    }


def _joint(joint: Mapping[str, Any]) -> Iterator[Block]:
    if not joint["moves"]:
        yield f"{joint['name']}: it hardly moves, so nothing of its own is determined"
    elif joint["added"] or joint["conclusion"] != VERDICTS["adequate"]:
        yield ""
        yield f"{joint['name']}: {joint['conclusion']}"
    for one in joint["added"]:
        yield f"  + {one['effect']}, p {p_value_text(one['p_value'])}: {one['text']}"
        yield from (f"    {line}" for line in effect_lines(joint, one["effect"]))
        if one["rivals"]:
            yield f"    this data cannot tell it from {', '.join(one['rivals'])}"
    if joint["where"] and joint["verdict"] != "adequate":
        yield f"  where it fails: {joint['where']}"


def effect_lines(joint: Mapping[str, Any], effect: str) -> Iterator[str]:
    """Yield the parameters of an effect: those that were estimated, and those that were chosen."""
    yield from parameter_lines(joint, [key for key in joint["parameters"] if key.startswith(f"{effect}.")])
    for key, value in joint["chosen"].items():
        if key.startswith(f"{effect}."):
            yield f"{key.rpartition('.')[2]} {number(value)}"


def parameter_lines(joint: Mapping[str, Any], names: list[str]) -> Iterator[str]:
    """Yield name, value and interval of parameters of a joint."""
    for name in names:
        one = joint["parameters"][name]
        low, high = one["interval"]
        interval = "not determined" if low is None else interval_text(low, high)
        yield f"{name.rpartition('.')[2]} {number(one['value'])} ({interval}) {one['unit']}".rstrip(" -")


def link_table(document: Mapping[str, Any]) -> Table:
    """Table of the links' masses and centres of mass."""
    rows = [
        (name, number(one["mass"], 4), *(number(round(value, 6) + 0.0, 3) for value in one["centre"]))
        for name, one in document["links"].items()
    ]
    return Table.of(("link behind", "mass kg", "centre x m", "y", "z"), rows)


def payload_lines(payload: Mapping[str, Any]) -> Iterator[str]:
    """Yield the payload's mass and centre of mass."""
    mass, error = payload["mass"], NORMAL_95 * payload["mass_stderr"]
    yield f"payload at {payload['joint']}: mass {mass:.4g} kg ({interval_text(mass - error, mass + error)})"
    for axis, value, stderr in zip("xyz", payload["centre"], payload["centre_stderr"], strict=True):
        low, high = value - NORMAL_95 * stderr, value + NORMAL_95 * stderr
        yield f"  centre of mass {axis} {value:.3g} m ({interval_text(low, high)})"
