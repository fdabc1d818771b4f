"""The whole story through the public API: simulate, fit, compare, diagnose, refine, suggest, report, export."""

from __future__ import annotations

import json

import numpy as np
import pytest

import idloop
from idloop.json_values import to_json

CHOICE = ["dead_zone", "coulomb_friction"]


@pytest.fixture(scope="module")
def model():
    return idloop.load_model("dc_motor")


@pytest.fixture(scope="module")
def records(model):
    machine = model.with_effect("dead_zone", "input", width=0.3)
    signals = [
        idloop.excitation("rgs", sample_time=0.01, duration=30.0, amplitude=amplitude, seed=seed)
        for seed, amplitude in enumerate((2.0, 3.0))
    ]
    return [idloop.simulate(machine, one, seed=i, name=f"run{i + 1}") for i, one in enumerate(signals)]


@pytest.fixture(scope="module")
def ladder(model, records):
    return idloop.refine(model, records[0], records[1], effects=CHOICE)


def check_result(result, schema, *words):
    text = result.summary()
    assert all(word in text for word in words), text
    assert all(word in result._repr_html_() for word in words)
    document = json.loads(json.dumps(to_json(result.to_dict())))
    assert document["schema"] == schema
    figure = result.plot()
    assert figure.axes
    return document


def test_a_fit_is_judged_on_unseen_records(model, records):
    found = idloop.fit(model, records[0], validate=records[1])
    document = check_result(found, "idloop/fit/1", "drive.gain", "unseen", "run2")
    assert document["validation"][0]["record"] == "run2"
    assert set(found.values) == set(found.intervals) == set(model.free)
    assert found.model.values["drive.gain"] == found.values["drive.gain"]


def test_models_are_compared_on_one_record(model, records, ladder):
    found = idloop.compare([model, ladder.model], records[1], labels=["linear", "with the dead zone"])
    check_result(found, "idloop/compare/1", "linear", "with the dead zone")
    assert found.fit["with the dead zone"]["motor.velocity"] > found.fit["linear"]["motor.velocity"]
    assert all(0.0 < error < 100.0 for error in found.force_error.values())
    assert found.plot_where().axes


def test_models_of_one_name_are_numbered(model, records):
    assert list(idloop.compare([model, model], records[0]).fit) == ["dc_motor 1", "dc_motor 2"]


def test_the_missing_effect_is_named_and_drawn(model, records):
    found = idloop.diagnose(model, records, effects=CHOICE)
    check_result(found, "idloop/diagnose/1", "missing: dead_zone@input")
    assert found.missing == ("dead_zone@input",)
    assert found.verdict == "missing"
    assert found.model.values["dead_zone@input.width"] == pytest.approx(0.3, abs=0.05)
    assert found.candidates[0].name == "dead_zone@input"
    assert len(found.plot().axes) == 2


def test_the_ladder_adds_it_and_the_error_falls(ladder):
    document = check_result(ladder, "idloop/refine/1", "+ dead_zone@input", "verdict:")
    assert ladder.added == ("dead_zone@input",)
    assert document["verdict"] == ladder.verdict == "adequate"
    first, last = (step.validation["fit"]["motor.velocity"] for step in (ladder.steps[0], ladder.steps[-1]))
    assert last > first


def test_a_step_is_taken_back_and_an_effect_of_ones_own_choice_added(ladder):
    start = ladder.undo()
    assert start.added == ()
    assert start.add("coulomb_friction@motor").added == ("coulomb_friction@motor",)
    with pytest.raises(idloop.InputError, match="nothing to undo"):
        start.undo()


def test_a_ladder_is_saved_and_reported(ladder, tmp_path):
    folder = ladder.save(tmp_path / "ladder")
    assert {"model.yaml", "ladder.json", "report.html"} <= {path.name for path in folder.iterdir()}
    assert idloop.load_model(folder / "model.yaml").effect_names == ladder.added
    with pytest.raises(idloop.InputError, match="there already"):
        ladder.save(folder)
    assert "dead_zone" in ladder.report(tmp_path / "report.html").read_text(encoding="utf-8")


def test_the_next_experiment_separates_rival_models(model, records, ladder, tmp_path):
    rivals = [ladder.model, ladder.undo().add("coulomb_friction@motor").model]
    found = idloop.suggest(rivals, records[0], fitted=True, max_command=3.0, position_range=(-20.0, 20.0), duration=5.0)
    document = check_result(found, "idloop/suggest/1", "dead_zone", "coulomb_friction")
    assert document["duration"] == pytest.approx(5.0)
    assert found.save(tmp_path / "next.yaml").read_text(encoding="utf-8").count("signal:") == 1


def test_nothing_is_suggested_where_nothing_is_open(ladder):
    found = idloop.suggest(ladder)
    if found.experiment is None:
        assert found.summary()
        with pytest.raises(idloop.InputError, match="no experiment"):
            found.plot()


def test_black_box_models_are_compared(records):
    found = idloop.identify(records[0], ["arx", "n4sid"], validate=records[1], sample_time=0.05, order=2)
    document = check_result(found, "idloop/identify/1", "arx", "n4sid", "unseen: run2")
    assert [one["label"] for one in document["results"]] == ["arx", "n4sid"]
    assert idloop.to_control(found).nstates >= 2
    assert found.fit["n4sid"]["motor.velocity"] > 50.0
    with pytest.raises(idloop.InputError, match="order"):
        idloop.identify(records[0], "arx", ordr=2)


def test_a_loop_is_compensated_in_simulation():
    axis = idloop.load_model("axis").with_effect("coulomb_friction", "axis", level=0.3)
    found = idloop.compensate(axis)
    check_result(found, "idloop/compensate/1", "coulomb_friction@axis", "tracking error")
    assert found.ratio["axis.position"] < 0.5


def test_wear_raises_an_alarm():
    model = idloop.load_model("axis").with_effect("coulomb_friction", "axis", level=0.1)
    signal = idloop.excitation("multisine", sample_time=0.002, duration=60.0)
    watch = idloop.Monitor.learn(model, idloop.simulate(model, signal), ["coulomb_friction@axis"])
    watch.follow(idloop.simulate(model, signal, seed=1, name="healthy"))
    assert not watch.alarms
    watch.follow(idloop.simulate(model.with_values({"coulomb_friction@axis.level": 0.2}), signal, seed=2, name="worn"))
    check_result(watch, "idloop/monitor/1", "coulomb_friction@axis", "alarm", "worn")


def test_a_model_is_exported_and_a_python_control_system(ladder, tmp_path):
    written = idloop.export(ladder.model, "json", tmp_path / "model.json")
    assert (tmp_path / "model.json").read_text(encoding="utf-8") == written.text
    system = idloop.to_control(ladder)
    gain = ladder.model.values["drive.gain"] / ladder.model.values["motor.viscous_friction"]
    assert abs(system(1e-4j)[1, 0]) == pytest.approx(gain, rel=1e-3)


def test_a_closed_loop_records_its_reference():
    axis = idloop.load_model("axis")
    signal = idloop.excitation("sine", sample_time=0.001, duration=2.0, frequency=1.0, amplitude=0.2)
    record = idloop.simulate(axis, signal, controller=True)
    assert record.reference.shape == (record.time.size, 2)
    np.testing.assert_allclose(record.reference[:, 0], signal.value)
    position = record.output[:, record.column("axis.position")]
    assert np.std(position - signal.value) < np.std(signal.value)


@pytest.mark.parametrize(
    ("call", "message"),
    (
        (lambda m: idloop.simulate(m, [0.0, 1.0]), "sample_time"),
        (lambda m: idloop.simulate(m, [1.0], sample_time=0.1), "two samples"),
        (lambda m: idloop.simulate(m, [0.0, 1.0], sample_time=0.1, controller=True), "controller"),
        (lambda m: idloop.read_bag("no/such/bag", m), "no bag"),
        (lambda m: idloop.read_bags(["no/such/bag"], m), "no bag"),
        (idloop.suggest, "records are missing"),
        (lambda m: idloop.load_model("dc_moto"), "dc_moto"),
        (lambda m: idloop.export(m, "urdff"), "urdf"),
    ),
)
def test_wrong_use_is_one_line(model, call, message):
    with pytest.raises(idloop.InputError, match=message) as caught:
        call(model)
    assert "\n" not in str(caught.value)


def test_a_record_of_arrays_has_the_names_of_the_model(model):
    time = np.arange(5) * 0.1 + 7.0
    record = idloop.Record.from_arrays(time, np.ones(5), {"velocity": np.arange(5.0)}, model)
    assert record.output_names == model.output_names
    assert record.time[0] == 0.0
    assert np.isnan(record.output[:, 0]).all()
    np.testing.assert_array_equal(record.output[:, 1], np.arange(5.0))


@pytest.mark.parametrize(
    ("outputs", "message"),
    (
        ({"speed": [0, 1, 2]}, "no output 'speed'"),
        ({"velocity": [0, 1]}, "2 values for 3 stamps"),
        ({"velocity": ["a", "b", "c"]}, "no numbers"),
        ({"velocity": [[0], [1], [2]]}, "one dimension"),
    ),
)
def test_arrays_that_do_not_fit_are_one_line(model, outputs, message):
    with pytest.raises(idloop.InputError, match=message):
        idloop.Record.from_arrays([0, 1, 2], [0, 1, 1], outputs, model)


def test_a_record_of_a_frame(model):
    frame = {"t": [0.0, 0.1, 0.2], "u": [0, 1, 1], "theta": [0.0, 0.1, 0.3]}
    record = idloop.Record.from_frame(frame, model, time="t", command="u", outputs={"motor.position": "theta"})
    np.testing.assert_allclose(record.output[:, 0], frame["theta"])
    with pytest.raises(idloop.InputError, match="no column 'thta'"):
        idloop.Record.from_frame(frame, model, time="t", command="u", outputs={"motor.position": "thta"})


@pytest.mark.parametrize(
    ("effect", "values"),
    [
        ("saturation@input", {"limit": 0.5}),
        ("compliance@axis", {"stiffness": 40.0, "damping": 0.02, "split": 0.5}),
    ],
)
def test_an_effect_that_begins_without_influence_starts_from_what_the_records_suggest(effect, values):
    plain = idloop.load_model("axis")
    given = ", ".join(f"{name}={value}" for name, value in values.items())
    excitation = idloop.excitation("multisine", sample_time=0.002, duration=8.0, amplitude=1.0)
    record = idloop.simulate(plain.with_effects([f"{effect}({given})"]), excitation, seed=1)
    found = idloop.fit(plain.with_effects([effect]), record).values
    assert {name: found[f"{effect}.{name}"] for name in values} == pytest.approx(values, rel=0.01)
