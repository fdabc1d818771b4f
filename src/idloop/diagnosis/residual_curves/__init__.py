"""Curves that the residual follows where no effect of the catalogue explains it."""
