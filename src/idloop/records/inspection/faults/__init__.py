"""Faults of a recording, those of one idea in a file."""
