"""Experiment design: the motion, within limits, that best separates models or shows effects."""
