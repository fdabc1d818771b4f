import json

import numpy as np
import pytest

from idloop.errors import InputError
from idloop.estimation.black_box.methods import METHODS
from idloop.estimation.networks import TrainingRules, load, narx_neural, narx_wavelet, save
from idloop.json_values import to_json


@pytest.fixture(scope="module")
def data(plant):
    return plant.narx(0)


@pytest.fixture(scope="module", params=["neural", "wavelet"])
def model(request, data):
    return narx_neural(data, rules=TrainingRules(epochs=20)) if request.param == "neural" else narx_wavelet(data)


def test_prediction_and_free_run_start_from_the_measurements(model, data):
    np.testing.assert_array_equal(model.predict(data)[: model.first], data.output[: model.first])
    np.testing.assert_array_equal(model.simulate(data)[: model.first], data.output[: model.first])
    np.testing.assert_array_equal(model.innovations(data)[: model.first], 0.0)


def test_the_furthest_prediction_is_the_free_run(model, data):
    np.testing.assert_array_equal(model.predict(data, len(data)), model.simulate(data))
    errors = [np.std(data.output - model.predict(data, steps)) for steps in (1, 5)]
    assert errors[0] < errors[1]


def test_initial_outputs(model, data):
    given = model.simulate(data, data.output[:2])
    np.testing.assert_array_equal(given, model.simulate(data))
    zero = model.simulate(data, "zero")
    np.testing.assert_array_equal(zero[:2], 0.0)
    # A stable plant forgets them.
    np.testing.assert_allclose(zero[-50:], given[-50:], atol=1e-6)


def test_the_free_run_needs_no_outputs(model, data, plant):
    blind = plant.pack(data.input, np.where(np.arange(len(data)) < 2, data.output[:, 0], 0.0))
    np.testing.assert_array_equal(model.simulate(blind), model.simulate(data))


def test_a_run_that_diverges_stays_finite(plant):
    data = plant.linear(0)
    net = narx_wavelet(data, units=3)
    wild = type(net)(**{**net.__dict__, "network": net.network._replace(linear=3 * net.network.linear)})
    run = wild.simulate(data)
    assert np.all(np.isfinite(run))
    # Fifty times the range about the middle.
    limit = 50 * np.ptp(data.output[2:])
    assert np.max(np.abs(run - net.network.output_center)) == pytest.approx(limit)


def test_other_data_than_the_model_is_for(model, data, plant):
    with pytest.raises(InputError, match="sample time"):
        model.simulate(plant.pack(data.input, data.output, sample_time=0.1))
    with pytest.raises(InputError, match="do not fill"):
        model.predict(data.part(0, 2))
    with pytest.raises(InputError, match="0 steps"):
        model.predict(data, 0)
    with pytest.raises(InputError, match="initial outputs"):
        model.simulate(data, np.zeros((3, 1)))
    two = np.hstack([data.input, data.input])
    with pytest.raises(InputError, match="2 inputs"):
        model.simulate(type(data)("two", two, data.output, 0.05, ("a", "b"), ("V", "V")))


def test_numbers_are_counted(data):
    assert narx_neural(data, rules=TrainingRules(epochs=1)).free == 10 * 5 + 10 + 1
    # Centres, dilations, weights, constant and the linear part.
    assert narx_wavelet(data).free == 25 * 4 + 25 + 25 + 1 + 4


def test_the_result_shows_itself(model, data):
    axes = model.plot()
    assert axes.get_ylabel() == "mean square of the scaled error [-]"
    assert model.history.stop in axes.get_title()
    values = model.to_dict()
    assert values["units"] == model.units
    assert values["delays"] == {"na": 2, "nb": 2, "nk": 1}
    assert len(values["history"]["train"]) == len(model.history.train)
    assert set(values["split"]) == {"train", "validation", "test"}


def test_a_saved_network_goes_on_as_it_was(model, data, tmp_path):
    again = load(save(model, tmp_path / "network.json"))
    np.testing.assert_array_equal(again.simulate(data), model.simulate(data))
    np.testing.assert_array_equal(again.predict(data, 3), model.predict(data, 3))
    assert to_json(again.to_dict()) == to_json(model.to_dict())
    # By the name that identifies another one.
    assert METHODS[again.method].kind == "network"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda d: d.pop("network"), "network"),
        (lambda d: d["network"].update(weight=[[1.0]]), "network|weight"),
        (lambda d: d["network"].update(lag=[0] * len(d["network"]["lag"])), "regressor"),
        (lambda d: d["network"].update(center=[None] * len(d["network"]["center"])), "center"),
        (lambda d: d.update(schema="idloop/linear-model/1"), "schema"),
    ],
)
def test_a_damaged_file_is_one_line(change, words, model, tmp_path):
    file = save(model, tmp_path / "network.json")
    document = json.loads(file.read_text())
    change(document)
    file.write_text(json.dumps(document))
    with pytest.raises(InputError, match=words) as caught:
        load(file)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [("a.npz", "", "suffix"), ("a.json", "{", "not valid JSON"), ("b.json", None, "cannot be read")],
)
def test_other_files_are_one_line(name, text, words, tmp_path):
    if text is not None:
        (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=words):
        load(tmp_path / name)


def test_the_free_run_is_a_system_of_python_control(model, data):
    import control

    short = data.part(0, 60)
    first = model.first
    state = np.concatenate([short.output[:first].ravel(), short.input[:first].ravel()])
    time = np.arange(len(short) - first) * short.sample_time
    run = control.input_output_response(model.system, time, short.input[first:].T, state)
    np.testing.assert_allclose(run.outputs.ravel(), model.simulate(short)[first:].ravel(), atol=1e-12)
