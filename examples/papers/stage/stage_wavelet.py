"""Row C3: nonlinear ARX model of the lead-screw stage with a wavelet network of 25 units."""

from __future__ import annotations

from typing import TYPE_CHECKING

from papers import Progress
from papers.claim import equals
from papers.reproduction import Line
from papers.stage import stage_paper
from papers.stage.stage_candidates import StageFits, bench, black_box

if TYPE_CHECKING:
    from idloop.estimation.black_box.sampled import SampledData
    from idloop.estimation.networks import NarxModel


def wavelet_network(data: SampledData) -> NarxModel:
    """Two past speeds and commands, 25 units, fitted one step ahead as the toolbox does by default."""
    from idloop.estimation.networks import narx_wavelet

    return narx_wavelet(data, units=stage_paper.WAVELET_UNITS)


def reproduce(seed: int, progress: Progress, duration: float = stage_paper.DURATION) -> StageFits:
    """Fit the wavelet network to the stage.

    Parameters
    ----------
    seed : int
        Of the excitation.
    progress : callable
    duration : float
        Of each record [s].
    """
    progress(0.0, "experiments")
    data = bench(seed, duration)
    progress(0.5, "wavelet network")
    model = wavelet_network(data.train)
    lines = (
        Line("units", float(model.units), float(stage_paper.WAVELET_UNITS), "", "section 3",
             equals(stage_paper.WAVELET_UNITS)),
    )  # fmt: skip
    said = ("The orders of eq. 9 are a picture in the paper; two past speeds and two commands are taken.",)
    return StageFits(data, (black_box("wavelet network", model, data),), stage_paper.WAVELET, lines, said)
