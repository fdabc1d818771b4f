"""Observers with a disturbance force, and their innovations."""
