"""Nonlinear ARX models: tapped delays with a wavelet network or a neural network behind them.

``save`` and ``load`` keep them in files.
"""

from __future__ import annotations

from idloop.estimation.networks.model import NarxModel, load, save
from idloop.estimation.networks.neural import narx_neural
from idloop.estimation.networks.training import TrainingHistory, TrainingRules
from idloop.estimation.networks.training_data import Division, Split, TappedDelays
from idloop.estimation.networks.wavelet import narx_wavelet

__all__ = [
    "Division",
    "NarxModel",
    "Split",
    "TappedDelays",
    "TrainingHistory",
    "TrainingRules",
    "load",
    "narx_neural",
    "narx_wavelet",
    "save",
]
