"""The ROS packages name everything that the library needs: by a rosdep key, or in the list for pip."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

ROOT = Path(__file__).parents[2]
NODES = ROOT / "ros_ws" / "src" / "idloop_nodes"
KEYS = {"pyyaml": "python3-yaml"}  # where rosdep's name is another


@pytest.mark.skipif(sys.version_info < (3, 11), reason="no tomllib")
def test_every_dependency_of_the_library_is_named_once():
    import tomllib

    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    wanted = {re.split(r"[<>=~;\[ ]", one)[0]: one for one in project["dependencies"]}
    keys = {one.text for one in ET.parse(NODES / "package.xml").getroot().iter("exec_depend")}
    lines = (ROOT / "ros_ws" / "requirements.txt").read_text(encoding="utf-8").splitlines()
    by_pip = {re.split(r"[<>=]", line)[0]: line for line in lines if line and line[0].isalpha()}
    by_rosdep = {name for name in wanted if KEYS.get(name, f"python3-{name}") in keys}
    assert by_rosdep | set(by_pip) == set(wanted)
    assert not by_rosdep & set(by_pip)
    assert all(line == wanted[name] for name, line in by_pip.items())
    assert "-e ." in lines


def test_both_packages_have_one_version_and_one_licence():
    found = [ET.parse(path).getroot() for path in sorted((ROOT / "ros_ws" / "src").glob("*/package.xml"))]
    assert len(found) == 2
    assert len({(one.findtext("version"), one.findtext("license")) for one in found}) == 1
