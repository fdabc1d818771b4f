"""Numbers in words."""

import pytest

from idloop.validation.words import beside


@pytest.mark.parametrize(
    ("value", "scale", "text"),
    [(-7e-11, 0.3, "0"), (3.03e-11, 2e-11, "3.03 · 10⁻¹¹"), (0.0, 0.0, "0"), (-0.02, 1.5, "−0.02"), (1e-4, 1.0, "0")],
)
def test_what_is_nothing_beside_its_scale_is_0(value: float, scale: float, text: str) -> None:
    assert beside(value, scale) == text
