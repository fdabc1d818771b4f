"""The examples of the documentation, run as they stand."""

import json
from pathlib import Path

from click.testing import CliRunner

from idloop.cli.main import group

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"


def test_an_own_effect_makes_the_belt_drive_fit(data_dir: Path, tmp_path: Path) -> None:
    runner = CliRunner()
    bag = str(tmp_path / "ced_z1")
    source = str(data_dir / "ced_prbs" / "drive.mat")
    assert runner.invoke(group, ["import", "ced", source, bag, "--part", "z1"]).exit_code == 0

    model = EXAMPLES / "own_effect" / "belt_drive.yaml"
    seeing = tmp_path / "seeing.yaml"
    seeing.write_text(model.read_text().replace("  - {effect: sign_blind", "  # - {effect: sign_blind"))

    def fit(source: Path) -> float:
        run = runner.invoke(group, ["fit", str(source), bag, "--criterion", "simulation", "--json"])
        assert run.exit_code == 0, run.output
        return json.loads(run.stdout)["train"][0]["free_run"]["fit"]["pulley.velocity"]

    assert fit(model) > 69.0
    assert fit(seeing) < 20.0
