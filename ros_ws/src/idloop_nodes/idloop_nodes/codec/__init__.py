"""Every conversion between a message's bytes and the values the library works with.

Nodes publish and subscribe raw CDR bytes: no message object is built on a control path, and the
bytes of equal values are equal.
"""

from idloop.records.bags.cdr import CdrError
from idloop_nodes.codec.commands import (
    TrajectoryPoint,
    decode_float,
    decode_floats,
    decode_trajectory,
    encode_float,
    encode_floats,
    encode_trajectory,
)
from idloop_nodes.codec.diagnostics import Level, Status, decode_diagnostics, encode_diagnostics
from idloop_nodes.codec.effects import (
    EffectSummary,
    Estimate,
    MissingSummary,
    UnknownSummary,
    missing_from_statuses,
    missing_to_statuses,
)
from idloop_nodes.codec.evidence import EffectEvidence, EvidenceSummary, evidence_from_statuses, evidence_to_statuses
from idloop_nodes.codec.joints import (
    JointReader,
    JointSample,
    JointWriter,
    decode_header,
    decode_joint_state,
    decode_time,
    encode_header,
    encode_joint_state,
    encode_time,
    peek_stamp,
)
from idloop_nodes.codec.ladder import LadderSummary, Measures, StepSummary, ladder_from_statuses, ladder_to_statuses
from idloop_nodes.codec.recursion import RecursionSummary, recursion_from_statuses, recursion_to_statuses
from idloop_nodes.codec.results import (
    FitSummary,
    ParameterSummary,
    fit_from_statuses,
    fit_to_statuses,
    parameters_from_statuses,
    parameters_to_statuses,
)
from idloop_nodes.codec.wear import WatchSummary, WearSummary, wear_from_statuses, wear_to_statuses

__all__ = [
    "CdrError",
    "EffectEvidence",
    "EffectSummary",
    "Estimate",
    "EvidenceSummary",
    "FitSummary",
    "JointReader",
    "JointSample",
    "JointWriter",
    "LadderSummary",
    "Level",
    "Measures",
    "MissingSummary",
    "ParameterSummary",
    "RecursionSummary",
    "Status",
    "StepSummary",
    "TrajectoryPoint",
    "UnknownSummary",
    "WatchSummary",
    "WearSummary",
    "decode_diagnostics",
    "decode_float",
    "decode_floats",
    "decode_header",
    "decode_joint_state",
    "decode_time",
    "decode_trajectory",
    "encode_diagnostics",
    "encode_float",
    "encode_floats",
    "encode_header",
    "encode_joint_state",
    "encode_time",
    "encode_trajectory",
    "evidence_from_statuses",
    "evidence_to_statuses",
    "fit_from_statuses",
    "fit_to_statuses",
    "ladder_from_statuses",
    "ladder_to_statuses",
    "missing_from_statuses",
    "missing_to_statuses",
    "parameters_from_statuses",
    "parameters_to_statuses",
    "peek_stamp",
    "recursion_from_statuses",
    "recursion_to_statuses",
    "wear_from_statuses",
    "wear_to_statuses",
]
