"""A node that speaks through sockets only: no shared memory, and found all the same."""

from __future__ import annotations

import os
import re
import subprocess
import sys

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")
pytest.importorskip("rclpy", reason="no rclpy: run launch_scripts/test, or source a ROS 2")

from idloop.graph.command import OWN_PROFILES, PROFILE_VARIABLES, profile_variable
from idloop_nodes.sockets_only import RANGE, use_sockets_only

pytestmark = [pytest.mark.ros]
SCRIPT = """
import rclpy
from idloop_nodes.sockets_only import use_sockets_only
use_sockets_only()
rclpy.init()
rclpy.create_node('alone')
print(open('/proc/self/maps').read())
rclpy.shutdown()
"""


@pytest.fixture
def environment(monkeypatch):
    from rclpy.utilities import get_rmw_implementation_identifier

    if "fastrtps" not in get_rmw_implementation_identifier():
        pytest.skip("shared memory is kept out of Fast DDS only")
    for name in (*PROFILE_VARIABLES, "FASTDDS_BUILTIN_TRANSPORTS", RANGE):
        monkeypatch.setenv(name, "")  # so that what the code under test sets is taken back
        monkeypatch.delenv(name)
    return monkeypatch


@pytest.mark.parametrize("where", ["LOCALHOST", "SUBNET"])
def test_no_shared_memory_is_opened(ros_environment, environment, where):
    environment.setenv(RANGE, where)
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=True, timeout=200)
    assert not re.findall(r"/dev/shm/fast\S+", done.stdout)
    assert "WARN" not in done.stderr
    assert "XMLPARSER" not in done.stderr


@pytest.mark.parametrize("profile", OWN_PROFILES)
def test_our_own_profile_is_replaced(environment, profile):
    environment.setenv(RANGE, "LOCALHOST")
    environment.setenv(profile_variable(os.environ), profile)
    use_sockets_only()
    assert os.environ[RANGE] == "SYSTEM_DEFAULT"
    assert os.environ[profile_variable(os.environ)].endswith("loopback_udp.xml")


def test_a_profile_of_the_users_own_stays(environment):
    environment.setenv(RANGE, "LOCALHOST")
    environment.setenv(PROFILE_VARIABLES[0], "mine.xml")
    use_sockets_only()
    assert os.environ[RANGE] == "LOCALHOST"
    assert os.environ[PROFILE_VARIABLES[0]] == "mine.xml"
    assert "FASTDDS_BUILTIN_TRANSPORTS" not in os.environ
