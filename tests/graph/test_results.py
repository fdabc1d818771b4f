"""What a live estimator found, read back from its bag without ROS."""

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop.errors import IdloopError
from idloop.graph import LiveResult, read_results
from idloop_nodes.codec import (
    FitSummary,
    ParameterSummary,
    Status,
    encode_diagnostics,
    fit_to_statuses,
    parameters_to_statuses,
)
from idloop_nodes.streams.bag_writer import BagWriter
from idloop_nodes.topics import DIAGNOSTICS

FIT, PARAMETERS = "/left/estimator/fit", "/left/estimator/parameters"


def write(folder, said):
    writer = BagWriter(folder, dict.fromkeys((FIT, PARAMETERS, "/left/motor/wear"), DIAGNOSTICS), "kilted")
    for stamp, (topic, statuses) in enumerate(said):
        writer.write(topic, stamp, encode_diagnostics(stamp, statuses))
    writer.close()
    return folder


def fitted(percent):
    return FIT, fit_to_statuses("e", FitSummary("m", fit={"motor.position": percent}, fit_train={"motor.position": 99}))


def test_the_newest_fit_counts(tmp_path):
    inertia = ParameterSummary("motor.inertia", 1.5, 0.25, "kg·m²")
    said = [fitted(80.0), (PARAMETERS, parameters_to_statuses("e", [inertia])), fitted(90.0)]
    found = read_results(write(tmp_path / "bag", said))
    assert found.fits == 2
    assert found.fit == {"motor.position": 90.0}
    assert found.fit_train == {"motor.position": 99.0}
    assert found.parameters == {"motor.inertia": {"value": 1.5, "stderr": 0.25, "unit": "kg·m²"}}
    assert not found.error


def test_whether_an_estimate_may_be_trusted_is_read_where_it_was_said(tmp_path):
    inertia = ParameterSummary("motor.inertia", 1.5, 0.01, "kg·m²", trusted=True, why="nothing is missing")
    said = [fitted(80.0), (PARAMETERS, parameters_to_statuses("e", [inertia]))]
    found = read_results(write(tmp_path / "bag", said)).parameters["motor.inertia"]
    assert (found["trusted"], found["why"]) == (True, "nothing is missing")


def test_a_bag_without_fits_has_none(tmp_path):
    assert read_results(write(tmp_path / "bag", [("/left/motor/wear", [])])) == LiveResult()


@pytest.mark.parametrize("statuses", [[], [Status("another's", "hello")]])
def test_messages_of_somebody_else_are_one_line(tmp_path, statuses):
    with pytest.raises(IdloopError, match="cannot be read") as caught:
        read_results(write(tmp_path / "bag", [(FIT, statuses)]))
    assert "\n" not in str(caught.value)
