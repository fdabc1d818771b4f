"""Faults of a recording, a check in each file.

A check looks at one joint (`idloop.records.inspection.axis.Axis`) and returns findings with the evidence, the cure and
what the fault spoils. Its thresholds are in units of the scatter of the same record, for a false alarm in fewer than
one of a hundred good records (`benchmarks/inspection.py` counts them).
"""
