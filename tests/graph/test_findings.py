"""What a live estimator found missing, read back from its bag without ROS."""

import json

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop.errors import IdloopError
from idloop.graph import Findings, read_findings
from idloop.physics import load_model
from idloop_nodes.codec import (
    EffectEvidence,
    EvidenceSummary,
    LadderSummary,
    MissingSummary,
    Status,
    encode_diagnostics,
    evidence_to_statuses,
    no_diagnosis,
)
from idloop_nodes.streams.bag_writer import BagWriter
from idloop_nodes.topics import DIAGNOSTICS

TOPICS = {
    MissingSummary: "/estimator/missing_effects",
    LadderSummary: "/estimator/ladder",
    EvidenceSummary: "/estimator/evidence",
}


def write(folder, said):
    writer = BagWriter(folder, dict.fromkeys(TOPICS.values(), DIAGNOSTICS), "kilted")
    for stamp, one in enumerate(said):
        statuses = evidence_to_statuses("e", one) if isinstance(one, EvidenceSummary) else one.statuses
        writer.write(TOPICS[type(one)], stamp, encode_diagnostics(stamp, statuses))
    writer.close()
    return folder


def ladder(suggested=None):
    document = json.dumps({"ladder": [], "suggested_experiment": suggested})
    return LadderSummary((Status("e: ladder", values={"document": document, "error": ""}),))


def test_everything_that_was_said_is_read_in_order(tmp_path):
    document = json.dumps({"verdict": "missing", "set": ["a@b"]})
    values = {"where": '["here"]', "windows": "1-2 3-4", "document": document, "error": ""}
    first = MissingSummary((Status("e: missing effects", values=values),))
    failed = no_diagnosis("e", load_model("dc_motor"), "auto", 0.01, "the worker process ended")
    experiment = {"text": "try", "adds_to": "command"}
    said = [first, ladder(), ladder(experiment), ladder(experiment), failed, ladder()]
    found = read_findings(write(tmp_path / "bag", said))
    assert found.diagnoses[0] == {
        "verdict": "missing",
        "set": ["a@b"],
        "where": ["here"],
        "windows": [[1, 2], [3, 4]],
    }
    assert found.diagnoses[1]["error"] == "the worker process ended"
    assert found.experiments == (experiment,)
    assert found.ladder == {"ladder": [], "suggested_experiment": None}


def test_the_evidence_is_a_series(tmp_path):
    said = [
        EvidenceSummary(
            "m", threshold=7.5, looks=looks, samples=100 * looks, candidates=(EffectEvidence("a@b", 5.0 * looks),)
        )
        for looks in (1, 2)
    ]
    found = read_findings(write(tmp_path / "bag", said)).evidence
    assert [one["samples"] for one in found] == [100, 200]
    assert [one["candidates"][0]["log_e"] for one in found] == [5.0, 10.0]
    assert found[0]["schema"] == "idloop/live_evidence/1"


def test_a_bag_without_findings_has_none(tmp_path):
    writer = BagWriter(tmp_path / "bag", {"/estimator/fit": DIAGNOSTICS}, "kilted")
    writer.write("/estimator/fit", 0, encode_diagnostics(0, []))
    writer.close()
    assert read_findings(tmp_path / "bag") == Findings()


def test_no_bag_is_one_line(tmp_path):
    with pytest.raises(IdloopError, match="cannot be read") as caught:
        read_findings(tmp_path / "nowhere")
    assert "\n" not in str(caught.value)
