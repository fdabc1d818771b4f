"""Checks of a recording before a fit: what is wrong with it, and what it can show."""
