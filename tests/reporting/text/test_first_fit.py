"""One sentence weighs the fit and the recording; what the fit cannot know is said."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import idloop
from idloop.records.finding import Finding
from idloop.reporting.text.comparison import held_scale, verdict


def _rows(force=None, **fits):
    output = SimpleNamespace(field="position", unit="rad")
    model = SimpleNamespace(outputs=[output], input=SimpleNamespace(unit="-"), loop=None)
    same = {"names": ["a.q"], "model": model, "force": force}
    return [
        ("fitted", SimpleNamespace(fit={"a.q": fit}, record=SimpleNamespace(name=name), **same))
        for name, fit in fits.items()
    ]


def _inspection(name, *spoils, grade="usable"):
    faults = [Finding("fault", "a fault", level="warning", spoils=spoils)] if spoils or grade != "usable" else []
    return SimpleNamespace(path=Path(name), grade=grade, faults=faults)


def test_a_good_fit_of_a_sound_recording():
    text = verdict([_inspection("run")], _rows(run=96.9))
    assert (
        text
        == "the model describes what was recorded (FIT of the free run 96.9 % or more); the recording shows no fault"
    )


def test_a_free_run_that_follows_without_the_force_is_no_model_of_it():
    play = SimpleNamespace(relative=0.885, noise=0.05, trusted=True)
    text = verdict([_inspection("run")], _rows(play, run=99.5))
    assert text.startswith("the free run follows the motion (FIT 99.5 % or more), but the force error is up to 88.5 %:")
    untrusted = SimpleNamespace(relative=0.885, noise=0.5, trusted=False)
    small = SimpleNamespace(relative=0.05, noise=0.01, trusted=True)
    all_noise = SimpleNamespace(relative=0.171, noise=0.171, trusted=True)
    for force in (untrusted, small, all_noise):
        assert verdict([_inspection("run")], _rows(force, run=99.5)).startswith("the model describes")


def test_a_fault_counts_where_no_record_is_without_it():
    both = _rows(one=95.0, two=97.0)
    slow, fast = _inspection("one", "inertia", "delays"), _inspection("two", "delays")
    assert verdict([slow, fast], both).endswith("no recording is usable for delays, whatever FIT and intervals say")
    assert verdict([slow], both).endswith(
        "the recording is not usable for inertia and delays, whatever FIT and intervals say"
    )
    assert verdict([slow, _inspection("two", grade="usable with care")], both).endswith("mind the warnings above")


def test_what_spoils_only_black_box_models_leaves_the_fit_of_a_physical_model_alone():
    loop = _inspection("run", "open-loop black-box models")
    assert verdict([loop], _rows(run=99.0)).endswith("; the recording is not usable for open-loop black-box models")


def test_a_record_that_is_of_no_use_alone():
    idle = _inspection("idle", grade="not usable for identification")
    assert verdict([idle, _inspection("run")], _rows(idle=95.0, run=96.0)).endswith(
        "idle can be used beside others only"
    )


def test_a_free_run_that_misses():
    assert verdict([_inspection("run")], _rows(run=40.0)).startswith(
        "the free run misses a.q of run (FIT 40 %): a diagnosis"
    )
    assert "is worse than a constant by a factor 32" in verdict([_inspection("run")], _rows(run=-3100.0))


def _both(position, velocity, unit="-", loop=None):
    outputs = [SimpleNamespace(field=field, unit=one) for field, one in (("position", "rad"), ("velocity", "rad/s"))]
    model = SimpleNamespace(outputs=outputs, input=SimpleNamespace(unit=unit), loop=loop)
    fits = {"a.position": position, "a.velocity": velocity}
    record = SimpleNamespace(name="run")
    return [("fitted", SimpleNamespace(fit=fits, names=list(fits), record=record, force=None, model=model))]


def test_a_command_that_may_set_the_speed_is_doubted_before_a_diagnosis():
    text = verdict([_inspection("run")], _both(-14000.0, -71.0))
    assert "the command may be no force but set the speed" in text
    assert "--command 'COLUMN=rad/s'" in text
    assert "a diagnosis looks for" not in text
    for rows in (_both(-14000.0, 40.0), _both(-200.0, -71.0), _both(-14000.0, -71.0, "A"), _both(-1e4, -71.0, loop=1)):
        assert "a diagnosis looks for" in verdict([_inspection("run")], rows)


def test_the_inertia_is_held_where_the_command_is_no_force():
    assert "axis.inertia" not in str(list(held_scale(idloop.load_model("axis"))))
    text = str(list(held_scale(idloop.load_model("dc_motor"))))
    assert "motor.inertia is held at" in text
    assert "a command in V is no force" in text
    assert "are larger by the same factor" in text
    within = idloop.load_model("dc_motor").with_effects(["gravity@motor", "dead_zone@input", "input_delay@input"])
    scaled = str(list(held_scale(within))).partition("If it is larger by a factor")[2]
    assert "gravity@motor.moment" in scaled
    assert not any(name in scaled for name in ("gravity@motor.lowest", "dead_zone@input", "input_delay@input"))


def test_a_gain_of_one_makes_forces_those_of_the_command():
    model = replace(idloop.load_model("axis"), input=replace(idloop.load_model("axis").input, unit="A"))
    (text,) = held_scale(model)
    assert "a command in A is no force, so every N·m of this model is the force of 1 A" in text
    assert list(held_scale(model.with_values({"drive.gain": 0.5}))) == []
