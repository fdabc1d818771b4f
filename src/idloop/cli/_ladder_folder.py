"""The folder of a ladder: model, steps, figures, the next experiment; written, read, never overwritten unasked."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from idloop.cli._common import to_json
from idloop.cli._diagnosis import experiment_text, write_text
from idloop.errors import IdloopError, InputError

if TYPE_CHECKING:
    from idloop.diagnose import Ladder
    from idloop.diagnose.suggest import Suggestion
    from idloop.physics import Model
    from idloop.records import Record

FILES = ("model.yaml", "ladder.json", "ladder.png", "compare.png", "next.yaml", "next.png")


@dataclass(frozen=True)
class Kept:
    """A ladder as it lies in its folder.

    Attributes
    ----------
    ladder : Ladder
    bags, validate : tuple of Path
        What it was climbed on.
    folder : Path or None
        Of the model file, where effects of the user's own lie.
    """

    ladder: Ladder
    bags: tuple[Path, ...] = ()
    validate: tuple[Path, ...] = ()
    folder: Path | None = field(default=None)


def check_target(folder: Path, *, overwrite: bool) -> None:
    """Refuse a folder that cannot be written or holds a ladder already, before the work is done.

    Raises
    ------
    InputError
        A file of that name, no folder above it, or files that would be overwritten.
    """
    if folder.exists() and not folder.is_dir():
        raise InputError(f"--output {folder}: this is a file, name a folder")
    if not folder.parent.is_dir():
        raise InputError(f"--output {folder}: there is no folder {folder.parent}, make it first")
    there = [name for name in FILES if (folder / name).exists()]
    if there and not overwrite:
        raise InputError(f"--output {folder}: {', '.join(there)} are there already, name another folder or add --force")


def read_ladder(folder: Path) -> Kept:
    """Read what `idloop refine --output` has written.

    Raises
    ------
    InputError
        There is no ladder in the folder.
    """
    from idloop.diagnose import Ladder

    path = folder / "ladder.json"
    if not path.is_file():
        raise InputError(f"{folder}: no ladder.json in it; write one with idloop refine --output {folder}")
    document = read_document(path)
    own = document.get("model_folder")
    effects = Path(own) if own else None
    try:
        ladder = Ladder.from_dict(document, effects)
    except (KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{path}: not a whole ladder ({type(error).__name__}: {error})") from error
    bags, validate = (tuple(Path(p) for p in document.get(key, ())) for key in ("bags", "validate"))
    return Kept(ladder, bags, validate, effects)


def write_ladder(folder: Path, kept: Kept) -> None:
    """Write the ladder and its model, so that it can be gone on with.

    Raises
    ------
    IdloopError
        When they cannot be written.
    """
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise IdloopError(f"cannot make {folder}: {error.strerror or error}") from error
    document = {
        **kept.ladder.to_dict(),
        "bags": [path.resolve() for path in kept.bags],
        "validate": [path.resolve() for path in kept.validate],
        "model_folder": kept.folder.resolve() if kept.folder is not None else None,
    }
    write_text(folder / "model.yaml", kept.ladder.model.to_yaml())
    write_text(folder / "ladder.json", json.dumps(to_json(document), indent=2, ensure_ascii=False) + "\n")


def write_all(
    folder: Path,
    kept: Kept,
    records: Sequence[Record],
    validation: Sequence[Record],
    suggestion: Suggestion | None = None,
) -> None:
    """Write everything: ladder, model, figures and the next experiment with what its rivals would show."""
    from idloop.cli._assessment import make_panel, save_figure
    from idloop.drawing import save
    from idloop.report.ladder import plot_ladder
    from idloop.validate import compare

    ladder = kept.ladder
    write_ladder(folder, kept)
    save(plot_ladder(ladder, noise_floor(ladder.model, validation or records)), folder / "ladder.png")
    _write_next(folder, ladder, suggestion)
    labelled = [("start", ladder.steps[0].model)]
    if len(ladder.steps) > 1:
        labelled.append((f"{len(ladder.steps) - 1} effects" if len(ladder.steps) > 2 else "1 effect", ladder.model))
    panels, last = [], None
    for kind, several in (("train", records), ("validation", validation)):
        for record in several:
            rows = [(label, compare(model, record)) for label, model in labelled]
            panels.append(make_panel(f"{kind}: {record.name}", rows))
            last = rows[-1][1]
    if last is not None:
        save_figure(panels, last, folder / "compare.png")


def _write_next(folder: Path, ladder: Ladder, suggestion: Suggestion | None) -> None:
    """Write the next experiment and its figure; what lies there of another one goes."""
    from idloop.drawing import save
    from idloop.report.suggestion import plot_suggestion

    file, figure = folder / "next.yaml", folder / "next.png"
    before = file.read_text(encoding="utf-8") if file.is_file() else None
    text = None if ladder.suggested_experiment is None else experiment_text(ladder.suggested_experiment)
    if text is None:
        file.unlink(missing_ok=True)
    else:
        write_text(file, text)
    if suggestion is not None:
        save(plot_suggestion(suggestion), figure)
    elif text is None or text != before:
        figure.unlink(missing_ok=True)


def noise_floor(model: Model, records: Sequence[Record]) -> dict[str, float]:
    """NRMSE that the measurement noise alone leaves, by output; only where the model states the noise."""
    import numpy as np

    floor = {}
    for column, output in enumerate(model.outputs):
        spread = float(np.nanstd(np.concatenate([record.output[:, column] for record in records])))
        if output.noise is not None and spread > 0.0:
            floor[output.name] = output.noise / spread
    return floor


def read_document(path: Path) -> dict[str, Any]:
    """Read a JSON document; InputError when there is none."""
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from error
    except ValueError as error:
        raise InputError(f"{path}: no JSON document ({error})") from error
    if not isinstance(document, dict):
        raise InputError(f"{path}: no JSON document of ours")
    return document
