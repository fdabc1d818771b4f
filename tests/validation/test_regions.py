import numpy as np
import pytest

from idloop.validation.regions import error_share, motion_regions


def test_every_sample_is_in_exactly_one_region() -> None:
    time = np.linspace(0.0, 10.0, 1001)
    regions = motion_regions(time, np.sign(np.sin(time)) * (np.abs(np.sin(time)) > 0.2))
    assert np.all(np.sum(list(regions.values()), axis=0) == 1)
    assert np.any(regions["standing"])
    assert np.any(regions["after a reversal"])


def test_error_is_found_where_it_was_put() -> None:
    time = np.linspace(0.0, 20.0, 2001)
    velocity = np.sin(time)
    regions = motion_regions(time, velocity)
    share = error_share(np.where(regions["backward"], 1.0, 0.0), regions)
    assert share["backward"]["error"] == 1.0
    assert sum(s["error"] for s in share.values()) == pytest.approx(1.0)
    assert sum(s["time"] for s in share.values()) == pytest.approx(1.0)
