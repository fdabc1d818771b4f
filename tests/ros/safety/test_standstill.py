"""A process that stood still is told from one that was busy."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop_nodes.middleware import LEASE, StandstillWatch, profile


@given(gap=st.floats(LEASE - 0.99, 1e6))
def test_a_process_that_stood_still_for_the_lease_is_forgotten(gap):
    watch = StandstillWatch(5.0, 1.0)
    assert not watch.forgotten(5.05, 1.01)
    assert watch.forgotten(5.05 + gap, 1.02)
    assert not watch.forgotten(5.1 + gap, 1.03), "said once"


@given(gap=st.floats(0.0, LEASE - 1.01))
def test_a_shorter_pause_is_none(gap):
    assert not StandstillWatch(5.0, 1.0).forgotten(5.0 + gap, 1.0)


@given(gap=st.floats(LEASE, 1e4))
def test_a_busy_process_is_not_forgotten(gap):
    assert not StandstillWatch(5.0, 1.0).forgotten(5.0 + gap, 1.0 + 0.5 * gap)


@pytest.mark.parametrize("this_machine", [False, True])
@pytest.mark.parametrize("before_kilted", [False, True])
def test_the_profiles_have_this_lease(this_machine, before_kilted):
    text = profile(this_machine=this_machine, before_kilted=before_kilted)
    (lease,) = ET.fromstring(text).iter("{http://www.eprosima.com}leaseDuration")
    assert float(lease[0].text) == LEASE
