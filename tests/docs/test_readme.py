"""Every command of the README runs as it stands, and its links lead somewhere."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(sh|python)\n(.*?)^```$", README, re.DOTALL | re.MULTILINE)
DATA = "../shared/data"


def test_the_readme_is_short() -> None:
    assert README.count("\n") <= 150


@pytest.mark.parametrize("page", ["README.md", "CONTRIBUTING.md"])
def test_every_link_leads_somewhere(page: str) -> None:
    links = re.findall(r"\]\(([^)#\s]+)[^)]*\)", (ROOT / page).read_text(encoding="utf-8"))
    assert [link for link in links if "://" not in link and not (ROOT / link).exists()] == []


def test_the_scripts_that_the_readme_begins_with_are_there() -> None:
    language, block = BLOCKS[0]
    scripts = re.findall(r"^\./(\S+)", block, re.MULTILINE)
    assert (language, len(scripts)) == ("sh", 2)
    for script in scripts:  # the demo is run by tests/cli/test_demo.py, and this is the other one
        assert os.access(ROOT / script, os.X_OK)
        subprocess.run(["bash", "-n", ROOT / script], check=True)


@pytest.mark.slow
@pytest.mark.ros
def test_every_command_runs_as_it_stands(tmp_path: Path) -> None:
    pytest.importorskip("rclpy")
    data_dir = Path(os.environ.get("IDLOOP_DATA", ROOT.parent / "shared" / "data"))
    checkout = tmp_path / "checkout"
    (checkout / ".venv" / "bin").mkdir(parents=True)
    (checkout / ".venv" / "bin" / "idloop").symlink_to(Path(sys.executable).parent / "idloop")
    if data_dir.is_dir():
        (tmp_path / "shared").mkdir()
        (tmp_path / DATA.removeprefix("../")).symlink_to(data_dir.resolve())
    for language, block in BLOCKS[1:]:
        if DATA in block and not data_dir.is_dir():
            print(f"not run, for want of {data_dir}: {block.splitlines()[0]}")
            continue
        command = ["bash", "-e", "-c", block] if language == "sh" else [sys.executable, "-c", block]
        run = subprocess.run(
            command, cwd=checkout, env=os.environ | {"MPLBACKEND": "agg"}, text=True, check=False, capture_output=True
        )
        assert run.returncode == 0, f"{block}\n{run.stdout}\n{run.stderr}"
    assert {"bags", "refined", "figures", "report.html", "controller.yaml"} <= {
        path.name for path in checkout.iterdir()
    }
