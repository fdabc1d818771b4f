"""The next experiment for the terminal: what is sent, what it decides, a row for each rival."""

from idloop.reporting.next_experiment import experiment_blocks
from idloop.reporting.text.blocks import Table, as_text

ERRORS = {"saturation@input": {"motor.position": {"value": 0.34, "unit": "rad", "noise": 0.001}}}
SUGGESTED = {
    "signal": {"name": "sine", "sample_time": 0.01, "duration": 4.0, "amplitude": 1.5},
    "adds_to": "command",
    "unit": "V",
    "text": "expected to tell both apart",
    "outcomes": [
        {"rival": "dead_zone@input", "closest": "saturation@input", "in_favour": 120.0, "errors": ERRORS},
        {"rival": "saturation@input", "closest": "dead_zone@input", "in_favour": 0.4, "errors": {}},
    ],
}


def test_a_row_for_each_rival() -> None:
    blocks = list(experiment_blocks(SUGGESTED))
    assert blocks[0] == "next experiment: sine on the command, 4 s, amplitude 1.5 V"
    (table,) = (block for block in blocks if isinstance(block, Table))
    assert table.rows == (
        ("dead_zone@input", "saturation@input", "0.34 rad of motor.position, noise 0.001", "120", "yes"),
        ("saturation@input", "dead_zone@input", "none: it contains this one", "0.4", "no"),
    )


def test_a_reason_alone_has_no_table() -> None:
    assert as_text(experiment_blocks({"text": "no experiment keeps every rival inside the limits"})).startswith("no ")
