"""What was noticed in many records is said once."""

from __future__ import annotations

from types import SimpleNamespace

from idloop.cli._inputs import log_warnings
from idloop.records import Finding


def _records(count):
    for k in range(count):
        name = f"log({k + 1})"
        late = Finding("late_velocity", f"axis.velocity is {2.2 + 0.01 * k:.2f} ms late", where="axis.velocity")
        lost = Finding("lost_samples", f"{name}: {k + 1} samples are missing", level="warning")
        other = Finding("late_velocity", late.text, where="axis.velocity", level="warning")
        yield SimpleNamespace(name=name, findings=[late, lost, other])


def test_what_is_alike_but_for_numbers_in_many_records_is_one_line(capsys):
    log_warnings(_records(11))
    assert capsys.readouterr().err.splitlines() == [
        "log(1): log(1): 1 samples are missing (so in 10 more records)",
        "log(1): axis.velocity is 2.20 ms late (so in 10 more records)",
    ]


def test_of_few_records_each_is_named(capsys):
    log_warnings(_records(2))
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 4
    assert not any("more records" in line for line in lines)
