"""`idloop identify`: from a bag to models of any method, tables, one document, figures and a file of the model."""

from __future__ import annotations

import json
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from idloop.cli import main
from idloop.cli._identification_arguments import NumbersArgument, parse_structure, parse_sweep, parse_values
from idloop.errors import InputError
from idloop.estimation.black_box.method import Identified
from idloop.estimation.black_box.methods import METHODS
from idloop.estimation.black_box.sampled import SampledData
from idloop.estimation.linear import load
from idloop.physics import load_model, simulate
from idloop.records import Record, make_stream, write_bag
from idloop.reporting.text.identification import pole_row
from idloop.validation.identification_outcome import Outcome, excitation_measure
from idloop.validation.score import Score

# The preset's velocity: J dv/dt + B v = drive gain u.
POLE = -2.306


def write_recording(path: Path, seed: int, gain: float = 1.0, hold: int = 10) -> Path:
    """Record of the preset, 12 s at 50 Hz with a little noise."""
    model = load_model("dc_motor")
    random = np.random.default_rng(seed)
    time = np.arange(600) * 0.02
    command = gain * np.repeat(random.uniform(-3.0, 3.0, 600 // hold), hold)
    output = simulate(model, time, command, time).output + random.normal(size=(600, 2)) * [1e-2, 2e-2]
    units = tuple(o.unit for o in model.outputs)
    record = Record(path.name, time, command, time, output, model.input.name, "V", model.output_names, units)
    return write_bag(path, record)


@pytest.fixture(scope="module")
def bags(tmp_path_factory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("bags")
    return write_recording(folder / "train", 1), write_recording(folder / "unseen", 2)


def run(capsys, *words):
    code = main.run(["identify", *map(str, words)])
    out, err = capsys.readouterr()
    return code, out, err


VELOCITY = ("--output", "motor.velocity")


@pytest.mark.slow
def test_several_methods_are_judged_on_the_same_unseen_data(bags, tmp_path, capsys):
    figure = tmp_path / "compare.svg"
    methods = ["n4sid", "oe", "narx-wavelet", "welch", "cra"]
    words = [word for name in methods for word in ("--method", name)]
    code, out, err = run(capsys, bags[0], *words, "--order", 2, "--validate", bags[1], "--plot", figure, "--json")
    assert (code, err) == (0, f"written: {figure}\n")
    document = json.loads(out)
    assert document["schema"] == "idloop/identify/1"
    assert (document["judged_on"], document["validation"], document["steps"]) == ("validation", ["unseen"], 10)
    assert [one["label"] for one in document["results"]] == methods
    assert "seconds" not in out
    by_name = {one["label"]: one for one in document["results"]}
    for name in ("n4sid", "oe"):
        one = by_name[name]
        assert one["free_run"]["fit"]["motor.velocity"] > 98
        assert set(one) > {"loss", "fpe", "aic", "bic", "states", "stable", "residual", "model", "order", "delay"}
        assert [test["output"] for test in one["residual"]] == ["motor.position", "motor.velocity"]
    assert (by_name["n4sid"]["states"], by_name["n4sid"]["delay"], by_name["oe"]["delay"]) == (2, None, 1)
    assert by_name["narx-wavelet"]["stable"] is None
    assert "free_run" not in by_name["welch"]
    text = figure.read_text(encoding="utf-8")
    for words_of_the_figure in (
        "magnitude [",
        "bands of 95 %",
        "phase [deg]",
        "weight [",
        "residual [",
        "singular value",
    ):
        assert words_of_the_figure in text


def test_one_model_shows_its_poles_and_coefficients_and_is_saved(bags, tmp_path, capsys):
    file = tmp_path / "motor.json"
    words = (bags[0], "--method", "oe", "--order", 1, *VELOCITY, "--model", "dc_motor", "--save", file)
    code, out, err = run(capsys, *words)
    assert (code, err) == (0, f"written: {file}\n")
    for text in ("fitted: train", "natural frequency Hz", "b1[motor.effort]", "standard error", "residual of motor"):
        assert text in out
    model = load(file)
    assert model.output_units == ("rad/s",)
    assert np.log(model.poles[0].real) / model.sample_time == pytest.approx(POLE, rel=0.02)
    assert model.system.dt == 0.02
    assert run(capsys, *words)[0] == 2
    assert run(capsys, *words, "--force")[0] == 0
    npz = tmp_path / "motor.npz"
    assert run(capsys, *words[:-1], npz)[0] == 0
    np.testing.assert_array_equal(load(npz).a, model.a)


def test_a_sweep_of_orders_is_a_table_and_a_figure(bags, tmp_path, capsys):
    figure = tmp_path / "orders.svg"
    words = (bags[0], "--method", "n4sid", "--validate", bags[1], "--sweep", "order=1:4", "--plot", figure)
    code, out, _ = run(capsys, *words, "--json")
    assert code == 0
    sweep = json.loads(out)["sweep"]
    assert (sweep["over"], [row["value"] for row in sweep["rows"]]) == ("order", [1, 2, 3, 4])
    fits = [row["free_run"]["mean_fit"] for row in sweep["rows"]]
    assert fits[0] < 90
    assert fits[1] > 99
    assert sweep["best"]["n4sid"] >= 2
    assert "FIT, free run [%]" in figure.read_text(encoding="utf-8")
    code, out, _ = run(capsys, *words)
    assert code == 0
    assert "best free run at order" in out


@pytest.mark.slow
def test_the_least_order_that_is_as_good_as_the_best_is_named(bags, capsys):
    words = (bags[0], "--method", "oe", *VELOCITY, "--validate", bags[1], "--sweep", "order=1:5")
    code, out, _ = run(capsys, *words, "--json")
    sweep = json.loads(out)["sweep"]
    assert code == 0
    # The velocity is of first order.
    assert sweep["smallest"] == {"oe": 1}
    code, out, _ = run(capsys, *words)
    assert sweep["best"]["oe"] == 1 or "oe: order 1 is as good as that" in out
    # Too small orders are not taken for as good.
    code, out, _ = run(capsys, bags[0], "--method", "n4sid", "--validate", bags[1], "--sweep", "order=1:4", "--json")
    sweep = json.loads(out)["sweep"]
    assert 2 <= sweep["smallest"]["n4sid"] <= sweep["best"]["n4sid"]


def test_an_order_at_the_limit_of_those_tried_says_so(bags, capsys):
    words = (bags[0], "--method", "arx", *VELOCITY)
    code, out, _ = run(capsys, *words, "--order", "1:2")
    assert code == 0
    assert "order 2, delay 1: the least BIC of 2 tried; none higher was tried: --order 1:4 looks further" in out
    code, out, _ = run(capsys, *words, "--order", "1:2", "--json")
    assert json.loads(out)["results"][0]["order_at_limit"] is True
    assert "looks further" not in run(capsys, *words, "--order", "2")[1]


def test_degrees_go_to_the_methods_that_have_them(bags, capsys):
    words = ("--method", "arx", "--method", "oe", *VELOCITY, "--structure", "na=1,nb=1,nf=2", "--json")
    code, out, _ = run(capsys, bags[0], *words)
    assert code == 0
    assert [one["states"] for one in json.loads(out)["results"]] == [1, 2]


@pytest.fixture(scope="module")
def closed(tmp_path_factory) -> Path:
    """First-order axis behind a proportional controller with a loud sensor."""
    random, samples = np.random.default_rng(4), 3000
    time, r = 0.01 * np.arange(samples), np.repeat(random.choice([-1.0, 1.0], samples // 20), 20)
    y, u, speed = np.zeros(samples), np.zeros(samples), 0.0
    for k in range(samples):
        y[k] = speed + 0.2 * random.normal()
        u[k] = 2.0 * (r[k] - y[k])
        speed = 0.95 * speed + 0.05 * u[k]
    record = Record(
        "closed", time, u, time, y[:, None], "motor.effort", "V", ("motor.velocity",), ("rad/s",),
        reference_time=time, reference=np.column_stack([r, np.full(samples, np.nan)]),
    )  # fmt: skip
    return write_bag(tmp_path_factory.mktemp("closed") / "closed", record)


def test_methods_for_the_open_loop_are_named_on_data_of_a_closed_one(closed, bags, capsys):
    words = (closed, "--method", "n4sid", "--method", "pbsid", "--order", 1)
    code, out, _ = run(capsys, *words)
    assert code == 0
    (line,) = (line for line in out.splitlines() if "the loop was closed" in line)
    assert "n4sid is for an open loop and biased by it" in line
    assert "right here: pbsid, pem, bj" in line
    loop = json.loads(run(capsys, *words, "--json")[1])["loop"]
    assert (loop["closed"], loop["biased_methods"]) == (True, ["n4sid"])
    assert "pbsid" in loop["suitable_methods"]
    assert "the loop was closed" in run(capsys, *words[:3], "--sweep", "order=1:2")[1]
    assert "the loop was closed" not in run(capsys, closed, "--method", "pbsid", "--order", 1)[1]
    code, out, _ = run(capsys, bags[0], "--method", "n4sid", "--order", 2, "--json")
    assert json.loads(out)["loop"]["closed"] is False


def test_a_response_tells_its_resolution(bags, capsys):
    code, out, _ = run(capsys, bags[0], "--method", "spa", *VELOCITY)
    assert code == 0
    assert re.search(r"resolution .*\n.*\nspa .* Hz +[\d.]+ Hz ", out)


def test_a_response_begins_at_its_resolution(bags, capsys):
    _, out, _ = run(capsys, bags[0], "--method", "spa", *VELOCITY)
    begins, resolution = re.search(r"\nspa +motor.velocity +\d+ +([\d.]+) to [\d.]+ Hz +([\d.]+) Hz", out).groups()
    assert float(begins) >= 0.999 * float(resolution)


def test_coefficients_that_change_are_judged_as_they_went(bags, tmp_path, capsys):
    code, out, _ = run(capsys, bags[0], "--method", "kalman", "--method", "arx", "--order", 1, *VELOCITY)
    assert code == 0
    table = out.partition("coefficients of each instant")[2]
    went, held = map(float, re.search(r"\nkalman +motor.velocity +([\d.]+) +([\d.]+)\n", table).groups())
    assert 90.0 < held <= went + 0.5
    assert "have the last coefficients" in table
    assert "\narx" not in table.partition("\n\n")[0]
    document = json.loads(run(capsys, bags[0], "--method", "kalman", "--order", 1, *VELOCITY, "--json")[1])
    (history,) = document["results"][0]["history"]
    assert history["names"] == ["a1", "b1[motor.effort]"]
    assert history["fit_on_the_way"] == pytest.approx(went, abs=0.01)
    assert "coefficients of each instant" not in run(capsys, bags[0], "--method", "arx", "--order", 1, *VELOCITY)[1]


def test_seconds_to_drop_are_held_against_the_record(bags, capsys):
    code, out, err = run(capsys, bags[0], "--method", "arx", "--drop", 100)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "--drop 100: nothing left after that at both ends: the record is 11.98 s long, drop less than 5.99" in err


def test_a_model_file_names_the_method_that_was_asked_for(bags, tmp_path, capsys):
    path = tmp_path / "model.json"
    assert run(capsys, bags[0], "--method", "pem", "--order", 1, *VELOCITY, "--save", path)[0] == 0
    saved = json.loads(path.read_text(encoding="utf-8"))
    assert (saved["method"], saved["start"]) == ("pem", "pbsid")


def test_instruments_say_why_their_prediction_is_worse_than_their_free_run():
    def outcome(name, free_run, ahead):
        found = Identified(METHODS[name], SimpleNamespace(form=""), 2)
        return Outcome(name, found, Score(10, ("y",), np.array([free_run]), np.array([ahead]), (), ()))

    hint = outcome("iv4", 90.0, -25.0).hint
    assert "10 ahead is worse than the free run" in hint
    assert "no noise model" in hint
    assert not outcome("iv4", 90.0, 91.0).hint
    assert not outcome("arx", 90.0, -25.0).hint


def test_a_network_that_only_predicts_says_what_to_try():
    def outcome(name, free_run, ahead, form="series-parallel"):
        found = Identified(METHODS[name], SimpleNamespace(form=form), 2)
        return Outcome(name, found, Score(10, ("y",), np.array([free_run]), np.array([ahead]), (), ()))

    hint = outcome("narx-neural", -30.0, 90.0).hint
    assert "--focus simulation, more delays (--order 4)" in hint
    assert "--focus" not in outcome("narx-neural", -30.0, 90.0, "parallel").hint
    assert not outcome("narx-neural", 85.0, 90.0).hint
    assert not outcome("oe", -30.0, 90.0).hint


def test_a_sweep_over_bags_gives_each_a_model_of_its_own(bags, tmp_path, capsys):
    loud, quiet, other = (write_recording(tmp_path / f"{name}", 5, gain) for name, gain in
                          (("loud", 1.0), ("quiet", 0.1), ("other", 0.5)))  # fmt: skip
    figure = tmp_path / "amplitudes.svg"
    words = ("--method", "oe", "--method", "n4sid", "--order", 1, *VELOCITY, "--model", "dc_motor")
    swept = (loud, quiet, other, *words, "--sweep", "amplitude")
    code, out, err = run(capsys, *swept, "--validate", bags[1], "--plot", figure, "--json")
    assert (code, err) == (0, f"written: {figure}\n")
    sweep = json.loads(out)["sweep"]
    assert (sweep["over"], sweep["unit"]) == ("amplitude", "V")
    assert [row["record"] for row in sweep["rows"][::2]] == ["quiet", "other", "loud"]
    values = [row["value"] for row in sweep["rows"][::2]]
    # Levels between -3 and 3 V have a deviation of root 3.
    assert values[2] == pytest.approx(np.sqrt(3.0), rel=0.2)
    assert values == pytest.approx([0.1 * values[2], 0.5 * values[2], values[2]])
    # All are judged on the same unseen data, and the louder one knows more.
    fits = [row["free_run"]["mean_fit"] for row in sweep["rows"] if row["method"] == "oe"]
    assert fits[2] > 98
    assert fits[2] > fits[0]
    assert "amplitude [V]" in figure.read_text(encoding="utf-8")
    out = run(capsys, *swept)[1]
    assert "record  amplitude [V]  method" in out
    assert re.search(r"oe: best free run at amplitude 1\.\d+ V: mean FIT", out)


def test_the_bandwidth_of_a_bag_is_that_of_its_command(tmp_path, capsys):
    slow, quick = write_recording(tmp_path / "slow", 5, hold=20), write_recording(tmp_path / "quick", 6, hold=4)
    words = ("--method", "oe", "--order", 1, *VELOCITY, "--sweep", "bandwidth")
    code, out, _ = run(capsys, quick, slow, *words, "--json")
    assert code == 0
    sweep = json.loads(out)["sweep"]
    assert (sweep["unit"], [row["record"] for row in sweep["rows"]]) == ("Hz", ["slow", "quick"])
    assert sweep["rows"][0]["value"] < 0.5 * sweep["rows"][1]["value"]


@pytest.mark.parametrize("hold", [4, 25])
def test_amplitude_and_bandwidth_of_random_levels(hold):
    command = 0.5 + 2.0 * np.repeat(np.random.default_rng(hold).choice([-1.0, 1.0], 100_000 // hold), hold)[:, None]
    data = SampledData("levels", command, command, 0.01)
    parts = [data.part(0, 40_000), data.part(40_000, 100_000)]
    assert excitation_measure("amplitude", parts) == pytest.approx(2.0, rel=0.01)
    # The spectrum of what is held for T is a squared sinc: three quarters lie below 0.47 / T.
    assert excitation_measure("bandwidth", parts) == pytest.approx(0.47 / (0.01 * hold), rel=0.07)


def test_sweeps_of_horizon_and_sample_time_leave_out_what_fails(bags, capsys):
    words = (bags[0], "--method", "n4sid", "--method", "arx", "--order", 2)
    code, out, _ = run(capsys, *words, "--sweep", "horizon=2,10", "--json")
    rows = json.loads(out)["sweep"]["rows"]
    assert code == 0
    assert [row["error"] is None for row in rows] == [True] * 4
    code, out, _ = run(capsys, *words, "--sweep", "sample-time=0.02,0.04,5")
    assert code == 0
    assert "failed" in out.splitlines()[2]
    assert "0.04" in out


def test_orders_delays_and_trends_are_as_asked(bags, capsys):
    words = (bags[0], "--method", "arx", *VELOCITY, "--order", "1:3", "--delay", "auto", "--detrend", "mean")
    code, out, _ = run(capsys, *words, "--drop", 1, "--sample-time", 0.04, "--criterion-steps", 5, "--json")
    assert code == 0
    document = json.loads(out)
    (one,) = document["results"]
    assert (document["sample_time"], document["detrend"], document["steps"], one["delay"]) == (0.04, "mean", 5, 1)
    assert [trial["order"] for trial in one["trials"]] == [1, 2, 3]
    assert one["model"]["samples"] < 10.0 / 0.04 + 2
    assert one["ahead"]["steps"] == 5
    code, out, _ = run(capsys, *words)
    assert "the least BIC of 3 tried" in out


def test_a_delay_is_one_row_of_poles(bags, capsys):
    code, out, _ = run(capsys, bags[0], "--method", "arx", "--order", 1, "--delay", 5, *VELOCITY)
    assert code == 0
    assert "0 (4 times)" in out


def test_a_known_controller_comes_from_a_model_file(bags, tmp_path, capsys):
    model = tmp_path / "loop.yaml"
    assert main.run(["model", "dc_motor"]) == 0
    lines = [line for line in capsys.readouterr().out.splitlines() if not line.startswith("controller")]
    spec = "controller: {type: p, output: motor.position, kp: 0.0, sample_time: 0.02}"
    model.write_text("\n".join([*lines, spec, ""]), encoding="utf-8")
    code, out, err = run(capsys, bags[0], "--method", "vodma", "--order", 2, "--controller", model, "--json")
    assert (code, err) == (0, "")
    assert json.loads(out)["results"][0]["states"] == 2
    code, _, err = run(capsys, bags[0], "--method", "vodma", "--order", 2)
    assert code == 2
    assert "--controller" in err


def test_one_failure_of_several_is_told_and_exit_code_1(bags, capsys):
    code, out, err = run(capsys, bags[0], "--method", "arx", "--method", "indirect", "--order", 2, *VELOCITY)
    assert code == 1
    assert err.splitlines()[-1].startswith("idloop identify: 1 of 2 models failed: indirect: train: no reference")
    assert "indirect: failed: train: no reference recorded" in out
    assert "motor.velocity" in out


def test_options_that_mean_nothing_are_said_on_stderr(bags, capsys):
    words = (bags[0], "--method", "arx", "--method", "n4sid", "--order", 2, "--stable", "--horizon", 8, *VELOCITY)
    code, out, err = run(capsys, *words, "--json")
    assert code == 0
    assert json.loads(out)["results"]
    assert err == "note: --horizon means nothing to arx\nnote: --stable means nothing to arx\n"


def test_the_methods_are_listed_without_a_bag(capsys):
    code, out, _ = run(capsys, "--list")
    assert code == 0
    assert all(f"\n{name} " in out for name in METHODS)
    code, out, _ = run(capsys, "--list", "--json")
    assert [one["name"] for one in json.loads(out)["methods"]] == list(METHODS)


@pytest.mark.parametrize(
    ("words", "expected"),
    (
        ([], "--method"),
        (["--method", "n5sid"], "did you mean 'n4sid'"),
        (["--method", "oe", "--order", "x"], "--order x: write 3, 1:8 or 1,2,4"),
        (["--method", "oe", "--order", "0"], "least value is 1"),
        (["--method", "oe", "--output", "motor.torque"], "has no measured output"),
        (["--method", "oe", "--model", "dc_motor", "--output", "motor.torque"], "no output"),
        (["--method", "oe", "--sample-time", "-1"], "must be positive"),
        (["--method", "oe", "--drop", "7"], "nothing left"),
        (["--method", "oe", "--sweep", "ordre=1:3"], "did you mean 'order'"),
        (["--method", "oe", "--sweep", "sample-time=0.01:0.05"], "0.01:0.05:0.01"),
        (["--method", "spa", "--sweep", "order=1:3"], "responses"),
        (["--method", "oe", "--sweep", "amplitude"], "two or more"),
        (["--method", "oe", "--sweep", "bandwidth=1:3"], "its own bandwidth"),
        (["--method", "oe", "--sweep", "amplitud"], "did you mean 'amplitude'"),
        (["--method", "oe", "--structure", "nx=2"], "nb"),
        (["--method", "oe", "--structure", "na=2"], "oe has nb, nf; leave na out"),
        (["--method", "arx", "--structure", "nb=0"], "the command has no effect"),
        (["--method", "oe", "--sample-time", "0.004"], "a sample every 0.02 s"),
        (["--method", "oe", "--save", "model.mat"], "suffix"),
        (["--method", "spa", "--save", "model.json", "--plot", "f.svg"], "a response and no model"),
        (["--method", "narx-wavelet", "--save", "model.npz"], "suffix .json"),
        (["--method", "oe", "--method", "arx", "--save", "model.json"], "one --method"),
        (["--method", "bla"], "--period"),
        (["--method", "oe", "--joint", "moter"], "did you mean 'motor'"),
        (["--method", "n4sid", "--order", "40", "--horizon", "4"], "longer horizon"),
    ),
)
def test_wrong_use_is_one_line(words, expected, bags, capsys):
    code, out, err = run(capsys, bags[0], *words)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert expected in err


def test_a_missing_bag_is_one_line(capsys):
    assert run(capsys, "--method", "oe")[0] == 2
    code, _, err = run(capsys, "nowhere", "--method", "oe")
    assert code == 2
    assert "no bag nowhere" in err


@pytest.mark.slow
def test_a_best_linear_approximation_tells_noise_from_nonlinearity(tmp_path, capsys):
    said = []
    for cubic in (0.0, 0.1):
        random = np.random.default_rng(3)
        time = np.arange(2000) * 0.01
        lines = np.arange(1, 60, 2)
        lines = np.delete(lines, random.integers(0, len(lines), 8))
        angles = 2.0 * np.pi * (0.5 * np.outer(time, lines) + random.uniform(size=len(lines)))
        command = np.sum(np.cos(angles), axis=1) / 3.0
        speed = lfilter([0.1], [1.0, -0.9], command + cubic * command**3) + 1e-3 * random.normal(size=2000)
        record = Record(
            "periodic", time, command, time, speed[:, None], "motor.effort", "V", ("motor.velocity",), ("rad/s",)
        )
        bag = write_bag(tmp_path / f"cubic{cubic}", record)
        figure = tmp_path / f"{cubic}.svg"
        assert main.run(["identify", str(bag), "--method", "bla", "--period", "2.0", "--plot", str(figure)]) == 0
        row = next(line for line in capsys.readouterr().out.partition("nonlinear %")[2].splitlines() if "bla" in line)
        said.append([float(word) for word in row.split()[2:]])
        assert "total error" in figure.read_text(encoding="utf-8")
    (quiet, straight, *_), (noise, bent, odd, even) = said
    assert bent > 20.0 * straight
    assert noise < 3.0 * quiet
    assert odd > 20.0 * max(even, quiet)


@pytest.mark.parametrize("moves", [True, False])
def test_another_command_that_moves_is_told_to_be_left_out(tmp_path, capsys, moves):
    random = np.random.default_rng(4)
    stamps = 10**9 + 2 * 10**7 * np.arange(600)
    one, other = (np.repeat(random.choice([-1.0, 1.0], 60), 10) for _ in range(2))
    speed = lfilter([0.0, 0.1], [1.0, -0.9], one + moves * other) + 1e-2 * random.normal(size=600)
    command = {"m": {"effort": one}, "m2": {"effort": other if moves else np.zeros(600)}}
    streams = [
        make_stream("/axis/joint_command", stamps, command),
        make_stream("/axis/joint_states", stamps, {"m": {"velocity": speed}}),
    ]
    bag = write_bag(tmp_path / "two", streams)
    code, out, err = run(capsys, bag, "--joint", "m", "--method", "arx", "--order", 1, "--json")
    assert code == 0
    notes = json.loads(out)["notes"]
    assert err.splitlines() == notes
    assert len(notes) == moves
    if moves:
        assert notes[0].startswith("two: the bag holds the effort of joint m2 as well, which is left out")


def test_a_linear_plant_is_said_to_show_no_nonlinearity(tmp_path, capsys):
    random = np.random.default_rng(6)
    time = np.arange(1200) * 0.01
    lines = np.arange(1, 60)
    bags = []
    for number in range(4):
        angles = 2.0 * np.pi * (0.5 * np.outer(time, lines) + random.uniform(size=len(lines)))
        command = np.sum(np.cos(angles), axis=1) / 3.0
        speed = lfilter([0.1], [1.0, -0.9], command) + 1e-2 * random.normal(size=1200)
        record = Record(
            f"r{number}", time, command, time, speed[:, None], "motor.effort", "V", ("motor.velocity",), ("rad/s",)
        )
        bags.append(write_bag(tmp_path / f"r{number}", record))
    words = ("--method", "bla", "--period", "2.0")
    code, out, _ = run(capsys, *bags, *words)
    assert code == 0
    assert re.search(r"bla, motor\.velocity: nonlinear: not seen \(p = 0\.\d+\)", out)
    (result,) = json.loads(run(capsys, *bags, *words, "--json")[1])["results"]
    (p_value,) = result["model"]["distortion"]["p_values"]["stochastic"]
    assert p_value == result["model"]["distortion"]["shares"][0]["p_stochastic"] > 0.05


def test_a_bag_that_the_fit_sees_judges_nothing(bags, capsys):
    train = str(bags[0])
    for words in (["identify", train, "--method", "arx"], ["fit", "dc_motor", train], ["refine", "dc_motor", train]):
        assert main.run([*words, "--validate", train]) == 2
        assert "the fit sees this bag" in capsys.readouterr().err


@pytest.mark.parametrize("words", [["fit", "dc_motor"], ["diagnose", "dc_motor"]])
def test_one_recording_counts_once(words, bags, capsys):
    train = Path(bags[0])
    assert main.run([*words, str(train), str(train.parent / "." / ".." / train.parent.name / train.name)]) == 2
    err = capsys.readouterr().err
    assert "is given twice" in err
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("text", "values"),
    (("3", (3,)), ("1:4", (1, 2, 3, 4)), ("2:8:3", (2, 5, 8)), ("1,4:6", (1, 4, 5, 6))),
)
def test_numbers_are_read(text, values):
    assert parse_values(text, "--order", whole=True, least=1) == values


@pytest.mark.parametrize("text", ("", "a", "1:", "4:1", "1:9999", "1:2:3:4", "1:4:0", "1.5"))
def test_what_is_no_range_is_refused(text):
    with pytest.raises(InputError, match="write 3, 1:8"):
        parse_values(text, "--order", whole=True, least=1)


def test_times_and_degrees_are_read():
    assert parse_sweep("sample_time=0.01:0.03:0.01").values == pytest.approx((0.01, 0.02, 0.03))
    assert parse_structure("na=2, nb=1") == {"na": 2, "nb": 1}
    assert parse_structure(None) == {}
    assert NumbersArgument(1).convert("auto", None, None) == "auto"


def test_a_pole_is_told_in_continuous_time():
    pole = np.exp((-1.0 + 2.0j) * 0.1)
    _, size, natural, damping, time = pole_row(pole, 0.1)
    assert float(size) == pytest.approx(np.exp(-0.1), rel=1e-5)
    assert float(natural) == pytest.approx(np.sqrt(5) / (2 * np.pi), rel=1e-3)
    assert (float(damping), float(time)) == (pytest.approx(0.4472, rel=1e-3), 1.0)


def test_poles_of_an_integrator_and_of_growth_are_told_as_such():
    assert pole_row(0.99999 + 0j, 0.01, 30.0)[2:4] == ("-", "integrator")
    assert pole_row(1.00001 + 0j, 0.01, 30.0)[2:4] == ("-", "integrator")
    assert pole_row(0.999 + 0j, 0.01, 30.0)[3] == "1"
    _, _, natural, damping, time = pole_row(1.002 + 0j, 0.01, 30.0)
    assert (natural, damping) == ("-", "-")
    assert time.startswith("grows, 5.00")
    assert float(pole_row(1.002 * np.exp(0.1j), 0.01, 30.0)[3]) < 0


def same_line(ours: str, shown: str) -> bool:
    """Equal words, and numbers within five per cent or half a FIT point."""

    def number(word):
        try:
            return float(word)
        except ValueError:
            return None

    pairs = list(zip(ours.split(), shown.split(), strict=False))
    return len(ours.split()) == len(shown.split()) and all(
        a == b if number(b) is None or number(a) is None else number(a) == pytest.approx(number(b), rel=0.05, abs=0.5)
        for a, b in pairs
    )


@pytest.mark.slow
def test_the_documentation_shows_what_its_commands_print(data_dir: Path, tmp_path: Path, monkeypatch, capsys):
    for name in ("dcmotor_fra233", "silverbox"):
        if not (data_dir / name).is_dir():
            pytest.skip(f"no {data_dir / name}: set IDLOOP_DATA to the folder of the measured data")
    page = (Path(__file__).parents[2] / "docs" / "how-to" / "black-box.md").read_text(encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bags").mkdir()
    printed = ""
    for language, block in re.findall(r"```(sh|text)\n(.*?)```", page, re.DOTALL):
        if language == "text":
            lines = printed.splitlines()
            for shown in block.strip().splitlines():
                if set(shown) != {"-", " "}:
                    assert any(same_line(ours, shown) for ours in lines), shown
            continue
        for line in block.strip().splitlines():
            words = line.partition("  #")[0].replace("../shared/data", str(data_dir)).split()
            assert words[0] == "idloop"
            assert main.run(words[1:]) == 0, line
            printed = capsys.readouterr().out
    for name, method in METHODS.items():
        assert f"| `{name}` | {method.summary} | {method.loop} | {method.source} |" in page


@pytest.mark.slow
def test_a_real_oscillator_by_way_of_the_command_line(data_dir: Path, tmp_path: Path, capsys):
    source = data_dir / "silverbox" / "SNLS80mV.csv"
    if not source.is_file():
        pytest.skip(f"no {source}: set IDLOOP_DATA to the folder of the measured data")
    for part in ("multisine_1", "multisine_2"):
        assert main.run(["import", "silverbox", str(source), str(tmp_path / part), "--part", part]) == 0
    capsys.readouterr()
    bags = (tmp_path / "multisine_1", "--validate", tmp_path / "multisine_2", "--detrend", "mean")
    code, out, _ = run(capsys, *bags, "--method", "oe", "--method", "narx-wavelet", "--order", 2, "--json")
    assert code == 0
    linear, network = json.loads(out)["results"]
    # A Duffing oscillator: the best linear model leaves what its spring hardens by.
    assert 80 < linear["free_run"]["mean_fit"] < 90 < network["free_run"]["mean_fit"]
    pole = max(linear["model"]["poles"], key=lambda p: p["imag"])
    natural = abs(np.log(complex(pole["real"], pole["imag"]))) / 0.0016384 / (2 * np.pi)
    assert 60 < natural < 80
