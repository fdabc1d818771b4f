"""The page of controllers is written from the catalogue, and its examples are controllers."""

import re
from pathlib import Path

import pytest
from ruamel.yaml import YAML

from idloop.control import CONTROLLERS, check_controller
from idloop.control.document import page

DOCS = Path(__file__).parents[2] / "docs"


def test_the_page_of_controllers_is_current() -> None:
    assert (DOCS / "controllers.md").read_text(encoding="utf-8") == page()


@pytest.mark.parametrize("kind", CONTROLLERS)
def test_every_type_has_a_section_with_its_keys_and_a_working_example(kind: str) -> None:
    section = page().split(f"\n## `{kind}`\n")[1].split("\n## ")[0]
    assert re.findall(r"^\| `([^`]+)` \|", section, re.MULTILINE) == [
        spec.name for spec in CONTROLLERS[kind].parameters
    ]
    (example,) = re.findall(r"```yaml\n(.*?)```", section, re.DOTALL)
    assert check_controller(YAML(typ="safe").load(example)["controller"])["type"] == kind
