"""Row C4: NARX neural network of the lead-screw stage with 10 hidden neurons, open- and closed-loop form."""

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

# Trainings of which the one with the least validation error is kept, as the paper's "multiple iterations".
RESTARTS = 3
CLOSED, OPEN = "neural network, closed-loop form", "neural network, open-loop form"


def neural_network(data: SampledData, closed: bool, seed: int) -> NarxModel:
    """Two past speeds and commands, 10 neurons, Levenberg-Marquardt, 70/15/15 % of the samples drawn at random.

    Parameters
    ----------
    data : SampledData
    closed : bool
        Train on its own past outputs after the training on the measured ones.
    seed : int
        Of division and starts.
    """
    from idloop.estimation.networks import narx_neural

    return narx_neural(
        data, hidden=stage_paper.HIDDEN, form="parallel" if closed else "series-parallel", restarts=RESTARTS, seed=seed
    )


def reproduce(seed: int, progress: Progress, duration: float = stage_paper.DURATION) -> StageFits:
    """Fit the neural network to the stage in both forms.

    Parameters
    ----------
    seed : int
        Of excitation, division and starts.
    progress : callable
    duration : float
        Of each record [s].
    """
    progress(0.0, "experiments")
    data = bench(seed, duration)
    progress(0.3, "open-loop form")
    opened = neural_network(data.train, closed=False, seed=seed)
    progress(0.5, "closed-loop form")
    closed = neural_network(data.train, closed=True, seed=seed)
    split = closed.split
    counts = [part.size for part in (split.train, split.validation, split.test)]
    shares = "/".join(f"{100.0 * count / sum(counts):.0f}" for count in counts)
    lines = (
        Line("hidden neurons", float(closed.units), float(stage_paper.HIDDEN), "", "section 3",
             equals(stage_paper.HIDDEN)),
        Line("training, validation, test", shares, "70/15/15", "%", "section 3", equals("70/15/15")),
    )  # fmt: skip
    said = (
        (
            "Open-loop form: trained one step ahead on measured speeds, then run free. Closed-loop form: trained"
            f" further on its own speeds. Of {RESTARTS} trainings the one with the least validation error is kept."
        ),
    )
    candidates = (black_box(CLOSED, closed, data), black_box(OPEN, opened, data))
    return StageFits(data, candidates, stage_paper.NEURAL, lines, said)
