"""What a diagnosis may be asked to measure models by, and how sure and how large an effect has to be."""

from __future__ import annotations

from idloop.errors import InputError

PREDICTION, SIMULATION, FORCE = "prediction", "simulation", "force"
KINDS = (PREDICTION, SIMULATION, FORCE)

# An effect that makes errors on unseen samples smaller by less than this part is not worth a name.
MINIMUM_IMPROVEMENT = 0.01


def first_kind(criterion: str) -> str:
    """Criterion of the errors that models are measured by where a force balance does not decide.

    Parameters
    ----------
    criterion : {"auto", "prediction", "simulation", "force"}

    Returns
    -------
    {"prediction", "simulation"}

    Raises
    ------
    InputError
        Unknown criterion.
    """
    if criterion != "auto" and criterion not in KINDS:
        raise InputError(f"criterion {criterion!r} is unknown; choose auto, {', '.join(KINDS)}")
    return SIMULATION if criterion == SIMULATION else PREDICTION


def check_numbers(level: float, minimum_improvement: float) -> None:
    """Check an error rate and a least improvement.

    Raises
    ------
    InputError
        A number that is none of these.
    """
    if not 0.0 < level < 0.5:
        raise InputError(f"level = {level} is no error rate; choose something such as 0.01")
    if not 0.0 <= minimum_improvement < 1.0:
        raise InputError(
            f"minimum_improvement = {minimum_improvement} is no part of an error; choose something such as 0.01"
        )
