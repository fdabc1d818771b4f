"""Compile what most starts need, once, as the last step of the set-up.

Otherwise the first live graph would do it in several processes at the same time.
"""

from __future__ import annotations

import contextlib
import gc
import importlib
import multiprocessing
from concurrent.futures import ProcessPoolExecutor

import numpy as np
from scipy.signal import lfilter

from idloop.control import build_controller
from idloop.diagnosis import diagnose
from idloop.diagnosis.design.suggest import suggest
from idloop.estimation.black_box.identification import identify
from idloop.estimation.black_box.method import Choices
from idloop.estimation.black_box.sampled import SampledData
from idloop.estimation.live_estimator import RecursiveEstimator
from idloop.estimation.observer.time_varying import scale_start, scalings_to_last, time_varying_observer
from idloop.estimation.statistics.whitening import fit_whitener
from idloop.physics import Engine, Plant, load_model
from idloop.physics.engine import Linear
from idloop.records import Record
from idloop.validation import compare

# What the verbs and nodes import when they start working; Python keeps its byte code beside each file.
LIBRARIES = (
    "control", "idloop.api.fit", "idloop.graph", "idloop.records.tables.importing", "idloop.validation",
    "matplotlib.pyplot", "mcap.reader", "mcap.writer", "rich.progress", "rosbags.highlevel", "scipy.optimize",
    "scipy.signal",
)  # fmt: skip
# Black-box methods that between them call everything that theirs have compiled. The recursive ones are compiled when
# they are first used, in a few seconds.
METHODS = ("n4sid", "vodma-direct", "pem", "narx-wavelet", "narx-neural")
HIDDEN = "dead_zone@input(width=0.3)"
# Those whose models run and look ahead by code of their own.
JUDGED = ("n4sid", "narx-neural")
NODES = ("rclpy", "idloop_nodes.nodes.estimator", "idloop_nodes.nodes.recorder")


def compile_all() -> None:
    """Compile on two cores: what has little in common side by side, the rest when what both need is there."""
    gc.disable()  # a compiler leaves little that has to be searched for
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn"), initializer=gc.disable) as pool:
        beside = [pool.submit(one) for one in (control_once, filter_once, identify_once)]
        import_all()
        simulate_once()
        beside.append(pool.submit(suggest_once))
        diagnose_once()
        for one in beside:
            one.result()


def import_all() -> None:
    """Import what the verbs and nodes import."""
    for name in LIBRARIES:
        importlib.import_module(name)
    for name in NODES:
        with contextlib.suppress(ImportError):  # a library without ROS is a library all the same
            importlib.import_module(name)


def simulate_once() -> None:
    """Call whatever moves, predicts and controls a machine on a few samples."""
    model = load_model("dc_motor").with_effect("coulomb_friction", "motor", level=0.1)
    engine = Engine(model)
    time = np.arange(20, dtype=np.float64) * np.float64(0.01)
    command = np.ones(20)
    output = engine.simulate(None, time, command, time)
    engine.predict(None, time, command, time, output, np.zeros((3, 2)))
    motion = output[:, :1], output[:, 1:], np.zeros((20, 1))
    engine.balance(None, *motion, time, command, time)
    engine.slopes(model.theta, 1e-6 * model.theta, time, command, time, engine.initial_state())
    plant = Plant(model)
    plant.measure()
    plant.step(1.0, 0.01)
    RecursiveEstimator(model, sample_time=0.01).update_block(time, command, output)


def control_once() -> None:
    """Take a step of a controller."""
    build_controller(load_model("dc_motor").controller).step(0.0, 0.0, {"motor.position": 0.0})


def filter_once() -> None:
    """Design a filter of residuals, and an observer that settles slowly."""
    residuals = np.random.default_rng(0).normal(size=(400, 2))
    fit_whitener([residuals], 2).apply(residuals)
    force = np.array([0.0, 1.0])
    linear = Linear(np.array([[0.0, 1.0], [0.0, -2.0]]), force, np.eye(2), force)
    observer = time_varying_observer(linear, [0, 1], 0.01, 1e-3, np.full(2, 0.01), np.ones(3), 20_000)
    scale_start(residuals, scalings_to_last(observer.covariances), observer.place)


def identify_once() -> None:
    """Identify a few samples of a linear system by one method of each kind that is compiled."""
    random = np.random.default_rng(0)
    command = random.normal(size=400)
    output = lfilter([0.0, 0.1, 0.05], [1.0, -1.5, 0.7], command) + 0.01 * random.normal(size=400)
    data = SampledData("a few samples", command[:, None], output[:, None], 0.01)
    for method in METHODS:
        # A network that is trained in free run calls all that one step ahead does.
        choices = Choices(order=2, focus="simulation" if method == "narx-neural" else "prediction")
        model = identify(data, method, choices).model
        if method in JUDGED:
            model.simulate(data)
            model.predict(data, 2)


def diagnose_once() -> None:
    """Weigh the whole catalogue on a few seconds of data, for whose compilation the first live diagnosis would wait."""
    model, record = load_model("dc_motor"), a_few_seconds()
    diagnose(model, [record])
    np.isfinite(compare(model, record).ahead)  # computed when it is asked for


def suggest_once() -> None:
    """Work out experiments, for whose compilation this verb would wait."""
    record = a_few_seconds()
    rivals = [load_model("dc_motor").with_effects([text]) for text in (HIDDEN, "coulomb_friction@motor(level=2.0)")]
    for way in ("command", "reference"):
        suggest(rivals, [record], duration=2.0, adds_to=way)


def a_few_seconds() -> Record:
    """A motor with something that the model does not have."""
    model = load_model("dc_motor")
    random = np.random.default_rng(0)
    time = np.arange(300, dtype=np.float64) * 0.01
    command = np.repeat(random.normal(size=15), 20)
    output = Engine(model.with_effects([HIDDEN])).simulate(None, time, command, time)
    noise = random.normal(size=output.shape) * [0.002, 0.01]
    units = tuple(signal.unit for signal in model.outputs)
    return Record(
        "a few seconds", time, command, time, output + noise,
        model.input.name, model.input.unit, model.output_names, units,
    )  # fmt: skip


if __name__ == "__main__":
    compile_all()
