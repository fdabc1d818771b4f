"""Both ends of the link between bridge and guardian, in one process."""

from __future__ import annotations

import os

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop.errors import InputError
from idloop_nodes.safety.guardian_link import STOPPED, WAITS, WATCHES, BridgeEnd, GuardianEnd, Hello, address

MS = 1_000_000
HELLO = Hello("/robot/commands", "float64")
PATIENCE = 40 * MS


@pytest.fixture
def where(request):
    return address(os.getpid(), f"/{request.node.name}")


@pytest.fixture
def guardian(where):
    one = GuardianEnd(where)
    yield one
    one.close()


@pytest.fixture
def bridge(where):
    one = BridgeEnd(where, HELLO, PATIENCE)
    yield one
    one.close()


def test_without_a_guardian_it_says_how_to_start_one(bridge):
    assert bridge.listen(0) == "no guardian watches the bridge (start idloop_nodes guardian)"
    bridge.beat(b"zero")


def test_they_meet_and_the_guardian_learns_what_stops_the_motor(guardian, bridge):
    assert bridge.listen(0)
    bridge.beat(b"zero")
    assert guardian.receive() == (b"zero", False)
    assert guardian.hello == HELLO
    guardian.send(WAITS, "/guardian")
    assert bridge.listen(MS) == "the guardian has not met the robot yet"
    guardian.send(WATCHES, "/guardian")
    assert bridge.listen(2 * MS) == ""
    assert bridge.guardian == "/guardian"
    bridge.beat(b"")
    assert guardian.receive() == (b"", False), "nothing is to be sent any more"


@pytest.mark.parametrize(("late", "reason"), [(PATIENCE, ""), (PATIENCE + 1, "the guardian is silent")])
def test_a_guardian_that_hangs_is_missed(guardian, bridge, late, reason):
    bridge.listen(0)
    guardian.receive()
    guardian.send(WATCHES, "/guardian")
    assert bridge.listen(MS) == ""
    assert bridge.listen(MS + late) == reason


def test_a_guardian_that_ends_is_missed_at_once(where, bridge):
    guardian = GuardianEnd(where)
    bridge.listen(0)
    guardian.receive()
    guardian.send(WATCHES, "/guardian")
    assert bridge.listen(MS) == ""
    guardian.close()
    assert bridge.listen(2 * MS) == "the guardian is gone"
    again = GuardianEnd(where)
    assert bridge.listen(3 * MS) == "the guardian is gone", "until the new one has spoken"
    again.receive()
    again.send(WATCHES, "/guardian")
    assert bridge.listen(4 * MS) == ""
    again.close()


def test_a_motor_that_the_guardian_stopped_starts_softly_again(guardian, bridge):
    bridge.listen(0)
    guardian.receive()
    guardian.send(STOPPED, "/guardian")
    guardian.send(WATCHES, "/guardian")
    assert bridge.listen(MS) == "the guardian stopped the motor because the bridge was silent"
    assert bridge.intervened
    assert bridge.listen(2 * MS) == ""
    assert not bridge.intervened


def test_a_bridge_that_ends_is_known_at_once_and_another_may_come(where, guardian, bridge):
    bridge.listen(0)
    bridge.beat(b"zero")
    bridge.close()
    assert guardian.receive() == (b"zero", True)
    assert guardian.receive() == (None, False)
    other = BridgeEnd(where, Hello("/other", "float64"), PATIENCE)
    other.listen(0)
    assert guardian.receive() == (None, False)
    assert guardian.hello.topic == "/other"
    assert guardian.connected
    other.close()


def test_a_guardian_whose_bridge_hangs_is_not_held_up(guardian, bridge):
    bridge.listen(0)
    guardian.receive()
    for _ in range(100_000):
        guardian.send(WATCHES, "/guardian")


def test_a_bridge_whose_guardian_hangs_is_not_held_up(guardian, bridge):
    bridge.listen(0)
    for _ in range(100_000):
        bridge.beat(b"zero")


def test_two_guardians_of_one_bridge_are_refused(where, guardian):
    with pytest.raises(InputError, match="another guardian watches this bridge already"):
        GuardianEnd(where)


@given(name=st.text(min_size=1, max_size=300), domain=st.integers(0, 232))
def test_every_bridge_has_an_address_of_its_own_that_fits(name, domain):
    one = address(domain, name)
    assert len(one.encode()) <= 107
    assert one not in {address(domain + 1, name), address(domain, name + "x")}
