"""Figures in Matplotlib."""
