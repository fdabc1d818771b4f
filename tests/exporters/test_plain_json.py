"""Plain JSON: every number of the model is there, with unit and standard error."""

from __future__ import annotations

import json

import pytest

from idloop.exporters import FORMATS, export
from idloop.physics import catalogue, load_model


def test_every_parameter_is_there_with_its_unit_and_error():
    model = load_model("dc_motor").with_effects(["dead_zone@input(width=0.1)"])
    model = model.with_values({"drive.gain": 8.0}, stderr={"drive.gain": 0.02, "dead_zone@input.width": 0.003})
    file = json.loads(export(model, "json").text)
    gain = {"value": 8.0, "unit": "N·m/V", "stderr": 0.02, "estimated": True, "min": None, "max": None}
    assert file["parameters"]["drive.gain"] == gain
    (effect,) = file["effects"]
    assert (effect["effect"], effect["at"]) == ("dead_zone", "input")
    assert effect["parameters"]["width"]["stderr"] == 0.003
    written = {*file["parameters"], *(f"dead_zone@input.{name}" for name in effect["parameters"])}
    assert written == set(model.values)


@pytest.mark.parametrize("form", FORMATS)
def test_every_effect_is_carried_or_named(form):
    start = load_model("torsion")
    sites = {"input": "input", "body": "load1", "coupling": "motor-load1", "output": "position[load1]"}
    if form == "c":  # of one body
        start, sites = load_model("axis"), {"input": "input", "body": "axis", "output": "position[axis]"}
    for several in catalogue().values():
        for effect in several:
            if effect.site not in sites or (effect.site == "output" and "position" not in effect.outputs):
                continue
            if effect.set_point:  # of another drive
                continue
            spec = effect.parameters[0]
            value = 3.0 if spec.integer else min(spec.max, 0.25)
            model = start.with_effects([f"{effect.name}@{sites[effect.site]}({spec.name}={value})"])
            before, after = export(start, form), export(model, form)
            assert before.text != after.text, effect.name
