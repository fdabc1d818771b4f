"""Rows C1 to C5: the lead-screw stage of Shamseldin (WSEAS 2022)."""
