"""The examples of the documentation, run as they stand."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from idloop.cli.main import group
from idloop.records.tables import base_units, mapping

DOCS = Path(__file__).parents[2] / "docs"
EXAMPLES = DOCS / "examples"


@pytest.mark.slow
def test_an_own_effect_makes_the_belt_drive_fit(data_dir: Path, tmp_path: Path) -> None:
    runner = CliRunner()
    bag = str(tmp_path / "ced_z1")
    source = str(data_dir / "ced_prbs" / "drive.mat")
    assert runner.invoke(group, ["import", "ced", source, bag, "--part", "z1"]).exit_code == 0

    model = EXAMPLES / "own_effect" / "belt_drive.yaml"
    assert runner.invoke(group, ["trust", str(model)]).exit_code == 0
    seeing = tmp_path / "seeing.yaml"
    seeing.write_text(model.read_text().replace("  - {effect: sign_blind", "  # - {effect: sign_blind"))

    def fit(source: Path) -> float:
        run = runner.invoke(group, ["fit", str(source), bag, "--criterion", "simulation", "--json"])
        assert run.exit_code == 0, run.output
        return json.loads(run.stdout)["train"][0]["free_run"]["fit"]["pulley.velocity"]

    assert fit(model) > 69.0
    assert fit(seeing) < 20.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "outputs"),
    [("reference/mapping-file.md", 5), ("explanation/robustness.md", 1), ("explanation/evidence.md", 1)],
)
def test_the_examples_of_a_page_print_what_it_shows(name: str, outputs: int, tmp_path: Path) -> None:
    page = (DOCS / name).read_text(encoding="utf-8")
    programs = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    printed, compared = "", 0
    for language, file, block in re.findall(
        r"^```(\w+)(?: title=\"(\S+)\")?\n(.*?)^```$", page, re.DOTALL | re.MULTILINE
    ):
        if file:
            (tmp_path / file).write_text(block, encoding="utf-8")
        elif language == "sh":
            shell = subprocess.run(
                ["bash", "-c", block], cwd=tmp_path, env=os.environ | {"PATH": programs}, text=True, check=False,
                stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            )  # fmt: skip
            printed = shell.stdout
        elif language == "text":
            assert printed == block
            compared += 1
    assert compared == outputs


@pytest.mark.slow
@pytest.mark.parametrize("example", sorted((EXAMPLES / "from_python").glob("*.py")), ids=lambda path: path.stem)
def test_an_example_in_python_prints_what_it_says_and_is_the_one_on_the_page(example: Path, tmp_path: Path) -> None:
    text = example.read_text(encoding="utf-8")
    said = text.partition("# prints:\n")[2]
    run = subprocess.run([sys.executable, example], cwd=tmp_path, text=True, check=True, stdout=subprocess.PIPE)
    assert run.stdout
    assert "".join(f"# {line}\n" for line in run.stdout.splitlines()) == said
    assert f"```python\n{text}```\n" in (DOCS / "how-to" / "black-box.md").read_text(encoding="utf-8")


def test_the_page_of_the_mapping_file_names_every_key_and_every_unit() -> None:
    page = (DOCS / "reference" / "mapping-file.md").read_text(encoding="utf-8")
    codes = re.findall(r"`([^`\n]+)`", page)
    known = set(codes).union(*(re.findall(r"\w+", code) for code in codes))
    models = (mapping.Mapping, mapping.Part, mapping.Channel, *mapping._SECTIONS.values())
    keys = {field.alias or name for model in models for name, field in model.model_fields.items()}
    words = keys | base_units._BASE.keys() | base_units._ALIASES.keys() - {""}
    assert words - known == set()


def test_every_test_that_a_page_calls_a_proof_is_there() -> None:
    proofs = re.findall(
        r"`(tests/\S+\.py) -k (\w+)`", (DOCS / "explanation" / "robustness.md").read_text(encoding="utf-8")
    )
    assert len(proofs) > 40
    for file, word in proofs:
        names = re.findall(r"def (test_\w+)", (DOCS.parent / file).read_text(encoding="utf-8"))
        assert any(word in name for name in names), (file, word)
