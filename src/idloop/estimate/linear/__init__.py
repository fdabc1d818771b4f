"""Linear models in innovation form: what every black-box estimator returns, as a python-control system."""

from __future__ import annotations

from idloop.estimate.linear.model import Coefficient, LinearModel

__all__ = ["Coefficient", "LinearModel"]
