"""The view of free-run errors, asked where the free run of a fitted model is far off.

One-step predictions begin at every sample anew, and hardly see what acts for a moment: a play that only a sensor sees.
A free run gathers every model error, so that an effect must explain most of what is left. It gathers disturbances too,
into errors as slow as the record: an effect that fits these must gain likelihood by prediction as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from idloop.diagnosis.evidence.prediction_view import PredictionView
from idloop.diagnosis.model_errors import model_errors
from idloop.diagnosis.options import PREDICTION, SIMULATION, Options, diagnosis_problem
from idloop.estimation.likelihood.estimation_problem import EstimationProblem
from idloop.estimation.likelihood.refit import Refit, refit_or_none
from idloop.physics.model import Model
from idloop.records import Record

# A free run is far off that misses more than this part of an output and more than so many times its noise; there an
# effect must explain this part of the error, of whose power its trace must promise a part.
_NEAR, _BEYOND_NOISE, _MOST, _PROMISED = 0.005, 3.0, 0.7, 0.25


def free_run_view(
    start: Model,
    records: Sequence[Record],
    validation: Sequence[Record],
    options: Options,
    *,
    near: bool = False,
) -> tuple[PredictionView, Refit] | None:
    """The view, and the model fitted in it; None where its free run is near the data.

    Parameters
    ----------
    start : Model
        From where it is fitted.
    records, validation : sequence of Record
        What is fitted, and what the fit does not see.
    options : Options
    near : bool
        Whether the fit is expected near its start.
    """
    estimation = diagnosis_problem(start, records, SIMULATION, validation)
    fit = refit_or_none(estimation, start, near=near)
    if fit is None or not _far_off(fit.model, estimation):
        return None
    held_out = diagnosis_problem(start, validation, SIMULATION, records) if validation else None
    options = replace(options, minimum_improvement=max(_MOST, options.minimum_improvement))
    predicted = diagnosis_problem(start, records, PREDICTION, validation)
    return PredictionView(estimation, start, options, held_out, promised=_PROMISED, support=predicted), fit


def _far_off(model: Model, problem: EstimationProblem) -> bool:
    """Whether free runs of some seconds miss an output by much more than its noise."""
    noise = dict(zip(model.output_names, problem.noise / problem.deviation, strict=True))
    errors = model_errors(model, problem.records)["anew"]
    return any(error > max(_NEAR, _BEYOND_NOISE * noise[name]) for name, error in errors.items())
