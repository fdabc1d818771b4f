"""Weighted nonlinear least squares: the problem, its Jacobian and the search."""
