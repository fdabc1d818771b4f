"""Screening: candidates, the score test of their traces, and whether the motion responds to the command."""
