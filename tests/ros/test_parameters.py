"""Parameter tables: what they refuse, and that the reference is written from them."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop.errors import InputError
from idloop_nodes import executables
from idloop_nodes.descriptions import KINDS, describe
from idloop_nodes.document import document
from idloop_nodes.parameters import accept, accept_all
from idloop_nodes.progress import REPORT_EVERY

TABLES = {kind: describe(kind).parameters() for kind in KINDS}
BY_NAME = {spec.name: spec for kind in ("plant", "estimator") for spec in TABLES[kind]}


def test_every_executable_has_a_table_with_defaults_that_pass():
    assert {"plant", "mujoco_plant", "estimator"} <= set(KINDS)
    for kind, table in TABLES.items():
        assert callable(getattr(executables, kind))
        values = accept_all(table, {})
        assert set(values) == {spec.name for spec in table}


def test_every_parameter_says_what_it_is():
    for table in TABLES.values():
        names = [spec.name for spec in table]
        assert len(set(names)) == len(names)
        assert all(spec.description.endswith(".") for spec in table)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("window", float("nan")),
        ("window", float("inf")),
        ("window", 0.0),
        ("window", "long"),
        ("window", True),
        ("criterion", "best"),
        ("seed", 1.5),
        ("seed", -1),
        ("noise", 1),
        ("effects", "dead_zone@input"),
        ("effects", [True]),
    ],
)
def test_bad_values_are_refused_in_one_line(name, value):
    with pytest.raises(InputError, match=name) as caught:
        accept(BY_NAME[name], value)
    assert "\n" not in str(caught.value)


def test_integers_stand_for_doubles():
    value = accept(BY_NAME["window"], 5)
    assert value == 5.0
    assert isinstance(value, float)


@pytest.mark.parametrize("value", [None, [], [""]])
def test_an_empty_list_has_three_spellings(value):
    assert accept(BY_NAME["effects"], value) == []


def test_a_listener_may_lag_behind_until_it_reports_again():
    assert BY_NAME["listener_window"].minimum == REPORT_EVERY


def test_the_excitation_offers_every_parameter_of_every_signal():
    from idloop.signals import SIGNALS

    names = {spec.name for spec in TABLES["excitation"]}
    for kind in SIGNALS.values():
        assert {f"{kind.name}.{spec.name}" for spec in kind.parameters} <= names


def test_the_written_reference_is_up_to_date():
    written = Path(__file__).parents[2] / "docs" / "nodes.md"
    assert written.read_text(encoding="utf-8") == document(), "run: python -m idloop_nodes.document docs/nodes.md"
