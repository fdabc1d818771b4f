"""The pictures: how much longer the others take, and how time and memory grow."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from speed.result import Section
from speed.table import digits, duration

WIDTH, ROW_HEIGHT = 9.0, 0.26
OURS, OTHERS = "#0072b2", "#b0b0b0"


def draw_beside(sections: Sequence[Section], path: Path) -> bool:
    """Bars on a logarithmic axis: the time of each contestant over ours; False where nothing can be compared."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    groups = [
        (section, work)
        for section in sections
        for work in section.shown or dict.fromkeys(row.work for row in section.rows)
    ]
    rows: list[tuple[str, float, str, bool] | None] = []
    for section, work in groups:
        shown = [
            (row, section.ratio(work, row.who))
            for row in section.rows
            if row.work == work and section.ratio(work, row.who) is not None and not row.who.startswith("idloop,")
        ]
        if len(shown) < 2:
            continue
        rows.append((f"{section.title.partition(':')[0].partition(',')[0]}: {work}", 0.0, "", True))
        for row, ratio in shown:
            told = duration(row.seconds) if row.who == "idloop" else f"{digits(float(ratio or 0.0))}×"
            told += ", wrong answer" if row.agrees is False else ""
            rows.append((row.who, float(ratio or 0.0), told, row.who == "idloop"))
    if not rows:
        return False
    figure, axes = plt.subplots(figsize=(WIDTH, ROW_HEIGHT * len(rows) + 0.9), layout="constrained")
    for index, (name, ratio, told, own) in enumerate(row for row in rows if row is not None):
        if not told:
            axes.text(0.0, index, name, transform=axes.get_yaxis_transform(), weight="bold", va="center", fontsize=8)
            continue
        axes.barh(index, ratio, color=OURS if own else OTHERS, height=0.7, left=0)
        axes.text(max(ratio, 1.0) * 1.1, index, told, va="center", fontsize=8)
    labels = ["" if row is None or not row[2] else row[0] for row in rows]
    axes.set_yticks(range(len(rows)), labels, fontsize=8)
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.set_xscale("log")
    axes.set_xlim(0.1, max(row[1] for row in rows if row) * 6.0)
    axes.set_xlabel("time, in multiples of idloop's")
    axes.tick_params(left=False)
    for side in ("top", "right", "left"):
        axes.spines[side].set_visible(False)
    axes.axvline(1.0, color=OURS, linewidth=0.8)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    plt.close(figure)
    return True


def draw_scaling(curves: dict[str, dict[str, Any]], path: Path) -> bool:
    """Time and memory against size, a panel for each curve; False where there is none."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    if not curves:
        return False
    columns = min(len(curves), 3)
    lines = int(np.ceil(len(curves) / columns))
    figure, panels = plt.subplots(
        lines, columns, figsize=(3.4 * columns, 2.7 * lines), layout="constrained", squeeze=False
    )
    for axes in panels.flat[len(curves) :]:
        axes.set_visible(False)
    for axes, (name, curve) in zip(panels.flat, curves.items(), strict=False):
        wide = max(curve["x"], default=1) > 100
        axes.set(xscale="log" if wide else "linear", yscale="log")
        axes.plot(curve["x"], curve["seconds"], "o-", color=OURS, label="time [s]")
        memory = np.array([np.nan if m is None else m for m in curve.get("memory", [])], dtype=float)
        if np.any(memory > 0.0):
            axes.plot(curve["x"], np.maximum(memory, 0.1), "s--", color="#d55e00", label="memory [MB]")
        axes.set_title(name, fontsize=9)
        axes.set_xlabel(curve["label"], fontsize=8)
        axes.tick_params(labelsize=7, which="both")
        axes.legend(fontsize=7)
        axes.grid(alpha=0.3)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    plt.close(figure)
    return True
