"""The folder of a ladder: model, steps, report, the next experiment; written, read, never overwritten unasked."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from idloop.documents import MOST_JSON, NOT_WHOLE, read_json, read_text
from idloop.errors import InputError
from idloop.json_values import to_json
from idloop.output_files import make_folder, probe_file, probe_folder, write_text

if TYPE_CHECKING:
    from idloop.diagnosis import Ladder
    from idloop.diagnosis.design.suggest import Suggestion
    from idloop.records import Record
    from idloop.reporting.page.contents import Contents

FILES = (
    "model.yaml", "ladder.json", "ladder.png", "compare.png", "next.yaml", "next.json", "next.png", "report.html",
)  # fmt: skip


@dataclass(frozen=True)
class Kept:
    """A ladder as it lies in its folder."""

    ladder: Ladder
    # What it was climbed on
    bags: tuple[Path, ...] = ()
    validate: tuple[Path, ...] = ()
    folder: Path | None = field(default=None)  # of the model file, where effects of the user's own lie
    # Commands, seed, versions, checksums, see `idloop.reporting.provenance`; empty where it is not known
    provenance: dict[str, Any] = field(default_factory=dict)
    # Parts of recordings that no fit has seen, and those that were fitted, where it was not whole ones [s]
    unseen: tuple[tuple[Path, float, float], ...] = ()
    seen: tuple[tuple[Path, float, float], ...] = ()
    # What was undone, the latest last: ``steps`` by name, and the whole ``ladder`` as it was before
    taken_back: tuple[dict[str, Any], ...] = ()

    def without_last(self, count: int, where: Path) -> Kept:
        """Take the last steps back, and keep what they were.

        `where`: folder of the ladder, for the message.
        Raises InputError: the ladder has fewer effects.
        """
        added = self.ladder.added
        if count > len(added):
            have = f"only {len(added)} effects were added ({', '.join(added)})" if added else "no effect was added"
            often = "" if count == 1 else f" {count} times"
            raise InputError(f"{where}: nothing to undo{often}: {have}; give --undo less often")
        shorter = self.ladder
        for _ in range(count):
            shorter = shorter.undo()
        before = {"steps": list(added[-count:]), "ladder": self.ladder.to_dict()}
        return replace(self, ladder=shorter, taken_back=(*self.taken_back, before))


def check_target(folder: Path, what: str, *, overwrite: bool) -> None:
    """Refuse a folder that cannot be written or holds a ladder already, before the work is done.

    `what`: the option, which names it in the message. `overwrite`: a ladder that is there may be written anew.
    Raises InputError: a file of that name, no folder above it, or files that would be overwritten.
    """
    probe_folder(folder, what)
    there = [name for name in FILES if (folder / name).exists()]
    if there and not overwrite:
        are = "are" if len(there) > 1 else "is"
        raise InputError(f"{what} {folder}: {', '.join(there)} {are} there already, name another folder or add --force")
    for name in there:
        probe_file(folder / name, what, overwrite=True)


def read_ladder(folder: Path) -> Kept:
    """Read what `idloop refine --output` has written.

    Raises InputError: there is no ladder in the folder.
    """
    from idloop.diagnosis import Ladder

    path = folder / "ladder.json"
    if not path.is_file():
        raise InputError(f"{folder}: no ladder.json in it; write one with idloop refine --output {folder}")
    document = read_document(path)
    try:
        own = document.get("model_folder")
        effects = Path(own) if own else None
        ladder = Ladder.from_dict(document, effects)
        bags, validate = (tuple(Path(p) for p in document.get(key, ())) for key in ("bags", "validate"))
        unseen, seen = (
            tuple((Path(part["bag"]), float(part["start"]), float(part["stop"])) for part in document.get(key, ()))
            for key in ("unseen", "seen")
        )
        provenance, taken_back = dict(document.get("provenance", {})), tuple(document.get("taken_back", ()))
    except NOT_WHOLE as error:
        raise InputError(f"{path}: not a whole ladder ({type(error).__name__}: {error})") from error
    return Kept(ladder, bags, validate, effects, provenance, unseen, seen, taken_back)


def write_ladder(folder: Path, kept: Kept) -> None:
    """Write the ladder and its model, so that it can be gone on with.

    Raises IdloopError: when they cannot be written.
    """
    make_folder(folder)
    unseen, seen = (
        [{"bag": bag.resolve(), "start": start, "stop": stop} for bag, start, stop in parts]
        for parts in (kept.unseen, kept.seen)
    )
    document = {
        **kept.ladder.to_dict(),
        "bags": [path.resolve() for path in kept.bags],
        "validate": [path.resolve() for path in kept.validate],
        "model_folder": kept.folder.resolve() if kept.folder is not None else None,
        "provenance": kept.provenance,
        "unseen": unseen,
        "seen": seen,
        "taken_back": kept.taken_back,
    }
    write_text(folder / "model.yaml", kept.ladder.model.to_yaml())
    _write_document(folder / "ladder.json", document)


def _write_document(path: Path, document: Mapping[str, Any]) -> None:
    write_text(path, json.dumps(to_json(document), indent=2, ensure_ascii=False) + "\n")


def write_all(
    folder: Path,
    kept: Kept,
    records: Sequence[Record],
    validation: Sequence[Record],
    suggestion: Suggestion | None = None,
    progress: Callable[[float, str], None] | None = None,
) -> Contents:
    """Write everything: ladder, model, figures, the next experiment with what its rivals would show, the report.

    Returns: what the report says.
    """
    from idloop.drawing import save
    from idloop.reporting.page.contents import gather
    from idloop.reporting.plots.comparison import plot_panels
    from idloop.reporting.plots.diagnosis import plot_ladder

    ladder = kept.ladder
    write_ladder(folder, kept)
    _write_next(folder, ladder, suggestion)
    shown = suggestion if suggestion is not None else read_next_experiment(folder, kept)
    contents = gather(ladder, records, validation, suggestion=shown, provenance=kept.provenance, progress=progress)
    save(plot_ladder(ladder, contents.floor), folder / "ladder.png")
    # In the order of the work: what was fitted, then what was not.
    panels = [judged.panel for judged in sorted(contents.judged, key=lambda judged: judged.use)]
    if panels:
        save(plot_panels(panels), folder / "compare.png")
    write_report(contents, folder / "report.html")
    return contents


def judged_records(kept: Kept, records: Sequence[Record]) -> list[Record]:
    """Stretches of the recordings that no fit has seen."""
    return _parts(kept.unseen, records)


def fitted_records(kept: Kept, records: Sequence[Record]) -> list[Record]:
    """What the fits have seen: the recordings, or the stretches of them that a live estimator took."""
    return _parts(kept.seen, records) or list(records)


def _parts(parts: Sequence[tuple[Path, float, float]], records: Sequence[Record]) -> list[Record]:
    return [
        replace(records[0].cut(start, stop), name=f"{records[0].name}, {start:.4g} to {stop:.4g} s")
        for _, start, stop in parts
        if records
    ]


def write_report(contents: Contents, path: Path) -> int:
    """Write the report's page and return its size in bytes."""
    from idloop.reporting.page.page import render_page

    page = render_page(contents)
    write_text(path, page)
    return len(page.encode())


def read_next_experiment(folder: Path, kept: Kept) -> Suggestion | None:
    """Read the next experiment with its rivals; None where the folder has none."""
    from idloop.reporting.next_experiment import read_next

    path = folder / "next.json"
    if kept.ladder.suggested_experiment is None or not path.is_file():
        return None
    try:
        return read_next(read_document(path), kept.folder)
    except NOT_WHOLE as error:
        raise InputError(f"{path}: not a whole experiment ({type(error).__name__}: {error})") from error


def _write_next(folder: Path, ladder: Ladder, suggestion: Suggestion | None) -> None:
    """Write the next experiment, its rivals and its figure; what lies there of another one goes."""
    from idloop.drawing import save
    from idloop.reporting.next_experiment import experiment_text, next_document
    from idloop.reporting.plots.suggestion import plot_suggestion

    file, figure, rivals = folder / "next.yaml", folder / "next.png", folder / "next.json"
    before = file.read_text(encoding="utf-8") if file.is_file() else None
    text = None
    if ladder.suggested_experiment is None:
        file.unlink(missing_ok=True)
    else:
        write_text(file, text := experiment_text(ladder.suggested_experiment))
    if suggestion is not None:
        save(plot_suggestion(suggestion), figure)
        _write_document(rivals, next_document(suggestion))
    elif text is None or text != before:
        figure.unlink(missing_ok=True)
        rivals.unlink(missing_ok=True)


def read_document(path: Path) -> dict[str, Any]:
    """Read a JSON document of ours; InputError when there is none."""
    document = read_json(read_text(path, MOST_JSON), str(path))
    if not isinstance(document, dict):
        raise InputError(f"{path}: no JSON document of ours")
    return document
