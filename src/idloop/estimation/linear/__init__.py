"""Linear models in innovation form: what every black-box estimator returns, as a python-control system.

``prediction_error`` refines any of them, ``fit_structure`` fits a structure of one's own, and ``c2d``, ``d2c`` and
``d2d`` convert between sample times and continuous time. ``save`` and ``load`` keep them in files.
"""

from __future__ import annotations

from idloop.estimation.linear.conversion import c2d, d2c, d2d
from idloop.estimation.linear.model import Coefficient, LinearModel
from idloop.estimation.linear.model_file import load, save
from idloop.estimation.linear.prediction_error import prediction_error
from idloop.estimation.linear.structure import fit_structure

__all__ = ["Coefficient", "LinearModel", "c2d", "d2c", "d2d", "fit_structure", "load", "prediction_error", "save"]
