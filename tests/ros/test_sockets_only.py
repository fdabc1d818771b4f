"""A process that speaks through sockets only: no shared memory, and a choice of the user's own stays."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")
pytest.importorskip("rclpy", reason="no rclpy: run launch_scripts/test, or source a ROS 2")

from idloop_nodes.middleware import PROFILE_VARIABLES, RANGE, TRANSPORTS, use_sockets_only

pytestmark = [pytest.mark.ros]
SCRIPT = """
import rclpy
from std_msgs.msg import Header
from idloop_nodes.middleware import use_sockets_only
SET
rclpy.init()
node = rclpy.create_node('alone')  # kept: with it the memory would go
node.create_publisher(Header, 'alone', 1).publish(Header())
print(open('/proc/self/maps').read())
rclpy.shutdown()
"""


@pytest.fixture
def environment(ros_environment, monkeypatch):
    from rclpy.utilities import get_rmw_implementation_identifier

    if "fastrtps" not in get_rmw_implementation_identifier():
        pytest.skip("shared memory is kept out of Fast DDS only")
    for name in (*PROFILE_VARIABLES, TRANSPORTS, RANGE, "ROS_DISTRO"):
        monkeypatch.setenv(name, "")  # so that what the code under test sets is taken back
        monkeypatch.delenv(name)
    return monkeypatch


def _script(setting):
    return [sys.executable, "-c", SCRIPT.replace("SET\n", f"{setting}\n")]


def test_without_it_there_is_shared_memory(environment):
    environment.setenv(RANGE, "LOCALHOST")
    done = subprocess.run(_script("pass"), capture_output=True, text=True, check=True, timeout=200)
    assert re.findall(r"/dev/shm/fast\S+", done.stdout)


@pytest.mark.parametrize("where", ["LOCALHOST", "SUBNET"])
def test_no_shared_memory_is_opened_and_fast_dds_understands_every_word(environment, where):
    environment.setenv(RANGE, where)
    done = subprocess.run(_script("use_sockets_only()"), capture_output=True, text=True, check=True, timeout=200)
    assert not re.findall(r"/dev/shm/fast\S+", done.stdout)
    assert "WARN" not in done.stderr
    assert "XML" not in done.stderr


@pytest.mark.parametrize("where", ["LOCALHOST", "SUBNET"])
@pytest.mark.parametrize(("distribution", "variable"), [("humble", 1), ("jazzy", 1), ("kilted", 0)])
def test_each_fast_dds_gets_a_profile_whose_words_it_knows(environment, where, distribution, variable):
    environment.setenv(RANGE, where)
    environment.setenv("ROS_DISTRO", distribution)
    environment.setenv(PROFILE_VARIABLES[not variable], "")
    use_sockets_only()
    here = where == "LOCALHOST"
    assert os.environ[RANGE] == ("SYSTEM_DEFAULT" if here else where)
    (file,) = (Path(os.environ[name]) for name in PROFILE_VARIABLES if name in os.environ)
    assert os.environ.get(PROFILE_VARIABLES[variable]) == str(file)
    text = file.read_text()
    assert ("127.0.0.1" in text) is here
    assert ("heartbeatPeriod" in text) is bool(variable)
    assert ("type_propagation" in text) is not bool(variable)


@pytest.mark.parametrize("name", [*PROFILE_VARIABLES, TRANSPORTS])
def test_a_choice_of_the_users_own_stays(environment, name):
    environment.setenv(RANGE, "LOCALHOST")
    environment.setenv(name, "mine")
    before = dict(os.environ)
    use_sockets_only()
    assert dict(os.environ) == before
