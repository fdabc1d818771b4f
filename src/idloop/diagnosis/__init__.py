"""Which physical effect a model lacks: evidence by unseen samples in two views, the ladder, the next experiment."""

from idloop.diagnosis.candidate import Candidate
from idloop.diagnosis.diagnose import diagnose
from idloop.diagnosis.diagnosis import Diagnosis
from idloop.diagnosis.identifiability import Gate
from idloop.diagnosis.ladder import Ladder, Step
from idloop.diagnosis.refine import add_effect, refine
from idloop.diagnosis.residual_curves.unknown_structure import UnknownStructure

__all__ = [
    "Candidate",
    "Diagnosis",
    "Gate",
    "Ladder",
    "Step",
    "UnknownStructure",
    "add_effect",
    "diagnose",
    "refine",
]
