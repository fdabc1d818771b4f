"""Row C2: linear transfer function of second order of the lead-screw stage, by least squares."""

from __future__ import annotations

from typing import TYPE_CHECKING

from papers import Progress
from papers.claim import below
from papers.reproduction import Line
from papers.stage import stage_paper
from papers.stage.stage_candidates import StageFits, bench, black_box, scores

if TYPE_CHECKING:
    from idloop.estimation.black_box.sampled import SampledData
    from idloop.estimation.polynomial import PolynomialModel

ORDER, HIGHER = 2, (4, 6)
# A higher order that gains less than this does not make the linear model sufficient [%].
_GAIN = 5.0


def transfer_function(data: SampledData, order: int = ORDER) -> PolynomialModel:
    """Least squares of the output error: the linear model of this order with the best free run."""
    from idloop.estimation.polynomial import output_error

    return output_error(data, order, order)


def reproduce(seed: int, progress: Progress, duration: float = stage_paper.DURATION) -> StageFits:
    """Fit linear models to the stage.

    Parameters
    ----------
    seed : int
        Of the excitation.
    progress : callable
    duration : float
        Of each record [s].
    """
    from idloop.estimation.polynomial import arx

    progress(0.0, "experiments")
    data = bench(seed, duration)
    progress(0.4, "linear least squares")
    models = {
        "transfer function": transfer_function(data.train),
        "linear least squares (ARX)": arx(data.train, ORDER, ORDER),
    }
    candidates = tuple(black_box(name, model, data) for name, model in models.items())
    best = scores(candidates[0], data).free
    lines = []
    for order in HIGHER:
        progress(0.7, f"order {order}")
        fit = scores(black_box("", transfer_function(data.train, order), data), data).free
        lines.append(Line(f"transfer function of order {order}: FIT, free run", fit, "not sufficient", "%", "section 3",
                          below(best + _GAIN)))  # fmt: skip
    said = (
        (
            f"Table 2 contradicts itself: its FIT and MSE imply a standard deviation of {stage_paper.LINEAR.spread:.2f}"
            f" of the measured speed for the linear model and of {stage_paper.WAVELET.spread:.2f} and"
            f" {stage_paper.NEURAL.spread:.2f} for the networks. An MSE of {stage_paper.LINEAR.mse / 10:.5f}, a tenth"
            f" of the printed one, would agree with them, so no claim is made of the MSE."
        ),
        (
            "A linear model cannot both brake quickly, with dry friction and motor pulling one way, and speed up"
            " slowly, with one against the other."
        ),
    )
    return StageFits(data, candidates, stage_paper.LINEAR, tuple(lines), said)
