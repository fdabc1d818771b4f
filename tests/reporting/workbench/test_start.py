"""`idloop workbench`: what is wrong is told before the page is served."""

from __future__ import annotations

from idloop.cli.main import run


def test_an_effect_that_there_is_not_is_one_line(tmp_path, capsys):
    bag = tmp_path / "bag"
    bag.mkdir()
    assert run(["workbench", "dc_motor", str(bag), "--effects", "deadzone", "--no-browser"]) == 2
    assert capsys.readouterr().err == "idloop workbench: unknown effect 'deadzone' (here: 'dead_zone')\n"
