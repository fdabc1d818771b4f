"""`idloop fit` and `idloop compare`: from a bag to a fitted model file, tables, JSON and figures."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from idloop.cli import main
from idloop.physics import load_model, simulate
from idloop.physics.model_file import with_joints
from idloop.records import Record, read_record, write_bag

TRUTH = {"motor.viscous_friction": 3.0, "drive.gain": 6.0}


def write_recording(path: Path, seed: int) -> Path:
    """Record of the preset with other values, 8 s at 100 Hz with a little noise."""
    model = load_model("dc_motor").with_values(TRUTH)
    random = np.random.default_rng(seed)
    time = np.arange(800) * 0.01
    command = np.repeat(random.uniform(-5.0, 5.0, 40), 20)
    output = simulate(model, time, command, time).output
    output = output + random.normal(size=output.shape) * [1e-2, 2e-2]
    units = tuple(o.unit for o in model.outputs)
    record = Record(path.name, time, command, time, output, model.input.name, "V", model.output_names, units)
    return write_bag(path, record)


@pytest.fixture(scope="module")
def bags(tmp_path_factory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("bags")
    return write_recording(folder / "train", 1), write_recording(folder / "unseen", 2)


def words(*arguments: object) -> list[str]:
    return [str(argument) for argument in arguments]


@pytest.fixture(scope="module")
def steps(tmp_path_factory) -> list[Path]:
    """Recordings that begin with a step from rest, and so show one command each."""
    model, random = load_model("dc_motor").with_values(TRUTH), np.random.default_rng(3)
    time, folder = np.arange(1, 200) * 0.01, tmp_path_factory.mktemp("steps")
    bags = []
    for level in (1.0, 3.0, 5.0):
        command = np.full(time.size + 1, level)
        output = simulate(model, np.append(0.0, time), command, time).output
        output = output + random.normal(size=output.shape) * [1e-2, 2e-2]
        record = Record(
            f"step{level:g}", time, command[1:], time, output, model.input.name, "V", model.output_names,
            tuple(o.unit for o in model.outputs),
        )  # fmt: skip
        bags.append(write_bag(folder / record.name, record))
    return bags


def test_steps_from_rest_at_several_levels_are_an_experiment(steps, capsys):
    assert main.run(words("fit", "dc_motor", *steps, "--json")) == 0
    document = json.loads(capsys.readouterr().out)
    for name, truth in TRUTH.items():
        found = document["parameters"][name]
        assert abs(found["value"] - truth) < 4 * found["stderr"] < 0.2 * truth
    assert not any("does not follow" in warning for warning in document["warnings"])


def test_a_step_of_one_level_that_begins_its_record_is_an_experiment_and_what_it_hides_is_said(steps, capsys):
    assert main.run(words("fit", "dc_motor", steps[1], "--json")) == 0
    out, err = capsys.readouterr()
    found = json.loads(out)["parameters"]
    ratio = found["drive.gain"]["value"] / found["motor.viscous_friction"]["value"]
    assert ratio == pytest.approx(TRUTH["drive.gain"] / TRUTH["motor.viscous_friction"], rel=0.05)
    assert "dead zone" in err


def test_a_constant_command_without_a_step_is_refused_and_told_the_cure(steps, tmp_path, capsys):
    record = read_record(steps[0], load_model("dc_motor"))
    moving = write_bag(tmp_path / "moving", replace(record.cut(1.5, None), findings=()))
    assert main.run(words("fit", "dc_motor", moving)) == 2
    assert "steps to several levels" in capsys.readouterr().err
    still = np.arange(1, 200) * 0.01
    time, output = np.append(still, record.time + 2.0), np.pad(record.output, ((199, 0), (0, 0)))
    command = np.full(time.size, record.input[0])
    late = replace(record, name="late", time=time, output=output, input_time=time, input=command, findings=())
    assert main.run(words("fit", "dc_motor", write_bag(tmp_path / "late", late))) == 2
    assert "starts only at" in capsys.readouterr().err


@pytest.mark.slow
def test_fit_finds_the_truth_and_says_so_in_one_document(bags, tmp_path, capsys):
    fitted, figure = tmp_path / "fitted.yaml", tmp_path / "fit.svg"
    arguments = words("fit", "dc_motor", bags[0], "--validate", bags[1], "--output", fitted, "--plot", figure, "--json")
    assert main.run(arguments) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["schema"] == "idloop/fit/1"
    for name, truth in TRUTH.items():
        found = document["parameters"][name]
        assert abs(found["value"] - truth) < 4 * found["stderr"] < 0.1 * truth
    assert document["validation"][0]["record"] == "unseen"
    assert document["validation"][0]["free_run"]["fit"]["motor.position"] > 98
    again = load_model(fitted)
    for name in TRUTH:
        assert again.parameter(name).value == pytest.approx(document["parameters"][name]["value"])
        assert again.parameter(name).stderr == pytest.approx(document["parameters"][name]["stderr"])
    text = figure.read_text(encoding="utf-8")
    assert "unseen: unseen" in text
    assert "motor.velocity [rad/s]" in text


def test_fit_prints_parameters_and_both_records(bags, capsys):
    assert main.run(words("fit", "dc_motor", bags[0], "--validate", bags[1])) == 0
    out, err = capsys.readouterr()
    assert err == ""
    for word in ("motor.viscous_friction", "N·m·s/rad", "loss", "FPE", "fitted", "unseen", "FIT %", "force error %"):
        assert word in out


def test_a_file_is_overwritten_only_when_asked(bags, tmp_path, capsys):
    fitted = tmp_path / "fitted.yaml"
    fitted.write_text("mine\n", encoding="utf-8")
    assert main.run(words("fit", "dc_motor", bags[0], "--output", fitted)) == 2
    assert "--force" in capsys.readouterr().err
    assert fitted.read_text(encoding="utf-8") == "mine\n"
    assert main.run(words("fit", "dc_motor", bags[0], "--output", fitted, "--force")) == 0
    assert load_model(fitted).name == "dc_motor"


def test_compare_tells_the_better_model_from_the_worse(bags, tmp_path, capsys):
    true = tmp_path / "true.yaml"
    load_model("dc_motor").with_values(TRUTH).save(true)
    figure = tmp_path / "compare.png"
    assert main.run(words("compare", "dc_motor", true, bags[0], "--steps", 5, "--plot", figure, "--json")) == 0
    worse, better = json.loads(capsys.readouterr().out)["comparisons"]
    assert (worse["label"], better["label"]) == ("dc_motor", str(true))
    assert better["ahead"]["steps"] == 5
    assert better["free_run"]["fit"]["motor.velocity"] > 95 > worse["free_run"]["fit"]["motor.velocity"]
    assert better["force"]["relative_error"] < worse["force"]["relative_error"]
    assert [test["white"] for test in better["residual"]] == [True, True]
    assert figure.stat().st_size > 10000


@pytest.mark.slow
def test_compare_takes_one_recording(bags, capsys):
    assert main.run(words("compare", "dc_motor", *bags)) == 2
    error = capsys.readouterr().err
    assert f"BAG is one recording, the last: {bags[0]} is one as well" in error
    assert "comes after MODEL" not in error


def test_compare_says_where_the_model_fails(bags, tmp_path, capsys):
    figure = tmp_path / "where.svg"
    assert main.run(words("compare", "dc_motor", bags[0], "--plot-where", figure, "--json")) == 0
    out, err = capsys.readouterr()
    document = json.loads(out)
    assert document["plot_where"] == str(figure)
    assert err == f"written: {figure}\n"
    where = document["comparisons"][0]["where"]
    assert set(where) == {"drive force", "motor.position", "motor.velocity"}
    for one in where.values():
        assert set(one["share"]) | set(one["left_out"]) == {
            "time", "frequency", "velocity", "position", "command", "direction", "since_reversal",
        }  # fmt: skip
        for breakdown in one["share"].values():
            assert sum(b["error"] for b in breakdown["bins"]) == pytest.approx(1.0)
            assert len({"from", "to", "error", "mean", "rms"} & set(breakdown["bins"][0])) == 5
    # Too much friction and too little gain: the missing force follows the command and the velocity.
    assert where["drive force"]["share"]["velocity"]["follows"] > 0.2
    text = figure.read_text(encoding="utf-8")
    for label in ("velocity [rad/s]", "command [V]", "mean ± rms [N·m]", "share [%]"):
        assert label in text


def test_compare_prints_where_in_words(bags, capsys):
    asked = words("compare", "dc_motor", bags[0], "--effect", "coulomb_friction@motor(level=6)", "--all")
    assert main.run(asked) == 0
    out = capsys.readouterr().out
    assert "dc_motor: where the error of train falls" in out
    assert "drive force: applied minus needed, rms" in out
    assert "share explained by a function of one variable:" in out
    assert "% of the error falls in the" in out


def test_compare_prints_measures_and_verdicts(bags, capsys):
    assert main.run(words("compare", "dc_motor", bags[0], "--set", "drive.gain=6", "--all")) == 0
    out = capsys.readouterr().out
    for word in ("FIT % 10 ahead", "force error %", "Ljung-Box", "squared error of motor.position", "after a reversal"):
        assert word in out


def test_compare_is_brief_unless_everything_is_asked_for(bags, tmp_path, capsys):
    true = tmp_path / "true.yaml"
    load_model("dc_motor").with_values(TRUTH).save(true)
    friction = ("--effect", "coulomb_friction@motor(level=6)")
    assert main.run(words("compare", "dc_motor", true, bags[0], *friction)) == 0
    brief = capsys.readouterr().out
    assert main.run(words("compare", "dc_motor", true, bags[0], *friction, "--all")) == 0
    whole = capsys.readouterr().out
    table = brief.partition("\n\n")[0]
    assert whole.startswith(table)
    # Two models, three errors each.
    assert len(brief.splitlines()) < 30 < len(whole.splitlines())
    for word in (
        "dc_motor, train:",
        "one-step residual: ",
        "drive force: applied minus needed, rms",
        "worst: ",
        "--all",
    ):
        assert word in brief
    # Every line of a map is one of the whole text: nothing is said in other words.
    told = [line for line in brief.splitlines() if line.startswith("    ")]
    assert told
    assert set(told) <= set(whole.splitlines())


@pytest.mark.parametrize(
    ("arguments", "word"),
    (
        (["fit", "dc_motor"], "BAG"),
        (["fit", "dc_motor", "nowhere"], "nowhere"),
        (["fit", "dc_moter", "BAG"], "dc_motor"),
        (["fit", "emps", "BAG"], "axis"),
        (["fit", "dc_motor", "BAG", "--validate", "nowhere"], "nowhere"),
        (["fit", "dc_motor", "BAG", "--criterion", "luck"], "prediction"),
        (["fit", "dc_motor", "BAG", "--plot", "a.gif"], ".svg"),
        (["fit", "dc_motor", "BAG", "--plot", "nowhere/a.png"], "nowhere"),
        (["fit", "dc_motor", "BAG", "--output", "nowhere/a.yaml"], "nowhere"),
        (["fit", "dc_motor", "BAG", "--validat", "BAG"], "--validate"),
        (["fit", "dc_motor", "EMPTY"], "EMPTY"),
        (["compare", "dc_motor", "nowhere"], "nowhere"),
        (["compare", "BAG"], "MODEL"),
        (["compare", "dc_motor", "emps", "BAG"], "different outputs"),
        (["compare", "dc_motor", "BAG", "--steps", "0"], "--steps"),
        (["compare", "dc_motor", "BAG", "--plot-where", "a.gif"], ".svg"),
        (["compare", "dc_motor", "BAG", "--steps", "100000"], "100000"),
    ),
)
def test_bad_input_is_one_line_and_exit_code_2(arguments, word, bags, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(bags[0], "BAG")
    Path("EMPTY").mkdir()
    assert main.run(arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1, err
    assert word in err


def test_labels_are_names_unless_two_models_share_one():
    from idloop.api.comparison import short_names
    from idloop.cli.verbs.compare import label_models

    one, two = load_model("dc_motor"), load_model("axis")
    assert label_models(["a.yaml", "b.yaml"], [one, two]) == ["dc_motor", "axis"]
    assert label_models(["a.yaml", "b.yaml"], [one, one]) == ["a.yaml", "b.yaml"]
    assert short_names(["/long/way/a.yaml", "other/b.yaml", "dc_motor"]) == ["a.yaml", "b.yaml", "dc_motor"]
    assert short_names(["/long/one/m.yaml", "/long/two/m.yaml"]) == ["one/m.yaml", "two/m.yaml"]
    assert short_names(["m.yaml", "m.yaml"]) == ["m.yaml", "m.yaml"]


def test_a_position_that_stands_still_is_refused_by_what_fits_and_compared_all_the_same(bags, tmp_path, capsys):
    record = read_record(bags[0], load_model("dc_motor"))
    output = record.output.copy()
    output[:, 0] = 0.7
    bag = write_bag(tmp_path / "dead", replace(record, output=output))
    for verb in ("fit", "diagnose", "refine", "identify"):
        more = ("--method", "arx", "--model", "dc_motor") if verb == "identify" else ()
        model = () if verb == "identify" else ("dc_motor",)
        assert main.run(words(verb, *model, bag, *more)) == 2
        out, err = capsys.readouterr()
        assert out == ""
        assert err.count("\n") == 1
        assert "motor.position stays at 0.7 while motor.velocity runs" in err
    assert main.run(words("compare", "dc_motor", bag)) == 0
    assert "motor.position never changes" in capsys.readouterr().err


def test_a_joint_may_have_another_name_in_the_bag(hidden, tmp_path, capsys):
    other = tmp_path / "other.yaml"
    with_joints(load_model(hidden.model), {"motor": "shaft"}).save(other)
    assert main.run(["fit", str(other), str(hidden.levels), "--criterion", "prediction"]) == 2
    assert "--joint shaft=" in capsys.readouterr().err
    assert main.run(["fit", str(other), str(hidden.levels), "--criterion", "prediction", "--joint", "shaft=motor"]) == 0
    assert "drive.gain" in capsys.readouterr().out
