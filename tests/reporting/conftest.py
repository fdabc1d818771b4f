"""A motor with hidden dry friction, a ladder that found it, and everything that its report says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from idloop.diagnosis import Candidate, Ladder, Step, UnknownStructure
from idloop.diagnosis.candidate import effect_parameters
from idloop.diagnosis.model_errors import model_errors
from idloop.diagnosis.screening.proposals import proposals
from idloop.physics import load_model, simulate
from idloop.records import Record
from idloop.reporting.page.contents import Contents, gather

NAME = "coulomb_friction@motor"


def recorded(model, seconds: float, seed: int, name: str) -> Record:
    random = np.random.default_rng(seed)
    time = np.arange(0.0, seconds, 4e-3)
    frequency, phase = np.array([0.23, 0.41, 0.83]), random.uniform(0.0, 6.0, 3)
    command = 2.0 * np.sum(np.sin(2.0 * np.pi * frequency * time[:, None] + phase), axis=1)
    output = simulate(model, time, command, time).output
    noise = np.array([o.noise for o in model.outputs])
    return Record(
        name, time, command, time, output + noise * random.normal(size=output.shape), model.input.name,
        model.input.unit, model.output_names, tuple(o.unit for o in model.outputs),
    )  # fmt: skip


@pytest.fixture(scope="session")
def story() -> dict:
    """Ladder and records, and how such are made."""
    plain = load_model("dc_motor")
    plain = replace(plain, outputs=tuple(replace(o, noise=n) for o, n in zip(plain.outputs, (1e-3, 5e-3), strict=True)))
    true = plain.with_effects([f"{NAME}(level=3)"])
    fitted = true.with_values({}, {f"{NAME}.level": 0.02})
    train, unseen = recorded(true, 12.0, 3, "train"), recorded(true, 8.0, 4, "unseen")
    added = Candidate(
        "coulomb_friction", "motor", "yes", "", "Dry friction <opposes> motion.", gain=900.0, p_value=1e-4,
        explains=0.8, model=fitted, parameters=effect_parameters(fitted, NAME),
    )  # fmt: skip
    weighed = Candidate("backlash", "position[motor]", "yes", "", "A gap.", gain=1.5, p_value=0.7, explains=0.01)
    hidden = Candidate("saturation", "input", "weak", "a limit beyond the data cannot show", "A limit.")
    named = {weighed.name, hidden.name}
    screened = tuple(
        Candidate(one.effect.name, one.at, "yes", "", one.effect.text)
        for one in proposals(fitted)
        if one.name not in named
    )
    steps = tuple(
        Step(
            candidate, model, set=names, p_value=p_value, train=model_errors(model, [train]),
            validation=model_errors(model, [unseen]),
        )
        for candidate, model, names, p_value in (
            (None, plain, (), None), (added, fitted, (NAME, "dead_zone@input"), 1e-4),
        )
    )  # fmt: skip
    at = np.linspace(-5.0, 5.0, 9)
    ladder = Ladder(
        steps, verdict="unknown_structure", candidates=(weighed, hidden, *screened), untestable=("saturation@input",),
        findings=("20 s in 2 records",), criterion="prediction",
        unknown=UnknownStructure("motor.velocity", "rad/s", "N·m", at, 0.01 * at**2, np.full(9, 0.1), 0.2, "a curve"),
    )  # fmt: skip
    return {"ladder": ladder, "train": train, "unseen": unseen, "recorded": recorded}


@pytest.fixture(scope="session")
def contents(story) -> Contents:
    origin = {"commands": ["idloop refine a b"], "seed": 0, "versions": {"idloop": "1"}, "bags": []}
    return gather(story["ladder"], [story["train"]], [story["unseen"]], provenance=origin)
