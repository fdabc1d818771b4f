"""Readers of the forms of log files, each in one file; `registry` lists them."""
