"""Which physical effect a model lacks: evidence by unseen samples in two views, the ladder, the next experiment."""

from idloop.diagnose.candidate import Candidate
from idloop.diagnose.diagnose import diagnose
from idloop.diagnose.diagnosis import Diagnosis
from idloop.diagnose.gate import Gate
from idloop.diagnose.ladder import Ladder, Step
from idloop.diagnose.refine import add_effect, refine
from idloop.diagnose.unknown import UnknownStructure

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
