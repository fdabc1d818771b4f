"""One motor logged in many forms: each becomes the same signals, and the same fit, by one command."""

from __future__ import annotations

import json

import pytest
from tests.records.formats.corpus import FORMS

import idloop
from idloop.api.start import recognise
from idloop.cli import main
from idloop.cli.verbs.start import SIGNALS, command
from idloop.records.recognition.role_units import base_field
from idloop.records.tables.base_units import base_unit

DRY = "coulomb_friction@axis"


def _start(capsys, log, folder, *more):
    words = ["start", *map(str, log.files), *log.flags, "--output", str(folder), "--json", *more]
    assert main.run(words) == 0, capsys.readouterr().err
    return json.loads(capsys.readouterr().out)


def _factor(role, unit, scale):
    """What a value of the file is multiplied by to be in the unit of the topics, and that unit."""
    base, factor = base_unit(unit, base_field(role), role)
    return base, factor * scale


def _recognised(log):
    """What `idloop start` recognises with the flags that the user must give."""
    said = command.make_context("start", [*map(str, log.files), *log.flags]).params
    given = {role: said[role] for role in SIGNALS if said[role] is not None}
    csv = {key: said[key] for key in ("delimiter", "decimal", "skip_rows") if said[key] is not None}
    return recognise(log.files, given, period=1.0 / said["rate"] if said["rate"] else said["period"], csv=csv)


@pytest.mark.parametrize("name", FORMS)
def test_signals_units_and_records_are_recognised(name, tmp_path):
    log = FORMS[name](tmp_path)
    found = _recognised(log)
    signals = {one.role: one for one in found.recognition.guesses}
    for role, true in log.truth.items():
        if role == "time":
            assert found.recognition.base.time.unit in (true.unit, "iso8601")
            # Of stamps for every signal those of the motion count.
            assert found.recognition.table.clocks or found.recognition.base.time.column == true.column
        # What the user has written as a formula converts by itself.
        elif "compute" not in signals[role].options:
            one = signals[role]
            assert one.column == true.column, role
            unit, factor = _factor(role, one.unit, one.options.get("scale", 1.0))
            right, expected = _factor(role, true.unit, true.scale)
            assert (unit, factor) == (right, pytest.approx(expected, rel=1e-3)), role
    assert len(found.runs) == log.records
    assert not any("but the rows are" in doubt for doubt in found.doubts), "no rows were left out"


@pytest.mark.slow
@pytest.mark.parametrize("name", FORMS)
def test_one_command_leads_from_the_file_to_a_fit(name, tmp_path, capsys):
    log = FORMS[name](tmp_path)
    found = _start(capsys, log, tmp_path / "begun")
    # The motor has dry friction, which a first model lacks: with it the fit finds the motor's own values.
    model = idloop.load_model(found["model"]).with_effects([DRY])
    values = idloop.fit(model, idloop.read_bags(found["bags"], model)).values
    true = log.parameters
    own = {"inertia": "axis.inertia", "viscous_friction": "axis.viscous_friction", "coulomb": f"{DRY}.level"}
    for parameter, key in own.items():
        assert values[key] == pytest.approx(true[parameter], rel=0.1), parameter
