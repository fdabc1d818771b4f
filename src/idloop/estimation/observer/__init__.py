"""Innovations of a steady-state observer that carries a disturbance force."""
