"""Figures, all in one style; they draw numbers that other parts have computed."""
