"""Rows A1 to A8: the DC motor of Rungroungdouyboon (Lehigh University 1999)."""
