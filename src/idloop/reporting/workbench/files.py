"""What the page offers to take along: model, ladder, report, figures, and the commands that repeat it."""

from __future__ import annotations

import io
import json
import shlex
import tempfile
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from idloop.errors import InputError
from idloop.json_values import to_json
from idloop.reporting.workbench.state import model_version

if TYPE_CHECKING:
    from idloop.diagnosis import Ladder
    from idloop.reporting.page.contents import Contents
    from idloop.reporting.workbench.state import Snapshot
    from idloop.reporting.workbench.steps import Study

MODEL, LADDER, REPORT, FIGURES = "model.yaml", "ladder.json", "report.html", "figures.zip"
TYPES = {MODEL: "text/yaml", LADDER: "application/json", REPORT: "text/html", FIGURES: "application/zip"}


def offered(snapshot: Snapshot) -> list[str]:
    """Names of the files that there are now; a report needs recordings, which a live graph keeps elsewhere."""
    found = [] if snapshot.model is None else [MODEL]
    if snapshot.ladder is not None:
        found += [LADDER] if snapshot.live else [LADDER, REPORT, FIGURES]
    return found


def content(name: str, snapshot: Snapshot, study: Study | None) -> bytes:
    """Content of one of the files that are `offered`; InputError where there is no such file now."""
    model, ladder = snapshot.model, snapshot.ladder
    if name in offered(snapshot):
        if name == MODEL and model is not None:
            return model.to_yaml().encode()
        if name == LADDER and ladder is not None:
            return json.dumps(to_json(ladder.to_dict()), indent=2, ensure_ascii=False).encode()
        if ladder is not None and study is not None:
            make: Callable[[Contents], bytes] = _report if name == REPORT else _figures
            return make(_contents(snapshot, ladder, study))
    raise InputError(f"there is no {name} now")


def _contents(snapshot: Snapshot, ladder: Ladder, study: Study) -> Contents:
    from idloop.reporting.page.contents import gather
    from idloop.reporting.provenance import provenance

    bags, validate = ([Path(path) for path in paths] for paths in (snapshot.bags, snapshot.validate))
    origin = provenance(bags, validate, commands=commands(snapshot), seed=study.seed)
    return gather(ladder, study.records, study.validation, suggestion=snapshot.suggestion, provenance=origin)


def _report(contents: Contents) -> bytes:
    from idloop.reporting.page.page import render_page

    return render_page(contents).encode()


def _figures(contents: Contents) -> bytes:
    from idloop.reporting.page.page_figures import save_paper_figures

    packed = io.BytesIO()
    with tempfile.TemporaryDirectory() as folder, zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in save_paper_figures(contents, Path(folder)):
            archive.write(path, path.name)
    return packed.getvalue()


def commands(snapshot: Snapshot) -> list[str]:
    """Commands that say of the model file what the page says; none where the recordings have no paths."""
    fitted, unseen = (" ".join(map(shlex.quote, paths)) for paths in (snapshot.bags, snapshot.validate))
    if not fitted:
        return []
    judged = f" --validate {unseen}" if unseen else ""
    model = shlex.quote(named_model(snapshot))
    chosen = "".join(f" {shlex.quote(word)}" for word in snapshot.options)
    return [
        *(f"idloop compare {model} {shlex.quote(path)}" for path in (*snapshot.validate, *snapshot.bags)),
        f"idloop diagnose {model} {fitted}{judged}{chosen}",
        f"idloop refine {model} {fitted}{judged}{chosen} --output RUN",
    ]


def named_model(snapshot: Snapshot) -> str:
    """File with the model of the page: one that is there, or the one that is offered."""
    path, version = snapshot.model_file
    return path if path and snapshot.model is not None and model_version(snapshot.model) == version else MODEL
