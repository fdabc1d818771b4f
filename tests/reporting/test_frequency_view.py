"""Poles in words; what of a response may be read."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from idloop.reporting.figures.comparison import frequency_figures
from idloop.reporting.frequency_view import FrequencyView


def texts(*poles: complex) -> list[str]:
    nothing: Any = None
    return FrequencyView(nothing, nothing, np.array(poles, dtype=complex)).pole_texts


def test_a_pole_that_is_rounding_error_is_an_integrator() -> None:
    assert texts(-5.99, 1.16e-14, complex(-14.5, 108.0), complex(-14.5, -108.0)) == [
        "0 (integrator)", "−5.99 1/s", "17.3 Hz, damping ratio 0.133",
    ]  # fmt: skip
    assert texts(-1e-3, -2.0) == ["−0.001 1/s", "−2 1/s"]
    assert texts() == []


def response(value: Any, coherence: Any) -> Any:
    lines = len(value)
    return SimpleNamespace(
        frequency=np.arange(1.0, lines + 1.0), resolved=np.ones(lines, dtype=bool),
        response=np.asarray(value, dtype=complex)[:, None, None], coherence=np.asarray(coherence, dtype=float)[:, None],
        output_units=("rad",), input_units=("V",),
    )  # fmt: skip


def test_a_response_is_read_only_where_the_command_explains_the_output() -> None:
    """Two bands of a falling phase with noise between and behind them."""
    random = np.random.default_rng(0)
    falling, again = (np.exp(-1j * np.linspace(*ends, 40)) for ends in ((0.0, 9.0), (8.0, 17.0)))
    noise = np.exp(1j * random.uniform(0.0, 6.28, 200))
    coherence = np.concatenate([np.full(40, 0.9), np.full(100, 0.1), np.full(40, 0.8), np.full(60, 0.2)])
    seen = np.concatenate([falling, noise[:100], again, noise[100:160]])
    view = FrequencyView(response(seen, coherence), response(seen, coherence), np.zeros(0))
    for line in view.bode(0):
        np.testing.assert_array_equal(np.isfinite(line.phase), coherence > 0.6)
        np.testing.assert_array_equal(np.isfinite(line.read), coherence > 0.6)
        # Each band falls by its own 9 rad and goes on where the last one ended, whatever noise lies between.
        np.testing.assert_allclose(line.phase[[0, 39, 140, 179]], np.degrees([0.0, -9.0, -8.0, -17.0]), atol=1e-9)
        assert np.isfinite(line.unread[100])
        assert np.isnan(line.unread[20])
    assert "above 0.6: at 33 % of the frequencies, between 1 and 180 Hz" in view.frequency_note(0)
    blind = response(seen, np.full(240, 0.2))
    view = FrequencyView(blind, blind, np.zeros(0))
    assert "nowhere above 0.6" in view.frequency_note(0)
    # Without a range the figure of the phase had no axes, and the browser's log a warning at every fit.
    _, phase, _ = frequency_figures(view)
    assert np.isfinite([phase.y_range.start, phase.y_range.end]).all()
